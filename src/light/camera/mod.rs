//! Camera of a frame: a distribution of cameras ([`CameraModel`]), and one camera drawn from it ([`CameraState`]).

pub(super) mod calibration;

use std::path::Path;
use std::sync::Arc;

pub use calibration::Calibration;
pub use calibration::SensorNoise;
use calibration::{GAINS, RATIOS};
use rand::distr::{Distribution as _, Open01};
use serde::ser::SerializeStruct;
use serde::{Deserialize, Serialize, Serializer};

use super::draws::{Component, NoiseKey, Site, SiteWords, Stream};
use super::raw::colour::{self, Matrix};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::reading;
use darkqa_base::types::Digest;

/// Distribution that each frame's camera is drawn from.
///
/// The default is the paper's: a Sony A7S2 with its gain K log-uniform in [0.1, 6.0] and its amplification ratio r
/// uniform in [100, 300]. Either may be pinned. The other parameters of a state are drawn as before, except functions
/// of K.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraModel {
    calibration: Arc<Calibration>,
    sampling: Sampling,
    gain: Option<f64>,
    ratio: Option<f64>,
}

/// How the state of a frame's camera is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// Drawn for each frame.
    #[default]
    Drawn,
    /// Middle of every distribution, the same for all frames.
    Fixed,
}

impl Default for CameraModel {
    fn default() -> Self {
        // The paper's camera.
        Self::preset("sony-a7s2").unwrap_or_else(|_| unreachable!("a test reads this preset"))
    }
}

/// Writes the name and digest of the calibration instead of its many numbers.
impl Serialize for CameraModel {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let calibration = serde_json::to_vec(&*self.calibration).map_err(serde::ser::Error::custom)?;
        let mut fields = serializer.serialize_struct("CameraModel", 5)?;
        fields.serialize_field("name", &self.calibration.name)?;
        fields.serialize_field("calibration", &Digest::from_bytes(&calibration).to_string())?;
        fields.serialize_field("sampling", &self.sampling)?;
        fields.serialize_field("gain", &self.gain)?;
        fields.serialize_field("ratio", &self.ratio)?;
        fields.end()
    }
}

impl CameraModel {
    /// Cameras of a calibration, drawn for each frame, without pinned gain and ratio.
    #[must_use]
    pub fn new(calibration: Calibration) -> Self {
        Self { calibration: Arc::new(calibration), sampling: Sampling::Drawn, gain: None, ratio: None }
    }

    /// Cameras of a built-in calibration by its name.
    ///
    /// # Errors
    /// If no calibration has this name.
    pub fn preset(name: &str) -> Result<Self> {
        Calibration::preset(name).map(Self::new).ok_or_else(|| {
            let names: Vec<_> = Calibration::names().collect();
            let problem = format!("{name:?} is not one of {}, and not a TOML file of a calibration", names.join(", "));
            Error::usage("--noise camera", problem)
        })
    }

    /// Cameras of a built-in calibration by its name, or of the TOML file of a calibration.
    ///
    /// # Errors
    /// If no calibration has this name, or the file cannot be used.
    pub fn open(name_or_path: &str) -> Result<Self> {
        let path = Path::new(name_or_path);
        // Names of cameras have neither an extension nor a folder.
        let is_file = path.extension().is_some() || path.components().count() > 1;
        if !is_file {
            return Self::preset(name_or_path);
        }
        let text = reading::settings(path)?;
        Calibration::parse(&text, path.display()).map(Self::new)
    }

    /// Sets whether states are drawn or fixed (`--noise fixed`).
    pub fn set_sampling(&mut self, sampling: Sampling) {
        self.sampling = sampling;
    }

    /// The same cameras without pinned gain and ratio.
    #[must_use]
    pub fn unpinned(&self) -> Self {
        Self { gain: None, ratio: None, ..self.clone() }
    }

    /// Name of the calibration.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.calibration.name
    }

    /// Range from which the system gain K is drawn, in ADU per electron.
    #[must_use]
    pub fn gain_range(&self) -> [f64; 2] {
        self.calibration.gain
    }

    /// Pins the system gain K, in ADU per electron (`--noise gain`).
    ///
    /// # Errors
    /// If K is not within 0.01 to 100.
    pub fn pin_gain(&mut self, gain: f64) -> Result<()> {
        self.gain = Some(check_range("--noise gain", gain, GAINS)?);
        Ok(())
    }

    /// Calibration of the cameras.
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// Replaces the range from which the system gain K is drawn, in ADU per electron.
    ///
    /// # Errors
    /// If it is not within 0.01 to 100, or runs backwards.
    pub fn set_gain_range(&mut self, range: [f64; 2]) -> Result<()> {
        let [low, high] = range;
        check_range("--noise gain", high, [low, GAINS[1]])?;
        Arc::make_mut(&mut self.calibration).gain = [check_range("--noise gain", low, GAINS)?, high];
        Ok(())
    }

    /// Pins the ratio r: the light is divided by it before the shot noise and multiplied by it after (`--noise ratio`).
    ///
    /// # Errors
    /// If r is not within 1 to 10000.
    pub fn pin_ratio(&mut self, ratio: f64) -> Result<()> {
        self.ratio = Some(check_range("--noise ratio", ratio, RATIOS)?);
        Ok(())
    }
}

fn check_range(flag: &str, value: f64, [low, high]: [f64; 2]) -> Result<f64> {
    if value >= low && value <= high {
        Ok(value)
    } else {
        Err(Error::usage(flag, format_args!("{value} is not a number from {low} to {high}")))
    }
}

/// Parameters of the camera that takes one frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraState {
    /// Matrix from linear sRGB to camera colours; its rows sum to 1.
    pub rgb_to_camera: Matrix,
    /// Matrix from camera colours to linear sRGB: the inverse of `rgb_to_camera`.
    pub camera_to_rgb: Matrix,
    /// Brightness gain, common to all channels.
    pub rgb_gain: f64,
    /// White-balance gain of red.
    pub red_gain: f64,
    /// White-balance gain of blue.
    pub blue_gain: f64,
    /// System gain K, in ADU per electron.
    pub system_gain: f64,
    /// Ratio r by which light is divided before the shot noise and multiplied after it.
    pub ratio: f64,
    /// Scale σ_TL of the read noise's Tukey-λ distribution, in ADU; not its standard deviation.
    pub read_scale: f64,
    /// Shape λ of the same distribution.
    pub read_shape: f64,
    /// Standard deviation σ_r of the row noise, in ADU.
    pub row_deviation: f64,
    /// Offset of each Bayer plane, in ADU, in the order R, Gr, Gb, B.
    pub bias: [f64; 4],
    /// Range of a sample above its black level, in ADU.
    pub adu_range: f64,
}

impl CameraState {
    /// Draws the camera of the frame that `key` belongs to.
    ///
    /// Matrix and colour gains follow Brooks et al. 2019, the sensor's noise Wei et al. 2021, K and r DarkQA.
    #[must_use]
    pub fn draw(key: &NoiseKey, model: &CameraModel) -> Self {
        if model.sampling == Sampling::Fixed {
            return Self::median(model);
        }
        let draws = CameraStream(key.stream(Component::Camera));
        let weights = StateNumber::WEIGHTS.map(|number| draws.uniform(number));
        let calibration = &model.calibration;
        let [min_gain, max_gain] = calibration.gain;
        let log_gain = draws.uniform(StateNumber::Gain) * libm::log(max_gain / min_gain);
        let system_gain = model.gain.unwrap_or(min_gain * libm::exp(log_gain));
        let noise = calibration.noise_at(
            system_gain,
            [StateNumber::ReadScale, StateNumber::RowDeviation].map(|number| draws.words(number).normal()),
            [StateNumber::ReadShape, StateNumber::Bias].map(|number| draws.uniform(number)),
        );
        let [low, high] = calibration.ratio;
        Self {
            rgb_gain: 1.0 / draws.truncated_normal(StateNumber::RgbGain),
            red_gain: draws.between(StateNumber::RedGain, 1.9, 2.4),
            blue_gain: draws.between(StateNumber::BlueGain, 1.5, 1.9),
            system_gain,
            ratio: model.ratio.unwrap_or_else(|| draws.between(StateNumber::Ratio, low, high)),
            ..Self::new(weights, &noise, calibration)
        }
    }

    /// The camera at the middle of each distribution, with the first measurement of the gain step.
    fn median(model: &CameraModel) -> Self {
        let calibration = &model.calibration;
        let [min_gain, max_gain] = calibration.gain;
        let system_gain = model.gain.unwrap_or((min_gain * max_gain).sqrt());
        let noise = calibration.noise_at(system_gain, [0.0; 2], [0.0; 2]);
        let [low, high] = calibration.ratio;
        Self {
            rgb_gain: 1.25,
            red_gain: 2.15,
            blue_gain: 1.7,
            system_gain,
            ratio: model.ratio.unwrap_or(f64::midpoint(low, high)),
            ..Self::new([1.0; 4], &noise, calibration)
        }
    }

    /// A state with these mixing weights of the colour matrix and this noise; all gains and the ratio are 1.
    fn new(weights: [f64; 4], noise: &SensorNoise, calibration: &Calibration) -> Self {
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

/// Addresses of the random numbers of a state in the camera's stream. They are fixed, so that no number depends on
/// other draws.
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
    const WEIGHTS: [Self; 4] = [Self::FirstWeight, Self::SecondWeight, Self::ThirdWeight, Self::FourthWeight];
}

/// The camera's random stream, addressed by [`StateNumber`].
#[derive(Debug, Clone, Copy)]
struct CameraStream(Stream);

impl CameraStream {
    fn words(self, number: StateNumber) -> SiteWords {
        self.0.at(Site::new(number as usize, 0))
    }

    fn uniform(self, number: StateNumber) -> f64 {
        Open01.sample(&mut self.words(number))
    }

    fn between(self, number: StateNumber, low: f64, high: f64) -> f64 {
        low + self.uniform(number) * (high - low)
    }

    /// A draw of N(0.8, 0.1), truncated at three standard deviations, because its inverse, the brightness gain, would
    /// be unbounded.
    fn truncated_normal(self, number: StateNumber) -> f64 {
        let mut words = self.words(number);
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
