//! RAW images: unprocessing of frames, sensor noise, and development to sRGB.

mod bayer;
mod clean_raw;
pub(super) mod colour;
mod isp;
pub mod negative;
pub mod noise;
mod unprocess;

pub use bayer::Bayer;
#[cfg(test)]
pub(super) use bayer::Plane;
pub use clean_raw::CleanRaw;
#[cfg(test)]
pub(super) use isp::Developer;
pub use unprocess::{unprocess, unprocess_with_headroom};
