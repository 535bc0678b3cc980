//! The list of the topics of a recording: [`listing`].

use std::fmt::Write as _;
use std::path::PathBuf;

use super::conversion::video_commands;
use crate::data::import::recording::{Overview, TopicOverview};
use crate::error::{Error, Result};
use crate::report::text::words::first_names;
use crate::runs::Outcome;
use crate::types::text::counted;

/// Maximum number of topics in a message.
pub(super) const MAX_NAMED: usize = 3;

/// Lists the topics with images.
///
/// # Errors
/// If no topic has images.
pub(super) fn listing(files: &[PathBuf], overview: &Overview) -> Result<Outcome> {
    if overview.image_topics().is_empty() {
        return Err(no_images(files, overview));
    }
    for problem in &overview.problems {
        tracing::warn!("{problem}");
    }
    let status = Outcome::complete_if(overview.problems.is_empty());
    let mut lines = lines(overview);
    if let Some((topic, commands)) = extraction(files, overview) {
        let _ = writeln!(lines, "{topic}: {commands}");
    }
    Ok(Outcome::text(status, lines))
}

/// One line for each topic with images, and the number of other topics.
fn lines(overview: &Overview) -> String {
    let names = width(overview, |name, _| name.chars().count());
    let forms = width(overview, |_, topic| topic.image_format.chars().count());
    let schemas = width(overview, |_, topic| topic.schema.chars().count());
    let mut lines = String::new();
    let mut others = 0;
    for (name, topic) in &overview.topics {
        if topic.image_format.is_empty() {
            others += 1;
            continue;
        }
        let rate = topic.rate().map_or(String::new(), |rate| format!("{rate:.1} Hz, "));
        let TopicOverview { schema, image_format: form, count, .. } = topic;
        let (messages, duration) = (counted(*count, "message"), topic.duration());
        let broken = broken(topic);
        let _ = writeln!(
            lines,
            "{name:names$}  {schema:schemas$}  {form:forms$}  {messages}, {rate}{duration:.1} s{broken}"
        );
    }
    let _ = writeln!(lines, "{} without images", counted(others, "further topic"));
    lines
}

/// The messages before the first readable image, to continue a line of the list.
fn broken(topic: &TopicOverview) -> String {
    match topic.broken {
        0 => String::new(),
        _ if !topic.has_images() => String::new(),
        1 => format!("; the first cannot be read: {}", topic.first_problem),
        count => format!("; the first {count} cannot be read: {}", topic.first_problem),
    }
}

/// The first topic with video, and the commands that make a video file of it.
fn extraction<'a>(files: &[PathBuf], overview: &'a Overview) -> Option<(&'a str, String)> {
    overview.topics.iter().find_map(|(name, topic)| {
        let commands = video_commands(files, name, topic.video?, topic.rate())?;
        Some((&**name, commands))
    })
}

/// Warns of other topics with images if `topic` alone is imported because they cannot be read.
pub(super) fn warn_of_unread(topic: &str, overview: &Overview) {
    for (name, unread) in &overview.topics {
        if !unread.has_images() && !unread.image_format.is_empty() {
            tracing::warn!(
                "{name} is {}; only {topic} is imported (--topic {topic} leaves out this warning)",
                unread.image_format
            );
        }
    }
}

fn width(overview: &Overview, text: fn(&str, &TopicOverview) -> usize) -> usize {
    overview
        .topics
        .iter()
        .filter(|(_, topic)| !topic.image_format.is_empty())
        .map(|(name, topic)| text(name, topic))
        .max()
        .unwrap_or(0)
}

/// The error for a recording without images, with its topics and, for video, the commands that make a video file.
pub(super) fn no_images(files: &[PathBuf], overview: &Overview) -> Error {
    let unread = overview.topics.iter().find(|(_, topic)| !topic.image_format.is_empty());
    let topics: Vec<String> =
        overview.topics.iter().map(|(name, topic)| format!("{name} ({})", topic.schema)).collect();
    let problem = match (unread, topics.is_empty()) {
        (Some((name, topic)), _) => format!("{name} ({}) is {}", topic.schema, topic.image_format),
        (None, true) => overview.problems.first().cloned().unwrap_or_else(|| "it has no messages".to_owned()),
        (None, false) => format!("its topics are {}", first_names(&topics, MAX_NAMED)),
    };
    let commands =
        extraction(files, overview).map_or(String::new(), |(topic, commands)| format!("\n{topic}: {commands}"));
    Error::data(files[0].display(), format_args!("no topic with images: {problem}{commands}"))
}
