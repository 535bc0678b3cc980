//! Degraded versions of a clean frame, as a camera would take it in less light. [`degrade`] is the entry point.
//!
//! ```text
//! Exposure   sRGB ─ gamma ─ × 2^−ΔEV ─ gamma⁻¹ ─ 8 bit                            a table of 256 codes
//! Sensor     sRGB ─ unprocess ─ RAW ─ shot, read, row, quantisation ─ balance ─┐
//!                                                     a Negative, drawn once ◄─┘
//!            Negative ─ demosaic ─ camera → sRGB ─ × 2^−ΔEV ─ gamma⁻¹ ─ 8 bit     for each level
//! ```
//!
//! The sensor branch has no forward tone curve, because the paper lists none. Before the drop, its shadows are therefore
//! brighter than those of the exposure branch (grey 16 becomes 39, 192 becomes 172). So the two branches differ in
//! contrast as well as in noise.
//!
//! The result depends only on the arguments and on [`VERSION`], not on threads, order or machine. Random numbers are
//! addressed by where they are used (see [`random`]). Powers and logarithms come from `libm` and are tabulated (see
//! [`piecewise`]). All else is IEEE sums, products, quotients and square roots in a fixed order. The camera's state is
//! computed in double precision, samples in single precision, many at once (see [`lanes`]).

#![expect(
    clippy::inline_always,
    reason = "only inlined code is compiled for a kernel's instruction set, see lanes"
)]

pub(crate) mod bayer;
pub(crate) mod camera;
pub(crate) mod colour;
pub(crate) mod curve;
pub(crate) mod exposure;
mod exposures;
mod isp;
pub(crate) mod lanes;
mod levels;
pub(crate) mod negative;
pub(crate) mod noise;
pub(crate) mod piecewise;
pub(crate) mod poisson;
pub(crate) mod quantile;
pub(crate) mod random;
mod reading;
mod settings;
pub(crate) mod unprocess;

pub use camera::{Calibration, CameraModel, CameraState, Sampling};
pub(crate) use exposure::{expose, expose_by};
pub use exposures::Exposures;
pub(crate) use exposures::{is_random, version};
pub(crate) use negative::{Negative, ladder};
pub use random::NoiseKey;
pub(crate) use random::{Component, Site};
pub(crate) use reading::Readings;
pub use reading::{Amplify, Coupling, Draws, LightReading, Synthesis, Tone};
pub(crate) use settings::{LightArgs, LightSettings, SensorArgs, SensorSettings};

use crate::types::{Degradation, Rgb};

/// Version of the sensor branch, raised whenever a pixel changes, so that results of an older version are not reused.
/// The exposure branch has [another](exposure::VERSION).
pub const VERSION: u32 = 2;

/// The frame after a degradation; without one, the frame itself.
///
/// `synthesis` is the content of the degradation's light reading. For several degradations of one frame, [`Exposures`] gives
/// the same images with less work.
#[must_use]
pub fn degrade(
    clean: &Rgb,
    degradation: Option<&Degradation>,
    key: &NoiseKey,
    synthesis: &Synthesis,
) -> Rgb {
    Exposures::default().degrade(clean, degradation, key, synthesis)
}

#[cfg(test)]
mod statistics;
#[cfg(test)]
mod tests;
