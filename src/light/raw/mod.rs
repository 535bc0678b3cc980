//! RAW images: unprocessing of frames, sensor noise, and development to sRGB.

mod bayer;
pub mod negative;
pub mod noise;
mod unprocess;

#[cfg(test)]
pub(super) use bayer::Plane;

#[cfg(test)]
pub(super) use negative::Developer;

pub use bayer::Bayer;
pub use negative::CleanRaw;
pub use unprocess::{unprocess, unprocess_with_headroom};
