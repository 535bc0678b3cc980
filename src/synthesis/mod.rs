//! Less light: a clean frame as a camera would have taken it in the dark. [`degrade`] is the door.
//!
//! ```text
//! Exposure   sRGB ─ gamma ─ × 2^−ΔEV ─ gamma⁻¹ ─ 8 bit                            a table of 256 codes
//! SensorSettings     sRGB ─ unprocess ─ RAW ─ shot, read, row, quantisation ─ balance ─┐
//!                                                     a Negative, drawn once ◄─┘
//!            Negative ─ demosaic ─ camera → sRGB ─ × 2^−ΔEV ─ gamma⁻¹ ─ 8 bit     for each level
//! ```
//!
//! The sensor branch has no forward tone curve, as the paper lists none. Its clean chain is therefore brighter in the
//! shadows than the exposure branch (grey 16 becomes 39 before the drop, 192 becomes 172), and the two branches differ
//! in contrast as well as in noise.
//!
//! The result is a function of the arguments and of [`VERSION`] alone. Threads, order and machine do not enter: random
//! numbers are addressed by where they are used (see [`random`]), powers and logarithms are `libm`'s and stand in tables
//! (see [`piecewise`]), and everything else is IEEE sums, products, quotients and square roots in a fixed order. The
//! camera's state is computed in double precision, samples in single, many at once (see [`lanes`]).

#![expect(
    clippy::inline_always,
    reason = "only inlined code is compiled for a kernel's instruction set, see lanes"
)]

pub mod bayer;
pub mod camera;
pub mod colour;
pub mod curve;
pub mod exposure;
mod exposures;
mod isp;
pub mod lanes;
pub mod negative;
pub mod noise;
pub mod piecewise;
pub mod poisson;
pub mod quantile;
pub mod random;
mod reading;
mod settings;
pub mod unprocess;

pub use camera::{Calibration, CameraModel, CameraState, Sampling};
pub use exposure::{expose, expose_by};
pub use exposures::{Exposures, is_random, version};
pub use negative::{Negative, ladder};
pub use random::NoiseKey;
pub use reading::{Amplify, Coupling, Draws, LightReading, Readings, Synthesis, Tone};
pub use settings::{LightArgs, LightSettings, SensorArgs, SensorSettings};

use crate::types::{Degradation, Rgb};

/// The version of the sensor branch: raised whenever a pixel changes, so that no result of an older one is taken for its
/// own. The exposure branch has [its own](exposure::VERSION).
pub const VERSION: u32 = 2;

/// The frame under a degradation.
///
/// `synthesis` is the content of the degradation's light reading. For several degradations of one frame, [`Exposures`] gives
/// the same images for less work.
#[must_use]
pub fn degrade(
    clean: &Rgb,
    how: Option<&Degradation>,
    key: &NoiseKey,
    synthesis: &Synthesis,
) -> Rgb {
    Exposures::default().degrade(clean, how, key, synthesis)
}

#[cfg(test)]
mod statistics;
#[cfg(test)]
mod tests;
