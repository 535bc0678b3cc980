//! The list of the topics of a recording: [`listing`].

use std::fmt::Write as _;
use std::path::Path;

use crate::error::{Error, Result};
use crate::import::recording::{Overview, TopicOverview};
use crate::runs::Outcome;
use crate::text::words::first_names;
use crate::types::text::counted;

/// Maximum number of topics in a message.
pub(super) const MAX_NAMED: usize = 3;

/// Lists the topics with images.
///
/// # Errors
/// If no topic has images.
pub(super) fn listing(file: &Path, overview: &Overview) -> Result<Outcome> {
    if overview.image_topics().is_empty() {
        return Err(no_images(file, overview));
    }
    for problem in &overview.problems {
        tracing::warn!("{problem}");
    }
    let status = Outcome::complete_if(overview.problems.is_empty());
    Ok(Outcome::text(status, lines(overview)))
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
        let rate = topic
            .rate()
            .map_or(String::new(), |rate| format!("{rate:.1} Hz, "));
        let TopicOverview {
            schema,
            image_format: form,
            count,
            ..
        } = topic;
        let (messages, duration) = (counted(*count, "message"), topic.duration());
        let _ = writeln!(
            lines,
            "{name:names$}  {schema:schemas$}  {form:forms$}  {messages}, {rate}{duration:.1} s"
        );
    }
    let _ = writeln!(lines, "{} without images", counted(others, "further topic"));
    lines
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

/// The error for a recording without images, with its topics. `file` is the first file of the recording.
pub(super) fn no_images(file: &Path, overview: &Overview) -> Error {
    let unread = overview
        .topics
        .iter()
        .find(|(_, topic)| !topic.image_format.is_empty());
    let topics: Vec<String> = overview
        .topics
        .iter()
        .map(|(name, topic)| format!("{name} ({})", topic.schema))
        .collect();
    let problem = match (unread, topics.is_empty()) {
        (Some((name, topic)), _) => format!("{name} ({}) is {}", topic.schema, topic.image_format),
        (None, true) => overview
            .problems
            .first()
            .cloned()
            .unwrap_or_else(|| "it has no messages".to_owned()),
        (None, false) => format!("its topics are {}", first_names(&topics, MAX_NAMED)),
    };
    Error::data(
        file.display(),
        format_args!("no topic with images: {problem}"),
    )
}
