//! Topics of a recording: [`Overview`].

use std::collections::BTreeMap;
use std::io::{Read, Seek};

use super::channel::ChannelContent;
use super::exposure::Encoding;
use super::image_message::{ImageMessage, MessageImage, has_unread_kind};
use super::mcap::{Event, MAX_MESSAGE_BYTES, McapReader, MessageHeader};
use super::{Nanoseconds, seconds};
use darkqa_base::types::text::excerpt;

/// Maximum number of characters of an image format, because names of encodings are from the recording.
const MAX_FORMAT_LENGTH: usize = 100;

/// Start of the format of images that cannot be read; the reason follows.
const UNREAD: &str = "not read: ";

/// All topics of a recording.
#[derive(Debug, Default)]
pub struct Overview {
    pub topics: BTreeMap<String, TopicOverview>,
    /// Messages about damage.
    pub problems: Vec<String>,
    /// Log time of the first message.
    start: Option<Nanoseconds>,
}

/// One topic of a recording.
#[derive(Debug)]
pub struct TopicOverview {
    pub schema: String,
    /// Number of messages.
    pub count: usize,
    /// First and last log time of its messages.
    pub times: [Nanoseconds; 2],
    /// Size and encoding of the first image that can be read, or why the first message cannot be read; empty for topics
    /// without images.
    pub image_format: String,
    /// True if no further message needs a look: an image was read, or all images of the topic are of a kind that is not
    /// read.
    is_settled: bool,
    /// Number of messages before the first image that can be read.
    pub broken: usize,
    /// Why the first of these cannot be read.
    pub first_problem: String,
    /// Serialization of a topic with video.
    pub video: Option<Encoding>,
}

/// Image file of a message.
pub enum FileImage {
    /// One that can be read, with its width and height in pixels.
    Readable([u32; 2]),
    /// One that cannot be read, with the reason.
    Unread(String),
    /// A part of a video, with a description.
    Video(String),
}

impl TopicOverview {
    /// A topic without messages. `time` is the log time of its first one.
    fn new(schema: String, time: Nanoseconds) -> Self {
        Self {
            schema,
            count: 0,
            times: [time; 2],
            image_format: String::new(),
            is_settled: false,
            broken: 0,
            first_problem: String::new(),
            video: None,
        }
    }

    /// Looks for an image in a message. As the first messages may be broken, each one is tried until the topic is
    /// settled.
    fn look<R: Read + Seek>(
        &mut self,
        reader: &mut McapReader<R>,
        message: &MessageHeader,
        image: impl Fn(&str, &[u8]) -> FileImage,
    ) {
        let channel = &message.channel;
        let found = match &channel.content {
            ChannelContent::Image(encoding) => self.image_format(reader, message, *encoding, image),
            ChannelContent::Video(encoding) => {
                self.is_settled = true;
                self.video = Some(*encoding);
                Err("video, not images".to_owned())
            }
            ChannelContent::Unsupported(reason) => {
                self.is_settled = true;
                Err(reason.clone())
            }
            _ => {
                self.is_settled = true;
                return;
            }
        };
        match found {
            Ok(None) => {}
            Ok(Some(format)) => {
                self.is_settled = true;
                self.image_format = excerpt(format.trim(), MAX_FORMAT_LENGTH);
            }
            Err(problem) => {
                if self.broken == 0 {
                    self.first_problem = excerpt(problem.trim(), MAX_FORMAT_LENGTH);
                    let format = format!("{UNREAD}{problem}");
                    self.image_format = excerpt(format.trim(), MAX_FORMAT_LENGTH);
                }
                self.broken += 1;
            }
        }
    }

    /// Size and encoding of the image in a message; `None` if the recording is damaged there, which the next event
    /// reports.
    ///
    /// # Errors
    /// If it cannot be read.
    fn image_format<R: Read + Seek>(
        &mut self,
        reader: &mut McapReader<R>,
        message: &MessageHeader,
        encoding: Encoding,
        image: impl Fn(&str, &[u8]) -> FileImage,
    ) -> Result<Option<String>, String> {
        if message.length > MAX_MESSAGE_BYTES {
            return Err(format!("messages of {} MB", message.length >> 20));
        }
        let Some(body) = reader.body() else {
            return Ok(None);
        };
        self.is_settled = has_unread_kind(&message.channel.schema, encoding, body);
        match ImageMessage::parse(&message.channel.schema, encoding, body)?.image {
            MessageImage::Raw(image) => {
                let (width, height) = image.decode()?.size();
                Ok(Some(format!("{width}×{height} {}", image.encoding)))
            }
            MessageImage::File { format, bytes } => match image(&format, &bytes) {
                FileImage::Readable([width, height]) => Ok(Some(format!("{width}×{height} {format}"))),
                FileImage::Unread(problem) => Err(problem),
                FileImage::Video(problem) => {
                    self.is_settled = true;
                    self.video = Some(encoding);
                    Err(problem)
                }
            },
        }
    }

    /// True if a message has an image that can be read.
    pub fn has_images(&self) -> bool {
        !self.image_format.is_empty() && !self.image_format.starts_with(UNREAD)
    }

    /// Seconds from the first message to the last.
    pub fn duration(&self) -> f64 {
        seconds(self.times[1].saturating_sub(self.times[0]))
    }

    /// Messages per second; `None` for a single message.
    pub fn rate(&self) -> Option<f64> {
        let duration = self.duration();
        (duration > 0.0).then(|| (self.count - 1) as f64 / duration)
    }
}

impl Overview {
    /// Adds the messages of a file called `place`. `image` reads an image file, from the format that its message states
    /// and its bytes.
    pub fn add<R: Read + Seek>(
        &mut self,
        place: &str,
        mut reader: McapReader<R>,
        image: impl Fn(&str, &[u8]) -> FileImage,
    ) {
        while let Some(event) = reader.next_event() {
            match event {
                Event::Message(message) => {
                    if let Some(topic) = self.count(&message)
                        && !topic.is_settled
                    {
                        topic.look(&mut reader, &message, &image);
                    }
                }
                Event::ChunkRead => {}
                Event::ChunkDamaged { times, problem } => {
                    let [from, to] = times.map(|time| self.since_start(time));
                    self.problems.push(format!("{place}: a damaged chunk, {from:.3} s to {to:.3} s: {problem}"));
                }
                Event::Cut(problem) => {
                    self.problems.push(format!("{place}: the recording is cut off{}: {problem}", self.last_message()));
                }
            }
        }
    }

    /// Seconds from the first message.
    fn since_start(&self, time: Nanoseconds) -> f64 {
        seconds(time.saturating_sub(self.start.unwrap_or(time)))
    }

    /// Topic and time of the latest message, to continue an error message.
    fn last_message(&self) -> String {
        self.topics.iter().max_by_key(|(_, topic)| topic.times[1]).map_or(String::new(), |(name, topic)| {
            format!(" after {name} at {:.3} s", self.since_start(topic.times[1]))
        })
    }

    /// Counts a message, and returns its topic.
    fn count(&mut self, message: &MessageHeader) -> Option<&mut TopicOverview> {
        let channel = &message.channel;
        let time = message.log_time;
        self.start.get_or_insert(time);
        if !self.topics.contains_key(&channel.topic) {
            let topic = TopicOverview::new(channel.schema.clone(), time);
            self.topics.insert(channel.topic.clone(), topic);
        }
        let topic = self.topics.get_mut(&channel.topic)?;
        topic.count += 1;
        topic.times = [topic.times[0].min(time), topic.times[1].max(time)];
        Some(topic)
    }

    /// Names of the topics with images.
    pub fn image_topics(&self) -> Vec<&str> {
        self.topics.iter().filter(|(_, topic)| topic.has_images()).map(|(name, _)| &**name).collect()
    }
}
