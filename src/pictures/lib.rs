//! Image files: six formats are decoded, scaled, and encoded for a request.
//!
//! ```text
//! bytes ─ ImageFile ─ Pixels (8 or 16 bits, or light)        converted to sRGB, EXIF orientation applied
//! Rgb ─ Scaling ─ PayloadFormat ─ Payload ─ data URL         sent to a model
//! ```
//!
//! [`raw_image`] decodes images of camera drivers, which have no file format. [`raw_png`], [`npy`] and [`hdf5`] read
//! maps of numbers, such as depth or labels.

#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

mod bilinear;
mod colour;
pub mod decode_rule;
mod encoding;
mod fitting;
pub mod hdf5;
pub mod image_file;
pub mod npy;
mod payload;
mod payload_format;
mod plain_png;
pub mod raw_image;
pub mod raw_png;
mod scaling;
mod stated_colours;

pub use bilinear::bilinear;
pub use decode_rule::DecodeRule;
pub use encoding::{exr, grey_png, png};
pub use fitting::{fit, fitted_size};
pub use image_file::ImageFile;
pub use payload::{Payload, decode_data_url};
pub use payload_format::{ImageArgs, PayloadFormat, Quality};
pub use scaling::Scaling;
pub use stated_colours::{FrameConversion, StatedColours};
