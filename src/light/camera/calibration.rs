//! Noise of a camera sensor as a function of its gain: [`Calibration`], built in or from a TOML file.

use std::fmt::Display;

use serde::{Deserialize, Serialize};

use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::TomlFault;

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
        check_range("gain", self.gain, GAINS)?;
        check_range("ratio", self.ratio, RATIOS)?;
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
fn check_range(key: &str, [low, high]: [f64; 2], limits: [f64; 2]) -> std::result::Result<(), String> {
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
pub(super) const RATIOS: [f64; 2] = [1.0, 10000.0];

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

#[cfg(test)]
mod tests;
