//! The MCAP files of a recording: [`files`], [`open_reader`] and the [`overview`] of their topics.
//!
//! Times of the images of a topic: [`MessageTimes`].
//!
//! Intrinsics and exposures in a recording: [`Cameras`] and [`FrameExposures`].
//!
//! The list of the topics of a recording: [`listing`].

use std::collections::{BTreeSet, HashMap, VecDeque};
use std::fmt::Write as _;
use std::fs::File;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value};

use super::conversion::{conversion, video_commands};
use super::frame_writer::COPIED;
use darkqa_base::error::{Error, Result};
use darkqa_base::files::open;
use darkqa_base::types::Intrinsics;
use darkqa_base::types::text::counted;
use darkqa_data::Root;
use darkqa_data::import::recording::{
    CameraInfo, Exposure, FileImage, ForeignData, McapReader, Nanoseconds, Overview, TopicOverview, intrinsics_names,
};
use darkqa_engine::images::progress::Progress;
use darkqa_pictures::ImageFile;
use darkqa_pictures::decode_rule::DecodeRule;
use darkqa_report::text::words::first_names;
use darkqa_runs::Outcome;

/// Replaces folders by the MCAP files in them, in the order of their numbers.
pub(super) fn files(paths: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for path in paths {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let is_mcap = |file: &PathBuf| file.extension().is_some_and(|ending| ending == "mcap");
        let mut links_out = Vec::new();
        let mut inside = Root::new(path, &[])?.entries(path, &mut links_out)?;
        if let Some(link) = links_out.into_iter().find(is_mcap) {
            let problem = "this link leads out of the folder of the recording; name the file itself to read it";
            return Err(Error::data(link.display(), problem));
        }
        inside.retain(is_mcap);
        if inside.is_empty() {
            let problem = conversion(path);
            let problem = problem.unwrap_or_else(|| "no .mcap file in this folder".to_owned());
            return Err(Error::data(path.display(), problem));
        }
        inside.sort_by_cached_key(|file| {
            let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let name = stem.trim_end_matches(|c: char| c.is_ascii_digit()).to_owned();
            let number: u64 = stem[name.len()..].parse().unwrap_or(0);
            (name, number, stem)
        });
        files.extend(inside);
    }
    Ok(files)
}

/// A topic as part of a file name.
pub(super) fn slug(topic: &str) -> String {
    let name: String =
        topic.chars().map(|c| if c.is_alphanumeric() || matches!(c, '-' | '.') { c } else { '_' }).collect();
    name.trim_matches(['_', '.']).to_owned()
}

/// The name of a drive: the stem of its first file, without the number that bags append.
pub(super) fn drive_name(file: &Path) -> String {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let name = slug(stem.strip_suffix("_0").unwrap_or(&stem));
    if name.is_empty() { "drive".to_owned() } else { name }
}

/// Total size of files, in bytes.
pub(super) fn total_bytes(files: &[PathBuf]) -> u64 {
    files.iter().filter_map(|file| file.metadata().ok()).map(|metadata| metadata.len()).sum()
}

pub(super) fn open_reader(path: &Path) -> Result<McapReader<File>> {
    let file = open(path).map_err(|e| Error::file(path, "read", e))?;
    McapReader::open(file).map_err(|problem| {
        let problem = conversion(path).unwrap_or(problem);
        Error::data(path.display(), problem)
    })
}

/// The topics of all files.
pub(super) fn overview(files: &[PathBuf], progress: &Progress) -> Result<Overview> {
    let bar = progress.bar("files", files.len());
    let mut overview = Overview::default();
    for file in files {
        bar.inc();
        let reader = match open_reader(file) {
            Ok(reader) => reader,
            Err(e) if files.len() == 1 => return Err(e),
            Err(e) => {
                overview.problems.push(e.to_string());
                continue;
            }
        };
        overview.add(&file.display().to_string(), reader, file_image);
    }
    Ok(overview)
}

/// The image file in a message with this format.
fn file_image(format: &str, bytes: &[u8]) -> FileImage {
    let name = "an image".to_owned();
    let file = ImageFile::new(bytes.to_vec(), name, DecodeRule::default());
    let ending = file.extension();
    if !COPIED.contains(&ending) {
        let kind = ForeignData::detect(format, bytes, ending);
        let words = kind.words(format);
        return match kind {
            ForeignData::Video(_) => FileImage::Video(words),
            _ => FileImage::Unread(words),
        };
    }
    match file.check() {
        Ok((width, height)) => FileImage::Readable([width, height]),
        Err(Error::Data { problem, .. }) => FileImage::Unread(problem),
        Err(other) => FileImage::Unread(other.to_string()),
    }
}

/// Times of the images of a topic. Some drivers state one time stamp in all messages; the recorder's clock then
/// continues it.
#[derive(Debug, Default)]
pub(super) struct MessageTimes {
    /// Time stamp and log time of the first message.
    first: Option<[Nanoseconds; 2]>,
    /// True if a later message has another time stamp.
    has_changed: bool,
    /// True if a later message has another log time.
    log_advances: bool,
}

impl MessageTimes {
    /// The time of the next message from its time stamp, `None` if it has none, and the time of the recorder.
    pub(super) fn next(&mut self, stamp: Option<Nanoseconds>, log_time: Nanoseconds) -> Nanoseconds {
        let Some(stamp) = stamp else {
            return log_time;
        };
        let [first, first_log] = *self.first.get_or_insert([stamp, log_time]);
        self.has_changed |= stamp != first;
        self.log_advances |= log_time != first_log;
        if self.has_changed {
            return stamp;
        }
        stamp.saturating_add(log_time.saturating_sub(first_log))
    }

    /// True if several messages have the same time stamp, and none has another.
    pub(super) fn is_constant(&self) -> bool {
        self.log_advances && !self.has_changed
    }
}

/// Maximum number of exposures kept until their image arrives (chosen); drivers send both within a few frames.
const MAX_WAITING: usize = 1000;

/// The cameras of a recording by name, each with its intrinsics and the times from which they apply.
#[derive(Default)]
pub(super) struct Cameras(HashMap<String, Vec<(Nanoseconds, CameraInfo)>>);

impl Cameras {
    /// Adds the intrinsics of a camera, if they differ from the last ones.
    pub(super) fn add(&mut self, camera: &str, time: Nanoseconds, info: CameraInfo) {
        let infos = self.0.entry(camera.to_owned()).or_default();
        if infos.last().is_none_or(|(_, last)| *last != info) {
            infos.push((time, info));
        }
    }

    /// The intrinsics of an image topic at a time: the last ones before it, or else the first. Of several cameras whose
    /// names match the topic, the first one with intrinsics for this size is used.
    pub(super) fn intrinsics(&self, topic: &str, time: Nanoseconds, size: (usize, usize)) -> Option<Intrinsics> {
        intrinsics_names(topic).into_iter().find_map(|camera| {
            let infos = self.0.get(camera)?;
            let after = infos.partition_point(|(from, _)| *from <= time);
            let (_, info) = &infos[after.saturating_sub(1)];
            info.intrinsics_for(topic, size)
        })
    }
}

/// Exposures of chosen frames. An exposure may arrive before or after its image.
#[derive(Default)]
pub(super) struct FrameExposures {
    recent: VecDeque<(String, Exposure)>,
    wanted: BTreeSet<(String, Nanoseconds)>,
    pub(super) found: HashMap<(String, Nanoseconds), Map<String, Value>>,
}

impl FrameExposures {
    pub(super) fn add(&mut self, camera: &str, exposure: Exposure) {
        let key = (camera.to_owned(), exposure.stamp);
        if self.wanted.remove(&key) {
            self.found.insert(key, exposure.values);
            return;
        }
        self.recent.push_back((camera.to_owned(), exposure));
        if self.recent.len() > MAX_WAITING {
            self.recent.pop_front();
        }
    }

    /// Requests the exposure of a frame.
    pub(super) fn want(&mut self, camera: &str, stamp: Nanoseconds) {
        let key = (camera.to_owned(), stamp);
        match self.recent.iter().find(|(name, exposure)| name == camera && exposure.stamp == stamp) {
            Some((_, exposure)) => drop(self.found.insert(key, exposure.values.clone())),
            None => drop(self.wanted.insert(key)),
        }
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    fn times(stamps: &[i64], log_times: &[i64]) -> (Vec<i64>, bool) {
        let mut times = MessageTimes::default();
        let found = stamps
            .iter()
            .zip(log_times)
            .map(|(stamp, log)| times.next((*stamp != 0).then_some(*stamp), *log))
            .collect();
        (found, times.is_constant())
    }

    #[test]
    fn constant_stamps_follow_the_recorder() {
        assert_eq!(times(&[7, 7, 7], &[100, 101, 105]), (vec![7, 8, 12], true));
        // Controls: stamps that advance, one message, no stamps, a recorder without a clock.
        assert_eq!(times(&[7, 9, 11], &[100, 101, 105]), (vec![7, 9, 11], false));
        assert_eq!(times(&[7], &[100]), (vec![7], false));
        assert_eq!(times(&[0, 0], &[100, 101]), (vec![100, 101], false));
        assert_eq!(times(&[7, 7], &[100, 100]), (vec![7, 7], false));
        // A stamp that is repeated once is no constant one.
        assert_eq!(times(&[7, 7, 9, 7], &[100, 101, 102, 103]), (vec![7, 8, 9, 7], false));
    }
}
