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

mod colour;
pub mod decode_rule;
pub mod hdf5;
pub mod image_file;
mod noise_png;
pub mod npy;
mod payload;
pub mod raw_image;
pub mod raw_png;
mod scaling;

pub use colour::{FrameConversion, StatedColours};
pub use decode_rule::DecodeRule;
pub use image_file::ImageFile;
pub use payload::{ImageArgs, Payload, PayloadFormat, Quality, decode_data_url, exr, grey_png, png};
pub use scaling::{Scaling, bilinear, fit, fitted_size};
