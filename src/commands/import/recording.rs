//! `import mcap`: imports frames of a recording, or lists its topics.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs::File;
use std::num::NonZeroU16;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use serde_json::{Map, Value, json};

use super::frame_writer::{ChosenFrame, FrameSource, FrameWriter, VIDEO_REMEDY, summary, thumbnail};
use super::mcap_files::{
    Cameras, FrameExposures, MAX_NAMED, MessageTimes, drive_name, files, listing, no_images, open_reader, overview,
    slug, total_bytes, warn_of_unread,
};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Decides;
use darkqa_base::types::flags::positive;
use darkqa_base::types::text::counted;
use darkqa_data::import::recording::{
    CameraInfo, ChannelContent, Encoding, Event, ImageMessage, MAX_MESSAGE_BYTES, McapReader, MessageHeader,
    Nanoseconds, Overview, Sampler, SamplingArgs, Stretches, TopicClock, TopicOverview, camera_name, camera_of_info,
    is_without_image, seconds, stamp,
};
use darkqa_engine::images::progress::{Progress, StepBar};
use darkqa_engine::images::workers::{ThreadArgs, pool};
use darkqa_report::text::words::first_names;
use darkqa_runs::Outcome;

/// Number of bytes at the start of a message that contain its time stamp.
const STAMP_BYTES: u64 = 64;

/// The flags of `import mcap`.
#[derive(Debug, Args)]
pub(crate) struct McapArgs {
    /// MCAP files of one recording in their order, or the folder of a bag of ROS 2
    #[arg(value_name = "FILE", required = true, add = Decides::Pixels)]
    files: Vec<PathBuf>,
    /// A topic whose images are taken, repeatable; default: the only topic with images
    #[arg(long, value_name = "TOPIC", add = Decides::Trials)]
    topic: Vec<String>,
    /// Where the frames go; default: nowhere, the topics with images are listed
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    out: Option<PathBuf>,
    /// The flags that choose frames.
    #[command(flatten)]
    sampling: SamplingArgs,
    /// The code of white in images of 16 bits; default: 65535
    #[arg(long, value_name = "CODE", add = Decides::Pixels)]
    white: Option<NonZeroU16>,
    /// How frames are written.
    #[command(flatten)]
    written: DriveArgs,
}

/// The flags about the frames of a drive that are written.
#[derive(Debug, Args)]
pub(super) struct DriveArgs {
    /// The name the data set gives itself; default: the name of the recording
    #[arg(long, value_name = "NAME", add = Decides::Reply)]
    pub(super) name: Option<String>,
    /// Seconds of a drive that are one scene: intervals are clustered by scene
    #[arg(long, value_name = "SECONDS", value_parser = positive, default_value_t = 30.0, add = Decides::Trials)]
    pub(super) stretch: f64,
    /// Write into a folder that holds frames already
    #[arg(long, help_heading = "Output", add = Decides::Nothing)]
    pub(super) force: bool,
    /// The number of threads.
    #[command(flatten)]
    pub(super) threads: ThreadArgs,
}

impl DriveArgs {
    /// As [`check_output`].
    pub(super) fn check(&self, out: &Path) -> Result<()> {
        check_output(out, self.force)
    }

    /// The content of `dataset.json` for the frames of a drive.
    pub(super) fn info(&self, source: &str, drive: &str) -> Value {
        json!({
            "schema": "darkqa.dataset/1",
            "name": self.name.as_deref().unwrap_or(drive),
            "source": source,
            "stretch": self.stretch,
        })
    }
}

/// Refuses a file, and a folder that has frames already unless `--force` is set.
pub(super) fn check_output(out: &Path, force: bool) -> Result<()> {
    if out.is_file() {
        return Err(Error::data(out.display(), "a file; a folder for frames expected"));
    }
    let list = out.join("frames.jsonl");
    if force || !list.exists() {
        return Ok(());
    }
    let problem = "the folder has frames already; --force overwrites them, another --out keeps both";
    Err(Error::data(list.display(), problem))
}

/// Warns of times in `--at` for which a topic or video has no frame.
pub(super) fn warn_of_missed(sampler: &Sampler, name: &str) {
    let missed = sampler.missed();
    if let Some(first) = missed.first() {
        tracing::warn!("{name}: no frame at {first} s or later; {} of --at", counted(missed.len(), "time"));
    }
}

/// Lists the topics of a recording, or imports frames of them.
///
/// # Errors
/// If a file is not an MCAP file, no topic has images, several topics have images and none is named, or no frame could
/// be read.
pub(crate) fn import(args: &McapArgs, progress: &Progress) -> Result<Outcome> {
    let files = files(&args.files)?;
    if let Some(out) = &args.out {
        args.written.check(out)?;
    }
    let needs_overview = args.out.is_none() || args.topic.is_empty() || args.sampling.max_frames.is_some();
    let overview = needs_overview.then(|| overview(&files, progress)).transpose()?;
    let Some(out) = &args.out else {
        return listing(&files, &overview.unwrap_or_default());
    };
    let topics = selected_topics(args, &files, overview.as_ref())?;
    let drive = drive_name(&files[0]);
    let mut import = Import::new(args, out, &drive, &topics, overview.as_ref())?;
    let mut problems = Vec::new();
    let bar = progress.bar("MB", total_bytes(&files) as usize >> 20);
    for file in &files {
        match open_reader(file) {
            Ok(reader) => import.read(file, reader, &bar, &mut problems),
            Err(e) if files.len() == 1 => return Err(e),
            Err(e) => problems.push(e.to_string()),
        }
    }
    drop(bar);
    let info = args.written.info("mcap", &drive);
    import.finish(args, out, info, &files[0], problems)
}

/// The topics to import: the named ones, or the only one with images.
fn selected_topics(args: &McapArgs, files: &[PathBuf], overview: Option<&Overview>) -> Result<BTreeSet<String>> {
    let known = overview.map(Overview::image_topics);
    let topics = match (known, overview) {
        (Some(known), Some(overview)) if known.is_empty() => {
            return Err(no_images(files, overview));
        }
        (Some(known), _) if args.topic.is_empty() && known.len() > 1 => {
            let problem = format_args!("several topics have images; choose one or more of {}", known.join(", "));
            return Err(Error::usage("--topic", problem));
        }
        (Some(known), Some(overview)) if args.topic.is_empty() => {
            warn_of_unread(known[0], overview);
            BTreeSet::from([known[0].to_owned()])
        }
        _ => args.topic.iter().cloned().collect(),
    };
    let slugs: BTreeSet<String> = topics.iter().map(|topic: &String| slug(topic)).collect();
    if slugs.len() < topics.len() {
        let problem = "two of the topics give their frames the same names; import them into two folders";
        return Err(Error::usage("--topic", problem));
    }
    Ok(topics)
}

/// A topic whose images are imported.
struct SelectedTopic {
    sampler: Sampler,
    /// Prefix of frame names; empty if only one topic is imported.
    prefix: String,
    /// Number of messages so far.
    seen: usize,
    times: MessageTimes,
    clock: TopicClock,
    /// Time of the last frame.
    latest: Option<Nanoseconds>,
}

/// State of the import of a recording.
struct Import<'a> {
    topics: BTreeMap<String, SelectedTopic>,
    stretches: Stretches,
    writer: FrameWriter<'a>,
    white: u16,
    cameras: Cameras,
    exposures: FrameExposures,
    /// Topics with images in the recording.
    with_images: BTreeSet<String>,
    /// Number of messages without a time stamp.
    without_stamp: usize,
    /// Number of frames with an earlier time than the previous frame of their topic.
    backwards: usize,
    /// Description of the first such frame.
    first_backwards: Option<String>,
}

impl<'a> Import<'a> {
    fn new(
        args: &McapArgs,
        out: &'a Path,
        drive: &str,
        topics: &BTreeSet<String>,
        overview: Option<&Overview>,
    ) -> Result<Self> {
        let white = args.white.map_or(u16::MAX, NonZeroU16::get);
        Ok(Self {
            topics: topics
                .iter()
                .map(|topic| {
                    let duration =
                        overview.and_then(|overview| overview.topics.get(topic)).map_or(0.0, TopicOverview::duration);
                    let selected = SelectedTopic {
                        sampler: args.sampling.sampler(duration),
                        prefix: if topics.len() > 1 { slug(topic) + "-" } else { String::new() },
                        seen: 0,
                        times: MessageTimes::default(),
                        clock: TopicClock::default(),
                        latest: None,
                    };
                    (topic.clone(), selected)
                })
                .collect(),
            stretches: Stretches::new(args.written.stretch),
            writer: FrameWriter::new(out, drive.to_owned(), white, pool(args.written.threads.threads)?),
            white,
            cameras: Cameras::default(),
            exposures: FrameExposures::default(),
            with_images: BTreeSet::new(),
            without_stamp: 0,
            backwards: 0,
            first_backwards: None,
        })
    }

    /// Imports the frames of one file. Damage is added to `problems`; frames before it are kept.
    fn read(&mut self, path: &Path, mut reader: McapReader<File>, bar: &StepBar, problems: &mut Vec<String>) {
        let place = path.display();
        let mut megabytes = 0;
        let mut last = None;
        while let Some(event) = reader.next_event() {
            match event {
                Event::Message(message) => {
                    self.process(&mut reader, &message);
                    if self.topics.contains_key(&message.channel.topic) {
                        last = Some(message);
                    }
                }
                Event::ChunkRead => self.writer.mark_intact(),
                Event::ChunkDamaged { times, problem } => {
                    let dropped = self.writer.drop_doubtful();
                    let [from, to] = times.map(|time| self.since_start(time));
                    problems.push(format!(
                        "{place}: a damaged chunk, {from:.3} s to {to:.3} s: {problem}; {} of it left out",
                        counted(dropped, "frame")
                    ));
                }
                Event::Cut(problem) => {
                    self.writer.mark_intact();
                    let last = last.take().map_or("before the first image".to_owned(), |message| {
                        let since = self.since_start(message.log_time);
                        format!("after {} at {since:.3} s", message.channel.topic)
                    });
                    problems.push(format!(
                        "{place}: the recording is cut off {last}: {problem}; frames up to there are kept"
                    ));
                }
            }
            let position = reader.position() as usize >> 20;
            bar.advance(position - megabytes);
            megabytes = position;
        }
        if reader.messages_without_channel > 0 {
            problems.push(format!(
                "{place}: {} of topics that are not described",
                counted(reader.messages_without_channel as usize, "message")
            ));
        }
        self.writer.write_waiting();
    }

    /// Seconds from the first frame to a time of the recorder.
    fn since_start(&self, log_time: Nanoseconds) -> f64 {
        seconds(log_time.saturating_sub(self.stretches.log_start().unwrap_or(log_time)))
    }

    /// Processes a message: an image, intrinsics or an exposure; others are ignored.
    fn process(&mut self, reader: &mut McapReader<File>, message: &MessageHeader) {
        let channel = &message.channel;
        let has_images = matches!(channel.content, ChannelContent::Image(_));
        if has_images && !self.with_images.contains(&channel.topic) {
            self.with_images.insert(channel.topic.clone());
        }
        if let Some(topic) = self.topics.get_mut(&channel.topic)
            && !has_images
        {
            topic.seen += 1;
            let problem = match &channel.content {
                ChannelContent::Unsupported(reason) => format!("{}: {reason}", channel.topic),
                ChannelContent::Video(_) => {
                    format!("{}: video, not images{VIDEO_REMEDY}", channel.topic)
                }
                _ => format!("{}: messages of {} are no images", channel.topic, channel.schema),
            };
            self.writer.fail(&channel.topic, &problem);
        }
        match &channel.content {
            ChannelContent::Camera(encoding) if message.length <= MAX_MESSAGE_BYTES => {
                if let Some(bytes) = reader.body()
                    && let Ok(info) = CameraInfo::parse(&channel.schema, *encoding, bytes)
                {
                    self.cameras.add(camera_of_info(&channel.topic), message.log_time, info);
                }
            }
            ChannelContent::Exposure(fields) if message.length <= MAX_MESSAGE_BYTES => {
                if let Some(bytes) = reader.body()
                    && let Ok(Some(exposure)) = fields.parse(bytes)
                {
                    self.exposures.add(camera_name(&channel.topic), exposure);
                }
            }
            ChannelContent::Image(encoding) if self.topics.contains_key(&channel.topic) => {
                self.process_image(reader, message, *encoding);
            }
            _ => {}
        }
    }

    /// Counts a message that is too long to be read.
    fn fail_oversized(&mut self, message: &MessageHeader) {
        let topic = &message.channel.topic;
        let since = self.since_start(message.log_time);
        let problem = format!(
            "{topic} at {since:.3} s: a message of {} MB; {} MB at most are read",
            message.length >> 20,
            MAX_MESSAGE_BYTES >> 20
        );
        self.writer.fail(topic, &problem);
    }

    /// Gives the image of a message to the writer, if its topic's sampler selects it.
    fn process_image(&mut self, reader: &mut McapReader<File>, message: &MessageHeader, encoding: Encoding) {
        let topic = message.channel.topic.clone();
        let schema = &message.channel.schema;
        if message.length > MAX_MESSAGE_BYTES {
            self.fail_oversized(message);
            return;
        }
        // If the body is cut off, the next event reports it.
        let Some(start) = reader.start_of_body(STAMP_BYTES) else {
            return;
        };
        let stated = stamp(schema, encoding, start).or_else(|| {
            let message = ImageMessage::parse(schema, encoding, reader.body()?).ok()?;
            message.stamp
        });
        let stated = stated.filter(|stamp| *stamp != 0);
        self.without_stamp += usize::from(stated.is_none());
        let time = stated.unwrap_or(message.log_time);
        let Some(selected) = self.topics.get_mut(&topic) else {
            return;
        };
        let sampled = selected.times.next(stated, message.log_time);
        let place = self.stretches.place(&mut selected.clock, sampled, message.log_time);
        if let Some(latest) = selected.latest.replace(time).filter(|latest| time < *latest) {
            let since = seconds(place.since);
            let back = seconds(latest.saturating_sub(time));
            self.backwards += 1;
            self.first_backwards
                .get_or_insert_with(|| format!("{topic} at {since:.3} s, {back:.3} s before the frame in front of it"));
        }
        let number = selected.seen;
        selected.seen += 1;
        let before = selected.sampler.progress();
        if !selected.sampler.is_due(place) || reader.body().is_none() {
            return;
        }
        let bytes = reader.take_body();
        if is_without_image(schema, encoding, &bytes) {
            selected.sampler.reset(before);
        }
        if selected.sampler.compares_pixels() {
            // An image that cannot be decoded goes to the writer, which counts the problem.
            if let Ok(thumbnail) = thumbnail(&message.channel, &bytes, self.white)
                && !selected.sampler.has_changed(thumbnail)
            {
                return;
            }
        }
        let name = format!("{}{number:06}", selected.prefix);
        self.exposures.want(camera_name(&topic), time);
        let frame = ChosenFrame {
            topic,
            name,
            place,
            time,
            log_time: message.log_time,
            facts: Map::new(),
            source: FrameSource::Message { channel: Arc::clone(&message.channel), bytes },
        };
        self.writer.push(frame, !message.is_in_chunk);
    }

    /// Adds topics without messages to the problems, and warns of times without a frame.
    ///
    /// # Errors
    /// If no topic has messages.
    fn check_topics(&self, place: &str, problems: &mut Vec<String>) -> Result<()> {
        let known: Vec<&String> = self.with_images.iter().collect();
        let known = match known.as_slice() {
            [] => "no topic has images".to_owned(),
            known => format!("topics with images: {}", first_names(known, MAX_NAMED)),
        };
        let absent: Vec<String> = self
            .topics
            .iter()
            .filter(|(_, selected)| selected.seen == 0)
            .map(|(topic, _)| format!("no messages of {topic}; {known}"))
            .collect();
        if let Some(first) = absent.first()
            && absent.len() == self.topics.len()
        {
            for problem in problems.iter() {
                tracing::warn!("{problem}");
            }
            return Err(Error::data(place, first));
        }
        problems.extend(absent.iter().map(|problem| format!("{place}: {problem}")));
        for (topic, selected) in self.topics.iter().filter(|(_, selected)| selected.seen > 0) {
            warn_of_missed(&selected.sampler, topic);
        }
        Ok(())
    }

    /// Adds intrinsics and exposures to the lines of the frames, and returns the number of frames with each.
    fn add_camera_facts(&mut self) -> [usize; 2] {
        let [mut with_intrinsics, mut with_exposure] = [0; 2];
        for written in &mut self.writer.written {
            let camera = camera_name(&written.topic);
            let intrinsics = self.cameras.intrinsics(&written.topic, written.log_time, written.size);
            if let Some(intrinsics) = intrinsics.filter(|_| !written.is_turned) {
                written.line.insert("intrinsics".to_owned(), json!(intrinsics));
                with_intrinsics += 1;
            }
            if let Some(exposure) = self.exposures.found.get(&(camera.to_owned(), written.time)) {
                written.line.insert("exposure".to_owned(), json!(exposure));
                with_exposure += 1;
            }
        }
        [with_intrinsics, with_exposure]
    }

    /// Gives the frames of topics with one time stamp the times of the recorder, with a warning.
    fn replace_constant_times(&mut self) {
        for (topic, selected) in &self.topics {
            if !selected.times.is_constant() {
                continue;
            }
            tracing::warn!(
                "{topic}: all {} with the same time stamp; the times of the recorder are used",
                counted(selected.seen, "message")
            );
            self.writer.use_log_times(topic);
        }
    }

    /// Writes the files about all frames, with `info` in `dataset.json`, and returns the result of the import.
    fn finish(
        mut self,
        args: &McapArgs,
        out: &Path,
        mut info: Value,
        first_file: &Path,
        mut problems: Vec<String>,
    ) -> Result<Outcome> {
        let place = first_file.display().to_string();
        self.check_topics(&place, &mut problems)?;
        for problem in &problems {
            tracing::warn!("{problem}");
        }
        self.writer.write_waiting();
        let [with_intrinsics, with_exposure] = self.add_camera_facts();
        self.replace_constant_times();
        let names: Vec<String> = self.topics.keys().cloned().collect();
        info["topics"] = json!(names);
        let scenes = self.writer.finish(&place, &info)?;
        let failed = self.writer.warn_of_failures();
        if let Some(first) = &self.first_backwards {
            tracing::warn!("{place}: time goes back {}, first {first}", counted(self.backwards, "time"));
        }
        let seen = self.topics.values().map(|selected| selected.seen).sum();
        let frames = self.writer.written.len();
        let mut output = summary(out, frames, scenes, &format!("{} s", args.written.stretch), seen, failed);
        let _ = writeln!(output, "topics: {}; {}", names.join(", "), args.sampling.description());
        let _ = writeln!(
            output,
            "intrinsics: {with_intrinsics} of {}; exposure: {with_exposure}",
            counted(frames, "frame")
        );
        output.push_str(&self.writer.conversion_note());
        if self.without_stamp > 0 {
            let _ = writeln!(
                output,
                "without a time of their own, with that of the recorder: {}",
                counted(self.without_stamp, "message")
            );
        }
        Ok(Outcome::wrote(out, Outcome::complete_if(failed == 0 && problems.is_empty()), output))
    }
}
