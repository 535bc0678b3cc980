//! Recordings of robots in MCAP files: images with their times, cameras and exposures.
//!
//! ```text
//! file ─ McapReader ─ Channel + bytes ─ ImageMessage ─ RawImage, or the bytes of an image file
//!                                     └ CameraInfo, Exposure
//! times ─ Sampler: the chosen frames ─ Stretches: their scenes
//! ```
//!
//! The input is untrusted: memory is never allocated for a length in a file before its bytes are read.

mod camera_info;
mod channel;
mod chunk;
mod encoding;
mod exposure;
mod ffmpeg_colours;
mod ffmpeg_log;
mod fields;
mod foreign_data;
mod image_message;
mod mcap;
mod overview;
mod protobuf;
mod sampling;
mod stretches;
#[cfg(test)]
mod tests;
mod thumbnail;
pub(crate) mod video;

pub(crate) use camera_info::CameraInfo;
pub(crate) use channel::{Channel, ChannelContent, camera_name, camera_of_info, intrinsics_names};
pub(crate) use encoding::Encoding;
pub(crate) use exposure::Exposure;
pub(crate) use foreign_data::ForeignData;
pub(crate) use image_message::{ImageMessage, MessageImage, is_without_image, stamp};
pub(crate) use mcap::{Event, MAX_MESSAGE_BYTES, McapReader, Message};
pub(crate) use overview::{FileImage, Overview, TopicOverview};
pub(crate) use sampling::{Sampler, SamplingArgs};
pub(crate) use stretches::{Place, Stretches, TopicClock};
pub(crate) use thumbnail::Thumbnail;

/// Time in nanoseconds, usually since 1970.
pub(crate) type Nanoseconds = i64;

/// Converts a time to seconds.
pub(crate) fn seconds(time: Nanoseconds) -> f64 {
    time as f64 / 1e9
}
