//! Noise of a camera as a function of its gain: [`Calibration`], built in or from a TOML file.

use std::fmt::Display;

use serde::{Deserialize, Serialize};

use darkqa_ground::error::{Error, Result};
use darkqa_ground::types::text::TomlFault;

/// Names and files of the five built-in calibrations, the paper's camera first.
const PRESETS: [(&str, &str); 5] = [
    ("sony-a7s2", include_str!("sony-a7s2.toml")),
    ("nikon-d850", include_str!("nikon-d850.toml")),
    ("canon-eos-5d4", include_str!("canon-eos-5d4.toml")),
    ("canon-eos-70d", include_str!("canon-eos-70d.toml")),
    ("canon-eos-700d", include_str!("canon-eos-700d.toml")),
];

/// Calibrated noise of a sensor (Wei et al., "Physics-based noise modeling for extreme low-light photography", ELD),
/// with the ranges that its gain and its ratio are drawn from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Calibration {
    /// Name of the camera, as `sony-a7s2`.
    pub name: String,
    /// Range of a sample above its black level, in ADU.
    pub adu_range: f64,
    /// Range that the system gain K is drawn from, log-uniform, in ADU per electron.
    pub gain: [f64; 2],
    /// Range that the ratio r is drawn from, uniform.
    pub ratio: [f64; 2],
    /// K at the first step, in ADU per electron; each further step doubles it. `None` if each step has its own gain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_gain: Option<f64>,
    /// Scale σ_TL of the read noise, in ADU.
    pub read_scale: LogFit,
    /// Standard deviation σ_r of the row noise, in ADU.
    pub row_deviation: LogFit,
    /// Measurements at each gain, in ascending order of gain.
    #[serde(rename = "step")]
    pub steps: Vec<GainStep>,
}

/// Fit of a noise parameter σ to the gain: ln σ = slope · ln K + intercept + deviation · z, with z standard normal.
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

/// Measurements at one gain. Synthesis draws one shape and one set of offsets of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainStep {
    /// K of the step, in ADU per electron; either all steps have it or none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    /// Shapes λ of the read noise's Tukey-λ distribution.
    pub shape: Vec<f64>,
    /// Offsets of the planes, in ADU, in the calibration's order R, G1, B, G2.
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

    /// The built-in calibration of this name; `None` if there is none.
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
            Error::data(
                format_args!("{place}, line {line}"),
                format_args!("not a calibration: {problem}"),
            )
        })?;
        calibration
            .check()
            .map_err(|problem| Error::data(place, problem))?;
        Ok(calibration)
    }

    /// The calibration as a file that [`Calibration::parse`] reads, below lines of comments.
    ///
    /// # Errors
    /// If a number cannot be written.
    pub fn to_toml(&self, comments: &[String]) -> Result<String> {
        let keys = toml::to_string(self).map_err(|e| Error::data(&self.name, e))?;
        Ok(comments
            .iter()
            .flat_map(|line| ["# ", line, "\n"])
            .chain([keys.as_str()])
            .collect())
    }

    fn check(&self) -> std::result::Result<(), String> {
        let range = |key: &str, [low, high]: [f64; 2], limits| {
            within(key, low, limits)?;
            within(key, high, limits)?;
            if low > high {
                return Err(format!("{key}: the range [{low}, {high}] runs backwards"));
            }
            Ok(())
        };
        within("adu-range", self.adu_range, [1.0, 1e6])?;
        range("gain", self.gain, GAINS)?;
        range("ratio", self.ratio, RATIOS)?;
        for (key, fit) in [
            ("read-scale", self.read_scale),
            ("row-deviation", self.row_deviation),
        ] {
            within(&format!("{key}.slope"), fit.slope, [-10.0, 10.0])?;
            within(&format!("{key}.intercept"), fit.intercept, [-20.0, 20.0])?;
            within(&format!("{key}.deviation"), fit.deviation, [0.0, 5.0])?;
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
                within(&key("shape"), *shape, [-0.49, 2.0])?;
            }
            for offset in step.bias.as_flattened() {
                within(&key("bias"), *offset, [-1e4, 1e4])?;
            }
        }
        Ok(())
    }

    /// Checks that the gain of every step is known in one of two ways: by `first-gain`, or by a `gain` in each step.
    fn check_step_gains(&self) -> std::result::Result<(), String> {
        let given: Vec<f64> = self.steps.iter().filter_map(|step| step.gain).collect();
        if given.is_empty() {
            let Some(first) = self.first_gain else {
                return Err("first-gain: missing, and no [[step]] has a gain".to_owned());
            };
            return within("first-gain", first, GAINS);
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
        for (index, gain) in given.iter().enumerate() {
            within(&format!("step {}, gain", index + 1), *gain, GAINS)?;
        }
        if let Some(index) = given.windows(2).position(|two| two[0] >= two[1]) {
            return Err(format!(
                "step {}, gain: {} is not above {}, the gain of the step before it",
                index + 2,
                given[index + 1],
                given[index]
            ));
        }
        Ok(())
    }

    /// The noise at system gain `gain`.
    ///
    /// `scatter` holds the standard normal numbers z of the fits of σ_TL and σ_r. `choices`, uniform in (0, 1), choose among
    /// a step's measurements of λ and of the offsets, all with the same probability. The calibration's author advises to
    /// take both near the gain: the offsets of ISO 25600 do not belong to K = 0.1.
    #[must_use]
    pub fn noise_at(&self, gain: f64, scatter: [f64; 2], choices: [f64; 2]) -> SensorNoise {
        let step = &self.steps[self.step(gain)];
        let chosen = |choice: f64, n: usize| ((choice * n as f64) as usize).min(n - 1);
        let [r, g1, b, g2] = step.bias[chosen(choices[1], step.bias.len())];
        SensorNoise {
            read_scale: self.read_scale.at(gain, scatter[0]),
            read_shape: step.shape[chosen(choices[0], step.shape.len())],
            row_deviation: self.row_deviation.at(gain, scatter[1]),
            bias: [r, g1, g2, b],
        }
    }

    /// Index of the step with the nearest gain, in ln K. Steps above the upper end of the gain range are not used.
    fn step(&self, gain: f64) -> usize {
        let nearest = |gain: f64| match self.first_gain {
            Some(first) => {
                let step = (libm::log2(gain / first) + 0.5).floor();
                step.clamp(0.0, (self.steps.len() - 1) as f64) as usize
            }
            None => self.nearest_of_given(gain),
        };
        nearest(gain).min(nearest(self.gain[1]))
    }

    /// Index of the step whose own gain is nearest in ln K; the lower one of two that are equally near.
    fn nearest_of_given(&self, gain: f64) -> usize {
        self.steps
            .iter()
            .map(|step| {
                step.gain
                    .map_or(f64::INFINITY, |own| libm::log(own / gain).abs())
            })
            .enumerate()
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map_or(0, |(index, _)| index)
    }
}

/// Whether a number lies within its limits; the error names its key.
fn within(key: &str, value: f64, [low, high]: [f64; 2]) -> std::result::Result<(), String> {
    if value >= low && value <= high {
        Ok(())
    } else {
        Err(format!(
            "{key}: {value} is not a number from {low} to {high}"
        ))
    }
}

/// Allowed range of the system gain K, in ADU per electron; the built-in calibrations lie between 0.094 and 29.
pub(crate) const GAINS: [f64; 2] = [0.01, 100.0];
/// Allowed range of the amplification ratio r.
pub(super) const RATIOS: [f64; 2] = [1.0, 10000.0];

impl LogFit {
    fn at(&self, gain: f64, z: f64) -> f64 {
        libm::exp(self.slope * libm::log(gain) + self.intercept + self.deviation * z)
    }
}

#[cfg(test)]
mod tests;
