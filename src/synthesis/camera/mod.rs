//! The camera that a frame is taken with: [`CameraModel`] and one [`CameraState`] of it.

mod calibration;

use std::sync::Arc;

pub use calibration::{Calibration, Fit, SensorNoise, Step};
use calibration::{GAINS, RATIOS};
use rand_distr::{Distribution as _, Open01};
use serde::ser::SerializeStruct;
use serde::{Deserialize, Serialize, Serializer};

use super::colour::{self, Matrix};
use super::random::{Component, NoiseKey, Site, Stream, Words};
use crate::error::{Error, Result};
use crate::types::Digest;

/// The distribution that each frame's camera is drawn from.
///
/// The default is the paper's: a Sony A7S2 with its gain K log-uniform in [0.1, 6.0] and its amplification ratio r
/// uniform in [100, 300]. Either may be pinned; pinning one leaves every other number of the state as it was drawn,
/// save what is a function of K.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraModel {
    calibration: Arc<Calibration>,
    sampling: Sampling,
    gain: Option<f64>,
    ratio: Option<f64>,
}

/// Where a state comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// Drawn for each frame.
    #[default]
    Drawn,
    /// The middle of every distribution, the same for all frames.
    Fixed,
}

impl Default for CameraModel {
    fn default() -> Self {
        // The paper's own camera, which is among the presets.
        Self::preset("sony-a7s2").unwrap_or_else(|_| unreachable!("a test reads it"))
    }
}

/// Written by the calibration's name and digest: its numbers would fill a page.
impl Serialize for CameraModel {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let calibration =
            serde_json::to_vec(&*self.calibration).map_err(serde::ser::Error::custom)?;
        let mut fields = serializer.serialize_struct("CameraModel", 5)?;
        fields.serialize_field("name", &self.calibration.name)?;
        fields.serialize_field("calibration", &Digest::of(&calibration).to_string())?;
        fields.serialize_field("sampling", &self.sampling)?;
        fields.serialize_field("gain", &self.gain)?;
        fields.serialize_field("ratio", &self.ratio)?;
        fields.end()
    }
}

impl CameraModel {
    /// The cameras of a calibration.
    #[must_use]
    pub fn new(calibration: Calibration) -> Self {
        Self {
            calibration: Arc::new(calibration),
            sampling: Sampling::Drawn,
            gain: None,
            ratio: None,
        }
    }

    /// A calibrated camera by its name.
    ///
    /// # Errors
    /// Where none is called so.
    pub fn preset(name: &str) -> Result<Self> {
        Calibration::preset(name).map(Self::new).ok_or_else(|| {
            let names: Vec<_> = Calibration::names().collect();
            let problem = format!(
                "{name:?} is none of {}, and no TOML file of a calibration",
                names.join(", ")
            );
            Error::usage("--camera", problem)
        })
    }

    /// Whether a state is drawn or fixed (`--fixed`).
    pub fn set_sampling(&mut self, sampling: Sampling) {
        self.sampling = sampling;
    }

    /// Pins the system gain K, in ADU an electron (`--gain`).
    ///
    /// # Errors
    /// Where K is not within 0.01 to 100.
    pub fn pin_gain(&mut self, gain: f64) -> Result<()> {
        self.gain = Some(within("--gain", gain, GAINS)?);
        Ok(())
    }

    /// Pins the ratio r by which the light is cut before the shot noise and amplified after it (`--ratio`).
    ///
    /// # Errors
    /// Where r is not within 1 to 10000.
    pub fn pin_ratio(&mut self, ratio: f64) -> Result<()> {
        self.ratio = Some(within("--ratio", ratio, RATIOS)?);
        Ok(())
    }
}

fn within(flag: &str, value: f64, [low, high]: [f64; 2]) -> Result<f64> {
    if value >= low && value <= high {
        Ok(value)
    } else {
        Err(Error::usage(
            flag,
            format_args!("{value} is not a number from {low} to {high}"),
        ))
    }
}

/// Everything about the camera that takes one frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraState {
    /// Linear sRGB → camera, rows summing to 1.
    pub rgb_to_camera: Matrix,
    /// Camera → linear sRGB: the inverse of `rgb_to_camera`.
    pub camera_to_rgb: Matrix,
    /// Brightness gain of all channels.
    pub rgb_gain: f64,
    /// White-balance gain of red.
    pub red_gain: f64,
    /// White-balance gain of blue.
    pub blue_gain: f64,
    /// System gain K, in ADU an electron.
    pub system_gain: f64,
    /// Amplification ratio r.
    pub ratio: f64,
    /// Scale σ_TL of the read noise's Tukey-λ distribution, in ADU; not its standard deviation.
    pub read_scale: f64,
    /// Shape λ of the same distribution.
    pub read_shape: f64,
    /// Standard deviation σ_r of the row noise, in ADU.
    pub row_deviation: f64,
    /// Offset of each Bayer plane, in ADU, in the order R, Gr, Gb, B.
    pub bias: [f64; 4],
    /// The range of a sample above its black level, in ADU.
    pub adu_range: f64,
}

impl CameraState {
    /// Draws the camera of the frame that `key` belongs to.
    ///
    /// Matrix and gains follow Brooks et al. 2019, the sensor's noise Wei et al. 2021, K and r DarkQA.
    #[must_use]
    pub fn draw(key: &NoiseKey, model: &CameraModel) -> Self {
        if model.sampling == Sampling::Fixed {
            return Self::median(model);
        }
        let draws = Draws(key.stream(Component::Camera));
        let weights = Number::WEIGHTS.map(|number| draws.uniform(number));
        let calibration = &model.calibration;
        let [least, most] = calibration.gain;
        let octaves = draws.uniform(Number::Gain) * libm::log(most / least);
        let system_gain = model.gain.unwrap_or(least * libm::exp(octaves));
        let noise = calibration.noise_at(
            system_gain,
            [Number::ReadScale, Number::RowDeviation].map(|number| draws.of(number).normal()),
            [Number::ReadShape, Number::Bias].map(|number| draws.uniform(number)),
        );
        let [low, high] = calibration.ratio;
        Self {
            rgb_gain: 1.0 / draws.cut_normal(Number::RgbGain),
            red_gain: draws.between(Number::RedGain, 1.9, 2.4),
            blue_gain: draws.between(Number::BlueGain, 1.5, 1.9),
            system_gain,
            ratio: model
                .ratio
                .unwrap_or_else(|| draws.between(Number::Ratio, low, high)),
            ..Self::of(weights, &noise, calibration)
        }
    }

    /// The camera at the middle of each distribution, and the first of a step's measurements.
    fn median(model: &CameraModel) -> Self {
        let calibration = &model.calibration;
        let [least, most] = calibration.gain;
        let system_gain = model.gain.unwrap_or((least * most).sqrt());
        let noise = calibration.noise_at(system_gain, [0.0; 2], [0.0; 2]);
        let [low, high] = calibration.ratio;
        Self {
            rgb_gain: 1.25,
            red_gain: 2.15,
            blue_gain: 1.7,
            system_gain,
            ratio: model.ratio.unwrap_or(f64::midpoint(low, high)),
            ..Self::of([1.0; 4], &noise, calibration)
        }
    }

    /// A state of colour and noise, its gains and ratio 1.
    fn of(weights: [f64; 4], noise: &SensorNoise, calibration: &Calibration) -> Self {
        let rgb_to_camera = colour::rgb_to_camera(weights);
        Self {
            rgb_to_camera,
            camera_to_rgb: colour::inverse(&rgb_to_camera),
            rgb_gain: 1.0,
            red_gain: 1.0,
            blue_gain: 1.0,
            system_gain: 1.0,
            ratio: 1.0,
            read_scale: noise.read_scale,
            read_shape: noise.read_shape,
            row_deviation: noise.row_deviation,
            bias: noise.bias,
            adu_range: calibration.adu_range,
        }
    }
}

/// The numbers of a state, each with its own place in the camera's stream: none depends on how many others are drawn.
#[derive(Debug, Clone, Copy)]
enum Number {
    FirstWeight,
    SecondWeight,
    ThirdWeight,
    FourthWeight,
    RgbGain,
    RedGain,
    BlueGain,
    Gain,
    Ratio,
    ReadScale,
    RowDeviation,
    ReadShape,
    Bias,
}

impl Number {
    const WEIGHTS: [Self; 4] = [
        Self::FirstWeight,
        Self::SecondWeight,
        Self::ThirdWeight,
        Self::FourthWeight,
    ];
}

/// The camera's stream, addressed by what is drawn.
#[derive(Debug, Clone, Copy)]
struct Draws(Stream);

impl Draws {
    fn of(self, number: Number) -> Words {
        self.0.at(Site::new(number as usize, 0))
    }

    fn uniform(self, number: Number) -> f64 {
        Open01.sample(&mut self.of(number))
    }

    fn between(self, number: Number, low: f64, high: f64) -> f64 {
        low + self.uniform(number) * (high - low)
    }

    /// N(0.8, 0.1), drawn again beyond three deviations: uncut, its inverse, the brightness gain, has no bound.
    fn cut_normal(self, number: Number) -> f64 {
        let mut words = self.of(number);
        loop {
            let z = words.normal();
            if z.abs() <= 3.0 {
                return 0.8 + 0.1 * z;
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::types::FrameId;

    /// The fixed camera: the one that published figures of flat greys are for.
    pub(in crate::synthesis) fn median() -> CameraState {
        let mut model = CameraModel::default();
        model.set_sampling(Sampling::Fixed);
        let key = NoiseKey::new(0, &FrameId(String::new()));
        CameraState::draw(&key, &model)
    }

    #[test]
    fn the_fixed_camera_is_the_same_for_all_frames() {
        let state = median();
        assert!((state.system_gain - 0.6f64.sqrt()).abs() < 1e-15);
        assert!((state.ratio - 200.0).abs() < 1e-12);
        let mut model = CameraModel::default();
        model.set_sampling(Sampling::Fixed);
        model.pin_gain(2.0).unwrap();
        let pinned = states(&model, 2);
        assert_eq!(pinned[0], pinned[1]);
        assert!((pinned[0].system_gain - 2.0).abs() < 1e-15);
    }

    #[test]
    fn a_state_is_read_as_it_was_written() {
        for state in states(&CameraModel::default(), 50) {
            let text = serde_json::to_string(&state).unwrap();
            assert_eq!(serde_json::from_str::<CameraState>(&text).unwrap(), state);
        }
    }

    #[test]
    fn every_calibrated_camera_keeps_its_ranges() {
        for name in Calibration::names() {
            let model = CameraModel::preset(name).unwrap();
            let [low, high] = model.calibration.gain;
            for state in states(&model, 200) {
                assert!(
                    state.system_gain >= low && state.system_gain <= high,
                    "{name}"
                );
                assert!((100.0..=300.0).contains(&state.ratio), "{name}");
                assert!(state.read_scale > 0.0 && state.read_scale < 500.0, "{name}");
            }
        }
        let error = CameraModel::preset("leica").unwrap_err().to_string();
        assert!(error.contains("canon-eos-70d"), "{error}");
    }

    fn states(model: &CameraModel, n: usize) -> Vec<CameraState> {
        let key = |i| NoiseKey::new(5, &FrameId(format!("frame {i}")));
        (0..n).map(|i| CameraState::draw(&key(i), model)).collect()
    }

    /// The largest distance between the sample's distribution function and `cdf`, in units of 1/√n.
    fn kolmogorov(mut sample: Vec<f64>, cdf: impl Fn(f64) -> f64) -> f64 {
        sample.sort_by(f64::total_cmp);
        let n = sample.len() as f64;
        let gap = |(i, x): (usize, &f64)| {
            let f = cdf(*x);
            (f - i as f64 / n).abs().max(((i + 1) as f64 / n - f).abs())
        };
        sample.iter().enumerate().map(gap).fold(0.0, f64::max) * n.sqrt()
    }

    #[test]
    fn numbers_have_their_distributions() {
        let all = states(&CameraModel::default(), 10_000);
        let of = |f: fn(&CameraState) -> f64| all.iter().map(f).collect::<Vec<_>>();
        let uniform = |low: f64, high: f64| move |x: f64| (x - low) / (high - low);
        let normal = |z: f64| 0.5 * libm::erfc(-z / f64::sqrt(2.0));
        let cut = |inverse: f64| {
            (normal((inverse - 0.8) / 0.1) - normal(-3.0)) / (1.0 - 2.0 * normal(-3.0))
        };
        let cases = [
            (
                "K",
                kolmogorov(
                    of(|s| s.system_gain.ln()),
                    uniform(0.1f64.ln(), 6.0f64.ln()),
                ),
            ),
            ("r", kolmogorov(of(|s| s.ratio), uniform(100.0, 300.0))),
            ("red", kolmogorov(of(|s| s.red_gain), uniform(1.9, 2.4))),
            ("blue", kolmogorov(of(|s| s.blue_gain), uniform(1.5, 1.9))),
            ("1/rgb", kolmogorov(of(|s| 1.0 / s.rgb_gain), cut)),
        ];
        for (name, distance) in cases {
            assert!(distance < 1.95, "{name}: {distance}");
        }
        assert!(
            all.iter()
                .all(|s| (0.5..=1.1).contains(&(1.0 / s.rgb_gain)))
        );
        assert!(all.iter().all(|s| (0.1..=6.0).contains(&s.system_gain)));
    }

    #[test]
    fn a_pinned_number_moves_no_other() {
        let mut pinned = CameraModel::default();
        pinned.pin_ratio(42.0).unwrap();
        let (free, fixed) = (states(&CameraModel::default(), 20), states(&pinned, 20));
        for (free, fixed) in free.into_iter().zip(fixed) {
            assert_eq!(
                CameraState {
                    ratio: 42.0,
                    ..free
                },
                fixed
            );
        }
        pinned.pin_gain(6.0).unwrap();
        for state in states(&pinned, 20) {
            assert!((state.system_gain - 6.0).abs() < f64::EPSILON);
            assert!([-1.5595009, -1.5529999].contains(&state.bias[0]));
        }
    }

    #[test]
    fn frames_and_seeds_have_their_own_camera() {
        let draw = |seed, id: &str| {
            CameraState::draw(
                &NoiseKey::new(seed, &FrameId(id.to_owned())),
                &CameraModel::default(),
            )
        };
        assert_eq!(draw(1, "a"), draw(1, "a"));
        assert_ne!(draw(1, "a"), draw(2, "a"));
        assert_ne!(draw(1, "a"), draw(1, "b"));
    }

    #[test]
    fn pins_are_checked_and_name_their_flag() {
        let mut model = CameraModel::default();
        for wrong in [f64::NAN, f64::INFINITY, 0.0, -1.0, 1e9] {
            let gain = model.pin_gain(wrong).unwrap_err().to_string();
            assert!(gain.contains("--gain"), "{gain}");
            let ratio = model.pin_ratio(wrong).unwrap_err().to_string();
            assert!(ratio.contains("--ratio"), "{ratio}");
        }
        assert_eq!(model, CameraModel::default());
    }
}
