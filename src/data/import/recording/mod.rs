//! Recordings of robots in MCAP files: images with their times, cameras and exposures.
//!
//! ```text
//! file ─ McapReader ─ Channel + bytes ─ ImageMessage ─ RawImage, or the bytes of an image file
//!                                     └ CameraInfo, Exposure
//! times ─ Sampler: the chosen frames ─ Stretches: their scenes
//! ```
//!
//! The input is untrusted: memory is never allocated for a length in a file before its bytes are read.

mod channel;
mod exposure;
mod ffmpeg_colours;
mod fields;
mod image_message;
mod mcap;
mod overview;
mod sampling;
#[cfg(test)]
mod tests;
pub mod video;

pub use channel::{Channel, ChannelContent, ForeignData, camera_name, camera_of_info, intrinsics_names};
pub use exposure::{Encoding, Exposure};
pub use image_message::{CameraInfo, ImageMessage, MessageImage, is_without_image, stamp};
pub use mcap::{Event, MAX_MESSAGE_BYTES, McapReader, MessageHeader};
pub use overview::{FileImage, Overview, TopicOverview};
pub use sampling::{GreyBlocks, Place, Sampler, SamplingArgs, Stretches, TopicClock};

/// Time in nanoseconds, usually since 1970.
pub type Nanoseconds = i64;

/// Converts a time to seconds.
pub fn seconds(time: Nanoseconds) -> f64 {
    time as f64 / 1e9
}
