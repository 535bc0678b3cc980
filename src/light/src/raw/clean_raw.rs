//! The noise-free RAW image of a frame, [`CleanRaw`], which noise of several strengths is added to.

use rayon::prelude::*;

use super::bayer::Bayer;
use super::isp::Developer;
use super::negative::Negative;
use super::noise::{Noise, Term};
use super::unprocess::unprocess_up_to;
use crate::camera::CameraState;
use crate::clean::Clean;
use crate::draws::NoiseKey;
use crate::noise_profile::{Amplify, Tone};
use darkqa_ground::types::images::Isa;

/// Noise-free RAW image of a frame, by one camera.
///
/// It saves the conversion of the pixels where only the noise of the camera changes, not its colours.
#[derive(Debug)]
pub struct CleanRaw {
    raw: Bayer,
    camera: CameraState,
    /// How many EV above white the sensor saturates, if the frame is light in front of the camera.
    headroom_ev: Option<f64>,
    /// Height and width of the frame, in pixels.
    size: [usize; 2],
}

impl CleanRaw {
    /// The noise-free RAW image of `clean` by a camera in the given state. `headroom_ev` is that of the noise profile
    /// ([`Synthesis::headroom_ev`](crate::Synthesis::headroom_ev)); it matters for light alone.
    #[must_use]
    pub fn new<'a>(clean: impl Into<Clean<'a>>, camera: CameraState, headroom_ev: f64) -> Self {
        let clean = clean.into();
        Self {
            raw: unprocess_up_to(clean, &camera, headroom_ev),
            camera,
            headroom_ev: matches!(clean, Clean::Scene(_)).then_some(headroom_ev),
            size: [clean.height(), clean.width()],
        }
    }

    /// The negative with all terms of the noise of `state`. The matrix and the gains of its colours are not used: those of
    /// the camera of this image are.
    ///
    /// The negative equals that of [`Negative::with_state`] if the colours are the same.
    #[must_use]
    pub fn negative(
        &self,
        key: &NoiseKey,
        state: &CameraState,
        amplify: Amplify,
        tone: Tone,
    ) -> Negative {
        let isa = Isa::best();
        let noise = Noise::new(state, key, amplify, &Term::ALL, isa);
        let developer = Developer::new(&self.camera, tone, isa);
        let developer = match self.headroom_ev {
            Some(headroom_ev) => developer.for_linear_light(headroom_ev),
            None => developer,
        };
        let mut balanced = self.raw.clone();
        balanced
            .lines_mut()
            .enumerate()
            .for_each(|(row, mut line)| {
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
    use darkqa_ground::types::{FrameId, Light, Rgb};

    #[test]
    fn negatives_are_those_of_the_frame_itself() {
        let samples = (0..21 * 35 * 3).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8);
        let codes = Rgb::new(21, 35, samples.collect()).unwrap();
        let samples = codes.samples().iter().map(|code| f32::from(*code) / 40.0);
        let light = Light::new(21, 35, samples.collect()).unwrap();
        let key = NoiseKey::new(4, &FrameId("raw".to_owned()));
        for clean in [Clean::Codes(&codes), Clean::Scene(&light)] {
            let raw = CleanRaw::new(clean, median(), 3.0);
            let mut images = Vec::new();
            for (gain, tone) in [(0.1, Tone::None), (6.0, Tone::BeforeEv)] {
                let state = CameraState {
                    system_gain: gain,
                    read_scale: 2.0 * gain,
                    ..median()
                };
                let found = raw.negative(&key, &state, Amplify::All, tone);
                let found = found.develop_by(3.0);
                let terms = &Term::ALL;
                let whole =
                    Negative::with_state(clean, &key, &state, Amplify::All, tone, terms, 3.0);
                assert_eq!(found, whole.develop_by(3.0), "K {gain}");
                images.push(found);
            }
            assert_ne!(images[0], images[1]);
        }
    }
}
