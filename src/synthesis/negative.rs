//! One noisy RAW image, developed at any level that it serves: [`Negative`].

use super::bayer::Bayer;
use super::camera::CameraState;
use super::noise::{self, Term};
use super::profile::{Amplify, Coupling, Draws, Synthesis, Tone};
use super::random::NoiseKey;
use super::{isp, unprocess};
use crate::types::{DarkLevel, Rgb};

/// A frame as the sensor took it: camera and noise are drawn once, and shared by the levels made from it.
///
/// So the levels differ in light alone; each has the distribution that draws of its own would give it.
#[derive(Debug, Clone)]
pub struct Negative {
    state: CameraState,
    balanced: Bayer,
    tone: Tone,
    /// The one level that it serves; `None` for all.
    only: Option<DarkLevel>,
    /// An image of the frame's size, which a development overwrites a copy of.
    canvas: Rgb,
}

impl Negative {
    /// Takes `clean` for a level, with camera and noise drawn from the key.
    #[must_use]
    pub fn new(clean: &Rgb, key: &NoiseKey, synthesis: &Synthesis, level: DarkLevel) -> Self {
        let state = synthesis.state(key, level);
        let key = match synthesis.draws {
            Draws::Shared => *key,
            Draws::Fresh => key.at(level),
        };
        let taken = Self::taken(clean, &key, state, synthesis.amplify, &Term::ALL);
        Self {
            tone: synthesis.tone,
            only: (!synthesis.shares_negative()).then_some(level),
            ..taken
        }
    }

    /// Takes `clean` with a camera in a given state, and with the given terms of noise.
    #[must_use]
    pub fn taken(
        clean: &Rgb,
        key: &NoiseKey,
        state: CameraState,
        amplify: Amplify,
        terms: &[Term],
    ) -> Self {
        let mut raw = unprocess::unprocess(clean, &state);
        noise::add(&mut raw, &state, key, amplify, terms);
        isp::balance(&mut raw, &state);
        Self {
            state,
            balanced: raw,
            tone: Tone::None,
            only: None,
            canvas: clean.clone(),
        }
    }

    /// Whether it is the negative of a level.
    #[must_use]
    pub fn serves(&self, level: DarkLevel) -> bool {
        self.only.is_none_or(|only| only == level)
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
        isp::render(&self.balanced, &self.state, self.tone, level, &mut dark);
        dark
    }
}

impl Synthesis {
    /// The camera of the frame that `key` belongs to, as it is at a level.
    #[must_use]
    pub fn state(&self, key: &NoiseKey, level: DarkLevel) -> CameraState {
        let drawn = CameraState::draw(key, &self.camera);
        match self.coupling {
            Coupling::Independent => drawn,
            Coupling::Photon => CameraState {
                ratio: libm::exp2(f64::from(level.exposure_drop().0)),
                ..drawn
            },
        }
    }

    /// Whether all levels of a frame are made from one negative.
    #[must_use]
    pub fn shares_negative(&self) -> bool {
        self.draws == Draws::Shared && self.coupling == Coupling::Independent
    }
}
