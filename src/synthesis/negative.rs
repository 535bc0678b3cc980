//! One noisy RAW image, developed at any level: [`Negative`].

use super::bayer::Bayer;
use super::camera::{CameraModel, CameraState};
use super::noise::{self, Term};
use super::random::NoiseKey;
use super::{isp, unprocess};
use crate::types::{DarkLevel, Rgb};

/// A frame as the sensor took it: camera and noise are drawn once, and shared by the five levels made from it.
///
/// So the levels differ in light alone; each has the distribution that draws of its own would give it.
#[derive(Debug, Clone)]
pub struct Negative {
    state: CameraState,
    balanced: Bayer,
    /// An image of the frame's size, which a development overwrites a copy of.
    canvas: Rgb,
}

impl Negative {
    /// Takes `clean` with a camera drawn from the key.
    #[must_use]
    pub fn new(clean: &Rgb, key: &NoiseKey, camera: &CameraModel) -> Self {
        Self::taken(clean, key, CameraState::draw(key, camera), &Term::ALL)
    }

    /// Takes `clean` with a camera in a given state, and with the given terms of noise.
    #[must_use]
    pub fn taken(clean: &Rgb, key: &NoiseKey, state: CameraState, terms: &[Term]) -> Self {
        let mut raw = unprocess::unprocess(clean, &state);
        noise::add(&mut raw, &state, key, terms);
        isp::balance(&mut raw, &state);
        Self {
            state,
            balanced: raw,
            canvas: clean.clone(),
        }
    }

    /// The camera that took it.
    #[must_use]
    pub fn state(&self) -> &CameraState {
        &self.state
    }

    /// The sRGB image at a level.
    #[must_use]
    pub fn develop(&self, level: DarkLevel) -> Rgb {
        let mut dark = self.canvas.clone();
        isp::render(&self.balanced, &self.state, level, &mut dark);
        dark
    }
}
