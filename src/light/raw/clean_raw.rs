//! Noise-free RAW image of a frame, for adding noise of several strengths: [`CleanRaw`].

use rayon::prelude::*;

use super::bayer::Bayer;
use super::isp::Developer;
use super::negative::Negative;
use super::noise::{Noise, Term};
use super::unprocess::unprocess_with_headroom;
use crate::camera::CameraState;
use crate::clean::Clean;
use crate::draws::NoiseKey;
use crate::noise_profile::{Amplify, Tone};
use darkqa_base::types::images::Isa;

/// Noise-free RAW image of a frame by one camera. Saves the conversion of the pixels if only the noise changes, not the
/// colours.
#[derive(Debug)]
pub struct CleanRaw {
    raw: Bayer,
    camera: CameraState,
    /// Light at which the sensor saturates, in EV above white; `None` unless the frame is linear scene light.
    headroom_ev: Option<f64>,
    /// Height and width of the frame, in pixels.
    size: [usize; 2],
}

impl CleanRaw {
    /// The noise-free RAW image of `clean` by a camera in the given state. `headroom_ev` is that of the noise profile
    /// ([`Synthesis::headroom_ev`](crate::Synthesis::headroom_ev)); it only affects linear scene light.
    #[must_use]
    pub fn new<'a>(clean: impl Into<Clean<'a>>, camera: CameraState, headroom_ev: f64) -> Self {
        let clean = clean.into();
        Self {
            raw: unprocess_with_headroom(clean, &camera, headroom_ev),
            camera,
            headroom_ev: matches!(clean, Clean::Scene(_)).then_some(headroom_ev),
            size: [clean.height(), clean.width()],
        }
    }

    /// Adds all noise terms of `state` and returns the negative. Colour matrix and gains are those of the camera of
    /// this image, not of `state`.
    ///
    /// Equals [`Negative::with_state`] if `state` has the same colours.
    #[must_use]
    pub fn negative(&self, key: &NoiseKey, state: &CameraState, amplify: Amplify, tone: Tone) -> Negative {
        let isa = Isa::best();
        let noise = Noise::new(state, key, amplify, &Term::ALL, isa);
        let developer = Developer::new(&self.camera, tone, isa);
        let developer = match self.headroom_ev {
            Some(headroom_ev) => developer.for_linear_light(headroom_ev),
            None => developer,
        };
        let mut balanced = self.raw.clone();
        balanced.lines_mut().enumerate().for_each(|(row, mut line)| {
            noise.apply(row, &mut line);
            developer.balance(row, &mut line);
            line.repeat_edges();
        });
        Negative::from_balanced(developer, balanced, self.size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::tests::median;
    use darkqa_base::types::{FrameId, Light, Rgb};

    #[test]
    fn negatives_equal_those_made_from_the_frame() {
        let samples = (0..21 * 35 * 3).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8);
        let codes = Rgb::new(21, 35, samples.collect()).unwrap();
        let samples = codes.samples().iter().map(|code| f32::from(*code) / 40.0);
        let light = Light::new(21, 35, samples.collect()).unwrap();
        let key = NoiseKey::new(4, &FrameId("raw".to_owned()));
        for clean in [Clean::Codes(&codes), Clean::Scene(&light)] {
            let raw = CleanRaw::new(clean, median(), 3.0);
            let mut images = Vec::new();
            for (gain, tone) in [(0.1, Tone::None), (6.0, Tone::BeforeEv)] {
                let state = CameraState { system_gain: gain, read_scale: 2.0 * gain, ..median() };
                let found = raw.negative(&key, &state, Amplify::All, tone);
                let found = found.develop_by(3.0);
                let terms = &Term::ALL;
                let whole = Negative::with_state(clean, &key, &state, Amplify::All, tone, terms, 3.0);
                assert_eq!(found, whole.develop_by(3.0), "K {gain}");
                images.push(found);
            }
            assert_ne!(images[0], images[1]);
        }
    }
}
