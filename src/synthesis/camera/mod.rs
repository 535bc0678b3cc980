//! The camera that a frame is taken with: [`CameraModel`] and one [`CameraState`] of it.

mod calibration;

use std::sync::Arc;

pub use calibration::Calibration;
pub(crate) use calibration::SensorNoise;
use calibration::{GAINS, RATIOS};
use rand_distr::{Distribution as _, Open01};
use serde::ser::SerializeStruct;
use serde::{Deserialize, Serialize, Serializer};

use super::colour::{self, Matrix};
use super::random::{Component, NoiseKey, Site, SiteWords, Stream};
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
        let draws = CameraStream(key.stream(Component::Camera));
        let weights = StateNumber::WEIGHTS.map(|number| draws.uniform(number));
        let calibration = &model.calibration;
        let [least, most] = calibration.gain;
        let octaves = draws.uniform(StateNumber::Gain) * libm::log(most / least);
        let system_gain = model.gain.unwrap_or(least * libm::exp(octaves));
        let noise = calibration.noise_at(
            system_gain,
            [StateNumber::ReadScale, StateNumber::RowDeviation]
                .map(|number| draws.of(number).normal()),
            [StateNumber::ReadShape, StateNumber::Bias].map(|number| draws.uniform(number)),
        );
        let [low, high] = calibration.ratio;
        Self {
            rgb_gain: 1.0 / draws.cut_normal(StateNumber::RgbGain),
            red_gain: draws.between(StateNumber::RedGain, 1.9, 2.4),
            blue_gain: draws.between(StateNumber::BlueGain, 1.5, 1.9),
            system_gain,
            ratio: model
                .ratio
                .unwrap_or_else(|| draws.between(StateNumber::Ratio, low, high)),
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
enum StateNumber {
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

impl StateNumber {
    const WEIGHTS: [Self; 4] = [
        Self::FirstWeight,
        Self::SecondWeight,
        Self::ThirdWeight,
        Self::FourthWeight,
    ];
}

/// The camera's stream, addressed by what is drawn.
#[derive(Debug, Clone, Copy)]
struct CameraStream(Stream);

impl CameraStream {
    fn of(self, number: StateNumber) -> SiteWords {
        self.0.at(Site::new(number as usize, 0))
    }

    fn uniform(self, number: StateNumber) -> f64 {
        Open01.sample(&mut self.of(number))
    }

    fn between(self, number: StateNumber, low: f64, high: f64) -> f64 {
        low + self.uniform(number) * (high - low)
    }

    /// N(0.8, 0.1), drawn again beyond three deviations: uncut, its inverse, the brightness gain, has no bound.
    fn cut_normal(self, number: StateNumber) -> f64 {
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
pub(super) mod tests;
