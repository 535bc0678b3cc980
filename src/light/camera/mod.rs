//! Camera of a frame: a distribution of cameras ([`CameraModel`]), and one camera drawn from it ([`CameraState`]).
//!
//! Noise of a camera sensor as a function of its gain: [`Calibration`], built in or from a TOML file.
//!
//! Conversion between linear sRGB and the colour space of a camera: [`rgb_to_camera`], [`inverse`].

#[cfg(test)]
pub(crate) mod tests;

use std::fmt::Display;
use std::path::Path;
use std::sync::Arc;

use rand::distr::{Distribution as _, Open01};
use serde::ser::SerializeStruct;
use serde::{Deserialize, Serialize, Serializer};

use super::draws::{Component, NoiseKey, Site, SiteWords, Stream};
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::Digest;
use darkqa_base::types::text::TomlFault;

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
        let text = files::settings(path)?;
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
    pub rgb_to_camera: ColourMatrix,
    /// Matrix from camera colours to linear sRGB: the inverse of `rgb_to_camera`.
    pub camera_to_rgb: ColourMatrix,
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
        let rgb_to_camera = rgb_to_camera(weights);
        Self {
            rgb_to_camera,
            camera_to_rgb: inverse(&rgb_to_camera),
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

/// Built-in calibrations, as names with TOML texts, the paper's camera first.
const PRESETS: [(&str, &str); 5] = [
    ("sony-a7s2", include_str!("sony-a7s2.toml")),
    ("nikon-d850", include_str!("nikon-d850.toml")),
    ("canon-eos-5d4", include_str!("canon-eos-5d4.toml")),
    ("canon-eos-70d", include_str!("canon-eos-70d.toml")),
    ("canon-eos-700d", include_str!("canon-eos-700d.toml")),
];

/// Noise calibration of a camera sensor (Wei et al., "Physics-based noise modeling for extreme low-light photography",
/// ELD), with the ranges of gain and amplification ratio for random draws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Calibration {
    /// Name of the camera, such as `sony-a7s2`.
    pub name: String,
    /// White level minus black level, in ADU.
    pub adu_range: f64,
    /// Range of the system gain K for log-uniform draws, in ADU per electron.
    pub gain: [f64; 2],
    /// Range of the amplification ratio r for uniform draws.
    pub ratio: [f64; 2],
    /// K of the first step, in ADU per electron; K doubles with each step. `None` if each step has its own gain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_gain: Option<f64>,
    /// Fit of the scale σ_TL of the read noise, in ADU.
    pub read_scale: LogFit,
    /// Fit of the standard deviation σ_r of the row noise, in ADU.
    pub row_deviation: LogFit,
    /// Measurements at each gain, in ascending order of gain.
    #[serde(rename = "step")]
    pub steps: Vec<GainStep>,
}

/// Log-linear fit of a noise parameter σ to the gain: ln σ = slope · ln K + intercept + deviation · z, with z standard
/// normal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LogFit {
    /// Slope of ln σ over ln K.
    pub slope: f64,
    /// ln σ at K = 1.
    pub intercept: f64,
    /// Standard deviation of ln σ about the line.
    pub deviation: f64,
}

/// Measurements at one gain. Noise synthesis draws one of the shapes and one of the offset sets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainStep {
    /// K of the step, in ADU per electron; stated in all steps or in none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    /// Shapes λ of the Tukey-λ distribution of the read noise.
    pub shape: Vec<f64>,
    /// Offset sets, in ADU: one offset for each Bayer plane, in the order R, G1, B, G2.
    pub bias: Vec<[f64; 4]>,
}

/// Noise parameters of a sensor at one gain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorNoise {
    /// Scale σ_TL of the read noise, in ADU.
    pub read_scale: f64,
    /// Shape λ of the read noise.
    pub read_shape: f64,
    /// Standard deviation σ_r of the row noise, in ADU.
    pub row_deviation: f64,
    /// Offset of each Bayer plane, in ADU, in the order R, Gr, Gb, B.
    pub bias: [f64; 4],
}

impl Calibration {
    /// Names of the built-in calibrations, the paper's camera first.
    pub fn names() -> impl Iterator<Item = &'static str> {
        PRESETS.iter().map(|(name, _)| *name)
    }

    /// Built-in calibration of this name; `None` if the name is unknown.
    #[must_use]
    pub fn preset(name: &str) -> Option<Self> {
        let (name, text) = PRESETS.iter().find(|(known, _)| *known == name)?;
        // A test parses every preset.
        Self::parse(text, name).ok()
    }

    /// Parses a calibration; `place` names the file in messages.
    ///
    /// # Errors
    /// [`Error::Data`] with the key that is missing, unknown or out of range.
    pub fn parse(text: &str, place: impl Display) -> Result<Self> {
        let calibration: Self = toml::from_str(text).map_err(|e| {
            let TomlFault { line, problem } = TomlFault::new(text, &e);
            Error::data(format_args!("{place}, line {line}"), format_args!("not a calibration: {problem}"))
        })?;
        calibration.check().map_err(|problem| Error::data(place, problem))?;
        Ok(calibration)
    }

    /// Writes the calibration as TOML for [`Calibration::parse`], below comment lines.
    ///
    /// # Errors
    /// If the calibration cannot be written as TOML.
    pub fn to_toml(&self, comments: &[String]) -> Result<String> {
        let keys = toml::to_string(self).map_err(|e| Error::data(&self.name, e))?;
        Ok(comments.iter().flat_map(|line| ["# ", line, "\n"]).chain([keys.as_str()]).collect())
    }

    /// Checks all values against their limits; the error names the key.
    fn check(&self) -> std::result::Result<(), String> {
        check_limits("adu-range", self.adu_range, [1.0, 1e6])?;
        check_calibrated_range("gain", self.gain, GAINS)?;
        check_calibrated_range("ratio", self.ratio, RATIOS)?;
        for (key, fit) in [("read-scale", self.read_scale), ("row-deviation", self.row_deviation)] {
            check_limits(&format!("{key}.slope"), fit.slope, [-10.0, 10.0])?;
            check_limits(&format!("{key}.intercept"), fit.intercept, [-20.0, 20.0])?;
            check_limits(&format!("{key}.deviation"), fit.deviation, [0.0, 5.0])?;
        }
        if self.steps.is_empty() {
            return Err("step: at least one [[step]] is needed".to_owned());
        }
        self.check_step_gains()?;
        for (index, step) in self.steps.iter().enumerate() {
            let key = |name| format!("step {}, {name}", index + 1);
            if step.shape.is_empty() || step.bias.is_empty() {
                return Err(key("shape and bias: at least one of each is needed"));
            }
            for shape in &step.shape {
                check_limits(&key("shape"), *shape, [-0.49, 2.0])?;
            }
            for offset in step.bias.as_flattened() {
                check_limits(&key("bias"), *offset, [-1e4, 1e4])?;
            }
        }
        Ok(())
    }

    /// Checks that the gains are stated once: either by `first-gain`, or by a `gain` in every step, in ascending order.
    fn check_step_gains(&self) -> std::result::Result<(), String> {
        let gains: Vec<f64> = self.steps.iter().filter_map(|step| step.gain).collect();
        if gains.is_empty() {
            let Some(first) = self.first_gain else {
                return Err("first-gain: missing, and no [[step]] has a gain".to_owned());
            };
            return check_limits("first-gain", first, GAINS);
        }
        if let Some(index) = self.steps.iter().position(|step| step.gain.is_none()) {
            return Err(format!(
                "step {}, gain: missing, and other steps have it; state it in all steps or in none",
                index + 1
            ));
        }
        if self.first_gain.is_some() {
            return Err("first-gain: every [[step]] has a gain; leave out first-gain".to_owned());
        }
        for (index, gain) in gains.iter().enumerate() {
            check_limits(&format!("step {}, gain", index + 1), *gain, GAINS)?;
        }
        if let Some(index) = gains.windows(2).position(|two| two[0] >= two[1]) {
            return Err(format!(
                "step {}, gain: {} is not above {}, the gain of the step before it",
                index + 2,
                gains[index + 1],
                gains[index]
            ));
        }
        Ok(())
    }

    /// Noise parameters at the system gain `gain`, which is in ADU per electron.
    ///
    /// `scatter` contains the standard normal draws z for σ_TL and σ_r. `choices`, uniform in (0, 1), select a shape
    /// and an offset set from the step with the nearest gain, each with equal probability. The author of the
    /// calibration recommends measurements near the gain only: offsets measured at ISO 25600 do not apply at K = 0.1.
    #[must_use]
    pub fn noise_at(&self, gain: f64, scatter: [f64; 2], choices: [f64; 2]) -> SensorNoise {
        let step = &self.steps[self.nearest_step(gain)];
        let [r, g1, b, g2] = *select(&step.bias, choices[1]);
        SensorNoise {
            read_scale: self.read_scale.at(gain, scatter[0]),
            read_shape: *select(&step.shape, choices[0]),
            row_deviation: self.row_deviation.at(gain, scatter[1]),
            bias: [r, g1, g2, b],
        }
    }

    /// Index of the step with the nearest gain on a log scale, at most the step nearest to the upper end of the gain
    /// range.
    fn nearest_step(&self, gain: f64) -> usize {
        let [step, last_step] = [gain, self.gain[1]].map(|gain| match self.first_gain {
            Some(first) => {
                let step = (libm::log2(gain / first) + 0.5).floor();
                step.clamp(0.0, (self.steps.len() - 1) as f64) as usize
            }
            None => self.nearest_listed_step(gain),
        });
        step.min(last_step)
    }

    /// Index of the step whose own `gain` is nearest on a log scale; the lower of two equally near steps.
    fn nearest_listed_step(&self, gain: f64) -> usize {
        self.steps
            .iter()
            .map(|step| step.gain.map_or(f64::INFINITY, |own| libm::log(own / gain).abs()))
            .enumerate()
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map_or(0, |(index, _)| index)
    }
}

/// Checks that a range is within limits and not reversed; the error names the key.
fn check_calibrated_range(key: &str, [low, high]: [f64; 2], limits: [f64; 2]) -> std::result::Result<(), String> {
    check_limits(key, low, limits)?;
    check_limits(key, high, limits)?;
    if low > high {
        return Err(format!("{key}: the range [{low}, {high}] runs backwards"));
    }
    Ok(())
}

/// Checks that a value is between two limits, inclusive; the error names the key.
fn check_limits(key: &str, value: f64, [low, high]: [f64; 2]) -> std::result::Result<(), String> {
    if value >= low && value <= high {
        Ok(())
    } else {
        Err(format!("{key}: {value} is not a number from {low} to {high}"))
    }
}

/// Allowed range of the system gain K, in ADU per electron; the built-in calibrations range from 0.094 to 29.
pub(crate) const GAINS: [f64; 2] = [0.01, 100.0];

/// Allowed range of the amplification ratio r.
const RATIOS: [f64; 2] = [1.0, 10000.0];

impl LogFit {
    /// σ at a gain, `z` standard deviations above the line in ln σ.
    fn at(&self, gain: f64, z: f64) -> f64 {
        libm::exp(self.slope * libm::log(gain) + self.intercept + self.deviation * z)
    }
}

/// The item that a uniform number in (0, 1) selects.
fn select<T>(items: &[T], choice: f64) -> &T {
    let index = ((choice * items.len() as f64) as usize).min(items.len() - 1);
    &items[index]
}

/// 3 × 3 colour matrix, row by row, applied to a column vector of red, green and blue.
pub(crate) type ColourMatrix = [[f64; 3]; 3];

/// XYZ → camera, for the four cameras of the Darmstadt Noise Dataset (Brooks et al. 2019, `random_ccm`).
const XYZ_TO_CAMERA: [ColourMatrix; 4] = [
    [[1.0234, -0.2969, -0.2266], [-0.5625, 1.6328, -0.0469], [-0.0703, 0.2188, 0.6406]],
    [[0.4913, -0.0541, -0.0202], [-0.6130, 1.3513, 0.2906], [-0.1564, 0.2151, 0.7183]],
    [[0.8380, -0.2630, -0.0639], [-0.2887, 1.0725, 0.2496], [-0.0627, 0.1427, 0.5438]],
    [[0.6596, -0.2079, -0.0562], [-0.4782, 1.3016, 0.1933], [-0.0970, 0.1581, 0.5181]],
];

/// Linear sRGB → XYZ, D65 (Brooks et al. 2019, `random_ccm`).
const SRGB_TO_XYZ: ColourMatrix =
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]];

/// Linear sRGB → camera, for a weighted mean of the four cameras. The rows sum to 1, so that grey stays grey (Brooks et
/// al. 2019).
///
/// `weights` must be non-negative and not all zero; their sum does not matter.
#[must_use]
pub(crate) fn rgb_to_camera(weights: [f64; 4]) -> ColourMatrix {
    let total: f64 = weights.iter().sum();
    let mut mix = [[0.0; 3]; 3];
    for (weight, camera) in weights.iter().zip(XYZ_TO_CAMERA) {
        for (mix_row, row) in mix.iter_mut().zip(camera) {
            for (sum, value) in mix_row.iter_mut().zip(row) {
                *sum += weight / total * value;
            }
        }
    }
    product(&mix, &SRGB_TO_XYZ).map(|row| {
        let sum = row[0] + row[1] + row[2];
        row.map(|value| value / sum)
    })
}

/// Inverse of a matrix, by cofactors. A zero determinant is not checked: the matrices of [`rgb_to_camera`] are far from
/// singular.
#[must_use]
pub(crate) fn inverse(matrix: &ColourMatrix) -> ColourMatrix {
    let [a, b, c] = *matrix;
    let cofactors = [cross(b, c), cross(c, a), cross(a, b)];
    let determinant = a[0] * cofactors[0][0] + a[1] * cofactors[0][1] + a[2] * cofactors[0][2];
    std::array::from_fn(|row| cofactors.map(|cofactor| cofactor[row] / determinant))
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn product(left: &ColourMatrix, right: &ColourMatrix) -> ColourMatrix {
    left.map(|row| {
        std::array::from_fn(|column| row[0] * right[0][column] + row[1] * right[1][column] + row[2] * right[2][column])
    })
}
