//! Images as files: read from any of six formats, scaled, and encoded for a request.
//!
//! ```text
//! bytes ─ ImageFile ─ Pixels (8 or 16 bits, or light)        colours converted to sRGB, turned as EXIF states
//! Rgb ─ Scaling ─ PayloadFormat ─ Payload ─ data URL         what a model receives
//! ```
//!
//! An image without a file format, as a camera driver sends it, is a [`raw_image`]. Maps of numbers, which are not to be shown, are read as they are stored: [`raw_png`], [`npy`] and [`hdf5`].

#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

mod bilinear;
mod colour;
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
pub mod reading_rule;
mod scaling;

pub use bilinear::bilinear;
pub use encoding::{exr, grey_png, png};
pub use fitting::{fit, fitted_size};
pub use image_file::ImageFile;
pub use payload::{Payload, pixels_of_url};
pub use payload_format::{ImageArgs, PayloadFormat, Quality};
pub use reading_rule::ReadingRule;
pub use scaling::Scaling;
