//! Topics of a recording: [`Overview`].

use std::collections::BTreeMap;
use std::io::{Read, Seek};

use super::channel::ChannelContent;
use super::image_message::{ImageMessage, MessageImage};
use super::mcap::{Event, MAX_MESSAGE_BYTES, McapReader, Message};
use super::{Nanoseconds, seconds};
use crate::types::text::excerpt;

/// Maximum number of characters of an image format, because names of encodings are from the recording.
const MAX_FORMAT_LENGTH: usize = 100;

/// Start of the format of images that cannot be read; the reason follows.
const UNREAD: &str = "not read: ";

/// All topics of a recording.
#[derive(Debug, Default)]
pub(crate) struct Overview {
    pub(crate) topics: BTreeMap<String, TopicOverview>,
    /// Messages about damage.
    pub(crate) problems: Vec<String>,
    /// Log time of the first message.
    start: Option<Nanoseconds>,
}

/// One topic of a recording.
#[derive(Debug)]
pub(crate) struct TopicOverview {
    pub(crate) schema: String,
    /// Number of messages.
    pub(crate) count: usize,
    /// First and last log time of its messages.
    pub(crate) times: [Nanoseconds; 2],
    /// Size and encoding of the first image, or why it cannot be read; empty for topics without images.
    pub(crate) image_format: String,
}

impl TopicOverview {
    /// True if the first message has an image that can be read.
    pub(crate) fn has_images(&self) -> bool {
        !self.image_format.is_empty() && !self.image_format.starts_with(UNREAD)
    }

    /// Seconds from the first message to the last.
    pub(crate) fn duration(&self) -> f64 {
        seconds(self.times[1].saturating_sub(self.times[0]))
    }

    /// Messages per second; `None` for a single message.
    pub(crate) fn rate(&self) -> Option<f64> {
        let duration = self.duration();
        (duration > 0.0).then(|| (self.count - 1) as f64 / duration)
    }
}

impl Overview {
    /// Adds the messages of a file called `place`. `size` reads the width and height of an image file.
    pub(crate) fn add<R: Read + Seek>(
        &mut self,
        place: &str,
        mut reader: McapReader<R>,
        size: impl Fn(&[u8]) -> Result<(u32, u32), String>,
    ) {
        while let Some(event) = reader.next() {
            match event {
                Event::Message(message) => {
                    let is_first = self.count(&message);
                    if is_first
                        && let Some(format) = image_format(&mut reader, &message, &size)
                        && let Some(topic) = self.topics.get_mut(&message.channel.topic)
                    {
                        topic.image_format = format;
                    }
                }
                Event::ChunkRead => {}
                Event::ChunkDamaged { times, problem } => {
                    let [from, to] = times.map(|time| self.since_start(time));
                    self.problems.push(format!(
                        "{place}: a damaged chunk, {from:.3} s to {to:.3} s: {problem}"
                    ));
                }
                Event::Cut(problem) => {
                    self.problems.push(format!(
                        "{place}: the recording is cut off{}: {problem}",
                        self.last_message()
                    ));
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
        self.topics
            .iter()
            .max_by_key(|(_, topic)| topic.times[1])
            .map_or(String::new(), |(name, topic)| {
                format!(" after {name} at {:.3} s", self.since_start(topic.times[1]))
            })
    }

    /// Counts a message. Returns true if it is the first of its topic.
    fn count(&mut self, message: &Message) -> bool {
        let channel = &message.channel;
        let time = message.log_time;
        self.start.get_or_insert(time);
        if let Some(topic) = self.topics.get_mut(&channel.topic) {
            topic.count += 1;
            topic.times = [topic.times[0].min(time), topic.times[1].max(time)];
            return false;
        }
        let topic = TopicOverview {
            schema: channel.schema.clone(),
            count: 1,
            times: [time; 2],
            image_format: String::new(),
        };
        self.topics.insert(channel.topic.clone(), topic);
        true
    }

    /// Names of the topics with images.
    pub(crate) fn image_topics(&self) -> Vec<&str> {
        self.topics
            .iter()
            .filter(|(_, topic)| topic.has_images())
            .map(|(name, _)| &**name)
            .collect()
    }
}

/// Size and encoding of the image in a message, or why it cannot be read; `None` for other messages.
fn image_format<R: Read + Seek>(
    reader: &mut McapReader<R>,
    message: &Message,
    size: impl Fn(&[u8]) -> Result<(u32, u32), String>,
) -> Option<String> {
    let channel = &message.channel;
    let encoding = match &channel.content {
        ChannelContent::Image(encoding) => *encoding,
        ChannelContent::Unsupported(reason) => return Some(format!("{UNREAD}{reason}")),
        _ => return None,
    };
    if message.length > MAX_MESSAGE_BYTES {
        return Some(format!("{UNREAD}messages of {} MB", message.length >> 20));
    }
    let format = ImageMessage::parse(&channel.schema, encoding, reader.body()?)
        .and_then(|message| match message.image {
            MessageImage::Raw(image) => {
                let (width, height) = image.decode()?.size();
                Ok(format!("{width}×{height} {}", image.encoding))
            }
            MessageImage::File { format, bytes } => {
                let (width, height) = size(&bytes)?;
                Ok(format!("{width}×{height} {format}"))
            }
        })
        .unwrap_or_else(|problem| format!("{UNREAD}{problem}"));
    Some(excerpt(format.trim(), MAX_FORMAT_LENGTH))
}
