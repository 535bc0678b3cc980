//! Writes frames of a recording or video in parallel: [`FrameWriter`].

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use rayon::ThreadPool;
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::counted;
use darkqa_base::types::text::excerpt;
use darkqa_base::types::{DepthNote, FrameId, Labels, Pixels, Rgb, Rgb16Image};
use darkqa_data::frame_folder::{self, FrameOutput};
use darkqa_data::import::recording::{
    Channel, ChannelContent, ForeignData, GreyBlocks, ImageMessage, MessageImage, Nanoseconds, Place, seconds,
};
use darkqa_engine::images::frames::InputTally;
use darkqa_pictures::ImageFile;
use darkqa_pictures::decode_rule::DecodeRule;
use darkqa_pictures::raw_image::{RawPixels, is_yuv};

/// Maximum size of the frames waiting to be written, in bytes (chosen). Writing needs two to three times as much
/// memory.
const MAX_WAITING_BYTES: usize = 32 << 20;

/// Number of waiting frames per thread (chosen).
const WAITING_PER_THREAD: usize = 4;

/// Maximum length of a problem in characters, because it may quote texts of the recording.
const MAX_PROBLEM: usize = 300;

/// File extensions of images that are copied unchanged from messages.
pub(super) const COPIED: [&str; 3] = ["jpg", "png", "webp"];

/// A frame chosen to be written.
pub(super) struct ChosenFrame {
    pub(super) topic: String,
    /// Name of the frame in its scene.
    pub(super) name: String,
    pub(super) place: Place,
    /// Time stamp.
    pub(super) time: Nanoseconds,
    pub(super) log_time: Nanoseconds,
    /// Further facts for its line in `frames.jsonl`.
    pub(super) facts: Map<String, Value>,
    pub(super) source: FrameSource,
}

/// The image of a chosen frame.
pub(super) enum FrameSource {
    /// An undecoded message of a channel.
    Message {
        channel: Arc<Channel>,
        bytes: Vec<u8>,
    },
    /// An image file.
    File(Vec<u8>),
    Image(Rgb),
}

impl ChosenFrame {
    fn bytes(&self) -> usize {
        match &self.source {
            FrameSource::Message { bytes, .. } | FrameSource::File(bytes) => bytes.len(),
            FrameSource::Image(image) => image.samples().len(),
        }
    }

    /// Topic and time, for messages.
    fn words(&self) -> String {
        let since = seconds(self.place.since);
        format!("{} at {since:.3} s", self.topic)
    }
}

/// A frame that was written.
pub(super) struct WrittenFrame {
    pub(super) topic: String,
    pub(super) time: Nanoseconds,
    pub(super) log_time: Nanoseconds,
    /// Width and height in pixels, after the turn that the file states.
    pub(super) size: (usize, usize),
    /// True if the file states a turn, so that the camera's intrinsics do not apply to the image.
    pub(super) is_turned: bool,
    /// Largest sample, for 16-bit images.
    peak_16: Option<u16>,
    /// True for images in YUV.
    is_yuv: bool,
    /// True if the message's format states that a colour image was compressed as grey.
    has_lost_colour: bool,
    /// Line in `frames.jsonl`.
    pub(super) line: Map<String, Value>,
}

/// The image file to write.
struct EncodedFrame {
    bytes: Vec<u8>,
    ending: &'static str,
    size: (usize, usize),
    is_turned: bool,
    peak_16: Option<u16>,
    is_yuv: bool,
    has_lost_colour: bool,
    frame_id: String,
}

/// Writes frames, and collects facts about them.
pub(super) struct FrameWriter<'a> {
    out: &'a Path,
    /// Name of the drive, which is the prefix of scene names.
    drive: String,
    /// Code of white in 16-bit images.
    white: u16,
    pool: ThreadPool,
    tally: InputTally,
    waiting: Vec<ChosenFrame>,
    /// Number of waiting frames known to be intact; these come first.
    intact: usize,
    pub(super) written: Vec<WrittenFrame>,
    /// Number of frames that could not be written, by topic.
    failed: BTreeMap<String, usize>,
}

impl<'a> FrameWriter<'a> {
    pub(super) fn new(out: &'a Path, drive: String, white: u16, pool: ThreadPool) -> Self {
        Self {
            out,
            drive,
            white,
            pool,
            tally: InputTally::default(),
            waiting: Vec::new(),
            intact: 0,
            written: Vec::new(),
            failed: BTreeMap::new(),
        }
    }

    /// Adds a frame, and first writes the waiting ones if there are many. A frame in a chunk is known to be intact only
    /// after the whole chunk was read, but is written earlier if the chunk exceeds the memory for waiting frames.
    pub(super) fn push(&mut self, frame: ChosenFrame, is_intact: bool) {
        let bytes: usize = self.waiting.iter().map(ChosenFrame::bytes).sum();
        let max_waiting = WAITING_PER_THREAD * self.pool.current_num_threads();
        let is_full = self.waiting.len() >= max_waiting && self.intact == self.waiting.len();
        if bytes + frame.bytes() > MAX_WAITING_BYTES || is_full {
            self.write_waiting();
        }
        self.waiting.push(frame);
        if is_intact {
            self.intact = self.waiting.len();
        }
    }

    /// Marks all waiting frames as intact.
    pub(super) fn mark_intact(&mut self) {
        self.intact = self.waiting.len();
    }

    /// Drops the waiting frames that are not known to be intact, and returns their number.
    pub(super) fn drop_doubtful(&mut self) -> usize {
        let doubtful = self.waiting.len() - self.intact;
        self.waiting.truncate(self.intact);
        doubtful
    }

    /// Writes all waiting frames. Failures are counted, and the first of each topic is logged.
    pub(super) fn write_waiting(&mut self) {
        let waiting = std::mem::take(&mut self.waiting);
        self.intact = 0;
        let results: Vec<Result<WrittenFrame, String>> =
            self.pool.install(|| waiting.par_iter().map(|frame| self.write(frame)).collect());
        for (frame, result) in waiting.iter().zip(results) {
            match result {
                Ok(written) => self.written.push(written),
                Err(problem) => self.fail(&frame.topic, &format!("{}: {problem}", frame.words())),
            }
        }
    }

    /// Counts a failed frame, and logs the first one of a topic.
    pub(super) fn fail(&mut self, topic: &str, problem: &str) {
        let count = self.failed.entry(topic.to_owned()).or_default();
        *count += 1;
        if *count == 1 {
            tracing::error!("{}: {}", self.drive, excerpt(problem.trim(), MAX_PROBLEM));
        }
    }

    /// Warns of topics with several failed frames, and returns the number of all failed frames.
    pub(super) fn warn_of_failures(&self) -> usize {
        for (topic, count) in self.failed.iter().filter(|(_, count)| **count > 1) {
            tracing::warn!("{}: {topic}: {count} frames could not be read", self.drive);
        }
        self.failed.values().sum()
    }

    fn write(&self, frame: &ChosenFrame) -> Result<WrittenFrame, String> {
        let encoded = match &frame.source {
            FrameSource::Message { channel, bytes } => self.encode_message(frame, channel, bytes)?,
            FrameSource::File(bytes) => self.encode_file(frame, bytes.clone(), "unknown")?,
            FrameSource::Image(image) => EncodedFrame {
                bytes: darkqa_pictures::png(image).map_err(|e| e.to_string())?,
                ending: "png",
                size: (image.width(), image.height()),
                is_turned: false,
                peak_16: None,
                is_yuv: false,
                has_lost_colour: false,
                frame_id: String::new(),
            },
        };
        let scene = format!("{}-{:04}", self.drive, frame.place.stretch);
        let output = FrameOutput { out: self.out, scene: &scene, frame: &frame.name };
        let (width, height) = encoded.size;
        let mut line = output.line(width, height);
        let path = output.write("rgb", encoded.ending, &encoded.bytes).map_err(|e| e.to_string())?;
        line.insert("rgb".to_owned(), json!(path));
        line.insert("t".to_owned(), json!(seconds(frame.time)));
        line.insert("topic".to_owned(), json!(frame.topic));
        if !encoded.frame_id.is_empty() {
            line.insert("frame_id".to_owned(), json!(encoded.frame_id));
        }
        line.extend(frame.facts.clone());
        Ok(WrittenFrame {
            topic: frame.topic.clone(),
            time: frame.time,
            log_time: frame.log_time,
            size: encoded.size,
            is_turned: encoded.is_turned,
            peak_16: encoded.peak_16,
            is_yuv: encoded.is_yuv,
            has_lost_colour: encoded.has_lost_colour,
            line,
        })
    }

    fn encode_message(&self, frame: &ChosenFrame, channel: &Channel, bytes: &[u8]) -> Result<EncodedFrame, String> {
        let message = parse(channel, bytes)?;
        match message.image {
            MessageImage::Raw(image) => {
                let pixels = image.decode()?;
                let peak_16 = pixels.peak_16();
                let pixels = pixels.with_white(self.white);
                Ok(EncodedFrame {
                    bytes: pixels.png().map_err(|e| e.to_string())?,
                    ending: "png",
                    size: pixels.size(),
                    is_turned: false,
                    peak_16,
                    is_yuv: image.is_yuv(),
                    has_lost_colour: false,
                    frame_id: message.frame_id,
                })
            }
            MessageImage::File { format, bytes } => {
                Ok(EncodedFrame { frame_id: message.frame_id, ..self.encode_file(frame, bytes.into_owned(), &format)? })
            }
        }
    }

    /// Checks an image file that is copied unchanged. `format` is its stated format.
    fn encode_file(&self, frame: &ChosenFrame, bytes: Vec<u8>, format: &str) -> Result<EncodedFrame, String> {
        let file = ImageFile::new(bytes, frame.words(), DecodeRule::default());
        let ending = file.extension();
        if !COPIED.contains(&ending) {
            let kind = ForeignData::detect(format, file.bytes(), ending);
            let remedy = match kind {
                ForeignData::Video(_) => VIDEO_REMEDY,
                _ => "",
            };
            return Err(format!("{}{remedy}", kind.words(format)));
        }
        let note = file.note();
        let is_turned = note.orientation.is_some();
        let has_white = match note.depth {
            None => false,
            Some(DepthNote::Rgb16Image) => note.colour.is_some(),
            Some(DepthNote::Light) => true,
        };
        if self.white != u16::MAX && has_white {
            let problem =
                "the file states what its codes mean, so --white does not apply; leave it out, or take the topic alone";
            return Err(problem.to_owned());
        }
        if note.depth == Some(DepthNote::Rgb16Image) {
            let image = deep_image(&file)?;
            self.tally.add(&FrameId(frame.words()), &note);
            let size = (image.width(), image.height());
            let pixels = RawPixels::Rgb16Image(image);
            let peak_16 = pixels.peak_16();
            let bytes = if self.white == u16::MAX {
                file.bytes().to_vec()
            } else {
                pixels.with_white(self.white).png().map_err(|e| e.to_string())?
            };
            return Ok(EncodedFrame {
                bytes,
                ending: "png",
                size,
                is_turned,
                peak_16,
                is_yuv: false,
                has_lost_colour: false,
                frame_id: String::new(),
            });
        }
        let (width, height) = file.check().map_err(problem)?;
        self.tally.add(&FrameId(frame.words()), &note);
        Ok(EncodedFrame {
            size: (width as usize, height as usize),
            is_turned,
            peak_16: None,
            is_yuv: false,
            has_lost_colour: has_lost_colour(format),
            ending,
            bytes: file.bytes().to_vec(),
            frame_id: String::new(),
        })
    }

    /// Writes the waiting frames and the files about all frames, with `info` as `dataset.json`. Returns the number of
    /// scenes.
    ///
    /// # Errors
    /// If there is no frame, or the files cannot be written.
    pub(super) fn finish(&mut self, place: &str, info: &Value) -> Result<usize> {
        self.write_waiting();
        if self.written.is_empty() {
            return Err(Error::data(place, "no frame of it could be taken"));
        }
        std::mem::take(&mut self.tally).warn();
        self.warn_of_white();
        self.warn_of_lost_colour();
        self.written
            .sort_by_cached_key(|written| ["scene", "frame"].map(|key| written.line[key].as_str().map(str::to_owned)));
        let lines = self.written.iter().map(|written| &written.line);
        frame_folder::write_folder_files(self.out, &Labels::default(), info, lines)?;
        let mut scenes: Vec<&Value> = self.written.iter().map(|written| &written.line["scene"]).collect();
        scenes.dedup();
        Ok(scenes.len())
    }

    /// Gives the frames of a topic the times of the recorder.
    pub(super) fn use_log_times(&mut self, topic: &str) {
        for written in self.written.iter_mut().filter(|written| written.topic == topic) {
            let time = json!(seconds(written.log_time));
            written.line.insert("t".to_owned(), time);
        }
    }

    /// The line about images in YUV; empty without any.
    pub(super) fn conversion_note(&self) -> String {
        match self.written.iter().filter(|written| written.is_yuv).count() {
            0 => String::new(),
            count => format!(
                "YUV, converted to RGB by BT.601 in limited range, as cv_bridge does (the messages state no matrix): {}\n",
                counted(count, "frame")
            ),
        }
    }

    /// Warns of topics with colour images that were compressed as grey.
    fn warn_of_lost_colour(&self) {
        let mut topics: BTreeMap<&str, usize> = BTreeMap::new();
        for written in self.written.iter().filter(|written| written.has_lost_colour) {
            *topics.entry(&written.topic).or_default() += 1;
        }
        for (topic, count) in topics {
            let camera = topic.rsplit_once('/').map_or(topic, |(camera, _)| camera);
            tracing::warn!(
                "{}: {topic}: {} grey, although the camera has colour: the compression dropped it; record {camera} for questions about colours",
                self.drive,
                counted(count, "image")
            );
        }
    }

    /// Warns if 16-bit images seem to use fewer bits, which makes them too dark.
    fn warn_of_white(&self) {
        let peak = self.written.iter().filter_map(|written| written.peak_16).max();
        if let Some(peak) = peak.filter(|peak| *peak > 0 && *peak < 1 << 14 && self.white == u16::MAX) {
            let white = (u32::from(peak) + 1).next_power_of_two() - 1;
            tracing::warn!(
                "the greatest code of the images of 16 bits is {peak}: they are dark, unless their white is less than 65535; for a sensor of {} bits set --white {white}",
                (white + 1).ilog2()
            );
        }
    }
}

/// The codes of an image file of 16 bits, converted to sRGB.
fn deep_image(file: &ImageFile) -> Result<Rgb16Image, String> {
    match file.pixels().map_err(problem)? {
        Pixels::Rgb16Image(image) => Ok(Arc::unwrap_or_clone(image)),
        Pixels::Codes8(_) | Pixels::Light(_) => Err("codes of 16 bits expected".to_owned()),
    }
}

/// The problem of an error without its place, which the caller adds.
fn problem(error: Error) -> String {
    match error {
        Error::Data { problem, .. } => problem,
        other => other.to_string(),
    }
}

/// Remedy for a topic with video, to continue its description.
pub(super) const VIDEO_REMEDY: &str =
    "; `darkqa-eval import mcap` without --out prints the commands that make a video file of it";

/// True if a format states that a colour image was compressed as grey: `compressed_image_transport` writes
/// `yuv422_yuy2; jpeg compressed mono8` for an image in YUV.
fn has_lost_colour(format: &str) -> bool {
    let (source, target) = format.split_once(';').unwrap_or((format, ""));
    let source = source.trim();
    let is_colour = is_yuv(source)
        || ["rgb", "bgr", "8UC3", "8UC4", "16UC3", "16UC4"].iter().any(|start| source.starts_with(start));
    is_colour && target.contains("mono")
}

/// The thumbnail of a message's image.
///
/// # Errors
/// If the message has no image that can be decoded.
pub(super) fn thumbnail(channel: &Channel, bytes: &[u8], white: u16) -> Result<GreyBlocks, String> {
    match parse(channel, bytes)?.image {
        MessageImage::Raw(image) => thumbnail_of_pixels(image.decode()?.with_white(white)),
        MessageImage::File { bytes, .. } => {
            let file = ImageFile::new(bytes.into_owned(), String::new(), DecodeRule::default());
            if file.note().depth == Some(DepthNote::Rgb16Image) {
                let pixels = RawPixels::Rgb16Image(deep_image(&file)?);
                return thumbnail_of_pixels(pixels.with_white(white));
            }
            file.decode().map(|image| GreyBlocks::new(&image)).map_err(|e| e.to_string())
        }
    }
}

fn thumbnail_of_pixels(pixels: RawPixels) -> Result<GreyBlocks, String> {
    match pixels {
        RawPixels::Codes8(image) => Ok(GreyBlocks::new(&image)),
        RawPixels::Rgb16Image(image) => {
            let high = image.samples().iter().map(|code| (code >> 8) as u8).collect();
            let image = Rgb::new(image.height(), image.width(), high);
            image.map(|image| GreyBlocks::new(&image)).map_err(|e| e.to_string())
        }
    }
}

fn parse<'a>(channel: &Channel, bytes: &'a [u8]) -> Result<ImageMessage<'a>, String> {
    match channel.content {
        ChannelContent::Image(encoding) => ImageMessage::parse(&channel.schema, encoding, bytes),
        _ => Err(format!("a message of {}, not an image", channel.schema)),
    }
}

/// The line about the written frames and scenes. `extent` is that of a scene, such as `30 s`, `seen` the number of
/// frames read.
pub(super) fn summary(out: &Path, frames: usize, scenes: usize, extent: &str, seen: usize, failed: usize) -> String {
    let failed = if failed == 0 { String::new() } else { format!(", {failed} failed") };
    let chosen = if seen == frames { String::new() } else { format!(", chosen from {seen}") };
    format!(
        "{}: {} of {} ({extent} each){chosen}{failed}\n",
        out.display(),
        counted(frames, "frame"),
        counted(scenes, "scene"),
    )
}
