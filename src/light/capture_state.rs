//! Serializable state from which a degraded image can be made again: [`CaptureState`].

use darkqa_base::error::{Error, Result};
use darkqa_base::types::images::Isa;
use darkqa_base::types::{Image, Light, Rgb, Severity};
use serde::{Deserialize, Serialize};

use super::applied::AppliedDegradation;
use super::camera::CameraState;
use super::clean::Clean;
use super::draws::NoiseKey;
use super::exposure::{expose, expose_by, expose_to_light};
use super::movement::Streak;
use super::movement::blur::{blur, blurred_codes};
use super::noise_profile::{Amplify, Coupling, Tone};
use super::raw::negative::{Capture, OutputSample};
use super::raw::noise::Term;

/// All parameters that decide an image, except its frame and its noise key. The images equal those of
/// [`degrade`](super::degrade).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CaptureState {
    /// Exposure drop of the image, in EV.
    pub drop_ev: f64,
    /// Path of the image during the exposure; length 0 for kinds without motion.
    pub streak: Streak,
    /// State of the sensor; `None` for kinds without noise.
    pub sensor: Option<SensorState>,
}

/// State of the sensor for one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorState {
    /// Noise terms that the ratio r amplifies.
    pub amplify: Amplify,
    /// Position of a forward tone curve.
    pub tone: Tone,
    /// Quantity that the ratio r depends on.
    pub coupling: Coupling,
    /// Parameters of the camera.
    pub camera: CameraState,
}

/// Whether the random terms of the noise are added.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoiseTerms {
    /// All four terms.
    All,
    /// No terms: the image with the same exposure and colours, without noise.
    None,
}

impl NoiseTerms {
    fn terms(self) -> &'static [Term] {
        match self {
            Self::All => &Term::ALL,
            Self::None => &[],
        }
    }
}

impl CaptureState {
    /// The state for a degradation of the frame that `key` belongs to.
    #[must_use]
    pub fn new(applied: &AppliedDegradation, key: &NoiseKey) -> Self {
        let drop_ev = applied.drop_ev();
        let streak = match applied {
            AppliedDegradation::Exposure(_) | AppliedDegradation::Sensor { .. } => Streak::STILL,
            AppliedDegradation::Auto { streak, .. } | AppliedDegradation::Motion { streak, .. } => *streak,
        };
        let sensor = applied.synthesis().map(|synthesis| SensorState {
            amplify: synthesis.amplify,
            tone: synthesis.tone,
            coupling: synthesis.coupling,
            camera: synthesis.state_after_drop(key, drop_ev),
        });
        Self { drop_ev, streak, sensor }
    }

    /// Checks that all parameters are in range.
    ///
    /// # Errors
    /// [`Error::Data`] with the name of the parameter and its range.
    pub fn check(&self) -> Result<()> {
        check_range("drop_ev", self.drop_ev, [-16.0, 16.0])?;
        Streak::new(self.streak.length(), self.streak.angle())?;
        let Some(sensor) = &self.sensor else {
            return Ok(());
        };
        let camera = &sensor.camera;
        for (name, matrix) in [("rgb_to_camera", &camera.rgb_to_camera), ("camera_to_rgb", &camera.camera_to_rgb)] {
            for value in matrix.as_flattened() {
                check_range(name, *value, [-100.0, 100.0])?;
            }
        }
        for value in camera.bias {
            check_range("bias", value, [-1e5, 1e5])?;
        }
        for (name, value, range) in [
            ("rgb_gain", camera.rgb_gain, [0.01, 100.0]),
            ("red_gain", camera.red_gain, [0.01, 100.0]),
            ("blue_gain", camera.blue_gain, [0.01, 100.0]),
            ("system_gain", camera.system_gain, [0.01, 100.0]),
            ("ratio", camera.ratio, [1.0, 65_536.0]),
            ("read_scale", camera.read_scale, [0.0, 1e5]),
            ("read_shape", camera.read_shape, [-2.0, 2.0]),
            ("row_deviation", camera.row_deviation, [0.0, 1e5]),
            ("adu_range", camera.adu_range, [1.0, 1e6]),
        ] {
            check_range(name, value, range)?;
        }
        Ok(())
    }

    /// Makes the image of a frame, in 8-bit codes.
    #[must_use]
    pub fn image(&self, clean: Clean<'_>, key: &NoiseKey, noise: NoiseTerms) -> Rgb {
        let Some(sensor) = &self.sensor else {
            if !self.streak.is_still() {
                return blurred_codes(clean, self.streak);
            }
            return match exact_severity(self.drop_ev) {
                Some(drop) => expose(clean, drop),
                None => expose_by(clean, self.drop_ev),
            };
        };
        self.capture(sensor, clean, key, noise)
    }

    /// Makes the image of a frame as linear light, before rounding to codes; white is 1. Light L has the code ⌊255 ·
    /// L^(1/2.2) + ½⌋.
    #[must_use]
    pub fn light(&self, clean: Clean<'_>, key: &NoiseKey, noise: NoiseTerms) -> Light {
        let Some(sensor) = &self.sensor else {
            return if self.streak.is_still() {
                expose_to_light(clean, self.drop_ev)
            } else {
                blur(clean, self.streak)
            };
        };
        self.capture(sensor, clean, key, noise)
    }

    /// Makes the image of a frame with sensor noise.
    fn capture<T: OutputSample>(
        &self,
        sensor: &SensorState,
        clean: Clean<'_>,
        key: &NoiseKey,
        noise: NoiseTerms,
    ) -> Image<T> {
        let blurred = (!self.streak.is_still()).then(|| blur(clean, self.streak));
        let exposed = blurred.as_ref().map_or(clean, |light| clean.with_light(light));
        let SensorState { amplify, tone, coupling, camera } = sensor;
        let terms = noise.terms();
        let capture = Capture::from_state(key, camera, *amplify, *tone, terms, Isa::best());
        let headroom_ev = coupling.headroom_ev(self.drop_ev);
        capture.image(exposed, self.drop_ev, headroom_ev)
    }
}

/// The severity of a drop with at most two decimals, for which the exposure drop has an exact table; `None` for other
/// drops.
fn exact_severity(drop_ev: f64) -> Option<Severity> {
    let severity = Severity::from_hundredths((100.0 * drop_ev).round() as u16);
    (severity.value().to_bits() == drop_ev.to_bits()).then_some(severity)
}

fn check_range(name: &str, value: f64, [low, high]: [f64; 2]) -> Result<()> {
    if value >= low && value <= high {
        return Ok(());
    }
    let problem = format_args!("{value} is not a number from {low} to {high}");
    Err(Error::data(name, problem))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AutoExposure, FrameView, Motion, NoiseProfile, Synthesis};
    use darkqa_base::types::{Degradation, FrameId};

    fn picture() -> Rgb {
        Rgb::new(37, 151, (0..3 * 37 * 151).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect())
            .unwrap()
    }

    fn key() -> NoiseKey {
        NoiseKey::new(5, &FrameId("a".to_owned()))
    }

    fn applied(how: &str, reading: NoiseProfile) -> AppliedDegradation {
        let how: Degradation = how.parse().unwrap();
        let synthesis = Synthesis::new(reading, crate::CameraModel::default());
        let view = FrameView { width: 640, focal: None };
        let (auto, motion) = (AutoExposure::default(), Motion::default());
        AppliedDegradation::new(&how, &synthesis, &auto, &motion, view, &key()).unwrap()
    }

    const CASES: [(&str, NoiseProfile); 9] = [
        ("L3-ev", NoiseProfile::Paper),
        ("E3.3-ev", NoiseProfile::Paper),
        ("E2.2-ev", NoiseProfile::Paper),
        ("L2-noise", NoiseProfile::Paper),
        ("L2-noise@eld", NoiseProfile::Eld),
        ("L5-noise@level", NoiseProfile::Level),
        ("L2-noise@physical", NoiseProfile::Physical),
        ("L4-auto", NoiseProfile::Paper),
        ("T33.33-motion", NoiseProfile::Paper),
    ];

    #[test]
    fn a_deserialized_state_makes_the_same_image() {
        for (how, reading) in CASES {
            let applied = applied(how, reading);
            let expected = crate::Exposures::default().degrade((&picture()).into(), &applied, &key());
            let state = CaptureState::new(&applied, &key());
            let text = serde_json::to_string(&state).unwrap();
            let state: CaptureState = serde_json::from_str(&text).unwrap();
            state.check().unwrap();
            let found = state.image((&picture()).into(), &key(), NoiseTerms::All);
            assert_eq!(found, expected, "{how}");
        }
    }

    /// Codes are the rounded light; light halfway between two codes may be rounded either way.
    #[test]
    fn light_matches_the_codes_of_the_image() {
        for (how, reading) in CASES {
            let state = CaptureState::new(&applied(how, reading), &key());
            for noise in [NoiseTerms::All, NoiseTerms::None] {
                let codes = state.image((&picture()).into(), &key(), noise);
                let light = state.light((&picture()).into(), &key(), noise);
                for (code, light) in codes.samples().iter().zip(light.samples()) {
                    let exact = 255.0 * f64::from(*light).powf(1.0 / 2.2);
                    let off = (exact - f64::from(*code)).abs();
                    assert!(off < 0.51, "{how}: {code} has the light {light}");
                }
            }
        }
    }

    #[test]
    fn without_noise_the_key_does_not_change_the_image() {
        let state = CaptureState::new(&applied("L2-noise@eld", NoiseProfile::Eld), &key());
        let other = NoiseKey::new(6, &FrameId("b".to_owned()));
        let picture = picture();
        let [expected, other, noisy] = [(key(), NoiseTerms::None), (other, NoiseTerms::None), (key(), NoiseTerms::All)]
            .map(|(key, noise)| state.image((&picture).into(), &key, noise));
        assert_eq!(expected, other);
        assert_ne!(expected, noisy);
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        let state = CaptureState::new(&applied("L2-noise", NoiseProfile::Paper), &key());
        let mut wrong = state.clone();
        wrong.drop_ev = f64::NAN;
        assert!(wrong.check().unwrap_err().to_string().contains("drop_ev"));
        let mut wrong = state;
        if let Some(sensor) = &mut wrong.sensor {
            sensor.camera.system_gain = 0.0;
        }
        let problem = wrong.check().unwrap_err().to_string();
        assert!(problem.contains("system_gain: 0 is not a number from 0.01 to 100"));
    }
}
