//! Synthetic low light: degrades a clean frame as a camera would in less light. [`degrade`] is the entry point.
//!
//! ```
//! # use darkqa_base::types::{FrameId, Rgb};
//! # use darkqa_light::{NoiseKey, Synthesis, degrade};
//! # let clean = Rgb::new(1, 2, vec![200; 6])?;
//! let key = NoiseKey::new(0, &FrameId("kitchen/12.png".to_owned()));
//! let how = "L3-noise@physical".parse()?;
//! let dark = degrade(&clean, Some(&how), &key, &Synthesis::default())?;
//! # assert_eq!((dark.height(), dark.width()), (1, 2));
//! # Ok::<(), darkqa_base::Error>(())
//! ```
//!
//! [`raw::negative::ladder`] makes several levels with less work. [`CaptureState`] is a serializable state that makes
//! an image again, its noise-free form, or its linear light.
//!
//! ```text
//! Exposure   sRGB ─ gamma ─ × 2^−ΔEV ─ gamma⁻¹ ─ 8 bit                            a table of 256 codes
//! Sensor     sRGB ─ unprocess ─ RAW ─ shot, read, row, quantisation ─ balance ─┐
//!                                                     a Negative, drawn once ◄─┘
//!            Negative ─ demosaic ─ camera → sRGB ─ × 2^−ΔEV ─ gamma⁻¹ ─ 8 bit     for each level
//! Motion     sRGB ─ gamma ─ blur ─ gamma⁻¹ ─ 8 bit                                the mean over the path of an exposure
//! Auto       sRGB ─ gamma ─ blur ─ unprocess ─ … the sensor branch, physical, at the camera's own gain
//! ```
//!
//! The sensor branch has no forward tone curve, because the paper lists none. Before the drop, its shadows are
//! therefore brighter than those of the exposure branch (grey 16 becomes 39, 192 becomes 172). So the two branches
//! differ in both contrast and noise.
//!
//! The result depends only on the arguments and on [`VERSION`], not on threads, order or machine. A random number
//! depends only on its address, such as seed, frame and sensor site (see [`draws`]). Powers and logarithms are computed
//! by `libm` and tabulated; all other operations are IEEE sums, products, quotients and square roots in a fixed order.
//! The state of the camera is computed in double precision, samples in single precision with vector instructions (see
//! [`Isa`](darkqa_base::types::images::Isa)).

#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]
#![expect(clippy::inline_always, reason = "only inlined code is compiled for a kernel's instruction set, see isa")]

mod applied;
mod auto;
pub mod camera;
mod capture_state;
pub mod clean;
#[cfg(test)]
mod departures;
pub mod draws;
pub mod exposure;
#[cfg(feature = "flags")]
mod levels;
pub mod movement;
mod noise_profile;
pub mod raw;
#[cfg(feature = "flags")]
mod settings;
#[cfg(test)]
mod signal_to_noise;
#[cfg(test)]
mod statistics;
#[cfg(test)]
mod tests;

use darkqa_base::error::Result;
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{Degradation, Rgb};

#[cfg(feature = "flags")]
pub use settings::{CameraArgs, KindSettings, LightArgs, LightSettings, SensorArgs, SensorSettings};

pub use applied::AppliedDegradation;
pub use auto::{AutoExposure, AutoSettings, AutoShot};
pub use camera::{Calibration, CameraModel, CameraState, Sampling};
pub use capture_state::{CaptureState, NoiseTerms, SensorState};
pub use clean::Clean;
pub use draws::{Component, NoiseKey, Site};
pub use exposure::{Exposures, PairEv, expose, expose_by, mean_luminance};
pub use movement::{FrameView, Motion, MotionAngle, Streak, Tap};
pub use noise_profile::{Amplify, Coupling, Draws, NoiseProfile, NoiseProfiles, Synthesis, Tone};
pub use raw::CleanRaw;
pub use raw::negative::{Negative, develop_with_state};

/// Version of the sensor branch, raised whenever a pixel changes, so that results of an older version are not reused.
/// The exposure branch has its own [version](exposure::VERSION).
pub const VERSION: u32 = 2;

/// Version of a kind of degradation, raised whenever one of its pixels changes, so that results of an older version are
/// not reused.
#[must_use]
pub fn version(kind: Kind) -> u32 {
    match kind {
        Kind::Exposure => exposure::VERSION,
        Kind::Sensor => VERSION,
        // Both blur and noise change the pixels.
        Kind::Auto => 100 * VERSION + movement::blur::VERSION,
        Kind::Motion => movement::blur::VERSION,
    }
}

/// Applies a degradation to a frame; without one, returns the frame.
///
/// `synthesis` is the noise profile of the degradation. Automatic exposure and motion have their default settings, and
/// the focal length is unknown. For other settings, and for several degradations of one frame, use
/// [`AppliedDegradation`] and [`Exposures`].
///
/// # Errors
/// If the sensor does not have the gain that automatic exposure needs, or the image would move too far during the
/// exposure.
pub fn degrade(clean: &Rgb, degradation: Option<&Degradation>, key: &NoiseKey, synthesis: &Synthesis) -> Result<Rgb> {
    let Some(how) = degradation else {
        return Ok(clean.clone());
    };
    let view = FrameView { width: clean.width(), focal: None };
    let (auto, motion) = (AutoExposure::default(), Motion::default());
    let applied = AppliedDegradation::new(how, synthesis, &auto, &motion, view, key)?;
    Ok(Exposures::default().degrade(clean.into(), &applied, key))
}
