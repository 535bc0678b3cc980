//! Noise of a camera as a function of its gain: [`Calibration`], built in or from a TOML file.

use std::fmt::Display;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

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
    /// K at the first step, in ADU per electron; each further step doubles it.
    pub first_gain: f64,
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

/// Measurements at one gain, of which one shape and one set of offsets are drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainStep {
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
            let before = e.span().and_then(|span| text.get(..span.start));
            let line = before.unwrap_or_default().matches('\n').count() + 1;
            Error::data(
                format_args!("{place}, line {line}"),
                format_args!("not a calibration: {}", e.message()),
            )
        })?;
        calibration
            .check()
            .map_err(|problem| Error::data(place, problem))?;
        Ok(calibration)
    }

    fn check(&self) -> std::result::Result<(), String> {
        let within = |key: &str, value: f64, [low, high]: [f64; 2]| {
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(format!(
                    "{key}: {value} is not a number from {low} to {high}"
                ))
            }
        };
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
        within("first-gain", self.first_gain, GAINS)?;
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

    /// Index of the step with the nearest gain. Steps above the upper end of the gain range are not used.
    fn step(&self, gain: f64) -> usize {
        let nearest = |gain: f64| {
            let step = (libm::log2(gain / self.first_gain) + 0.5).floor();
            step.clamp(0.0, (self.steps.len() - 1) as f64) as usize
        };
        nearest(gain).min(nearest(self.gain[1]))
    }
}

/// Allowed range of the system gain K, in ADU per electron; the built-in calibrations lie between 0.094 and 29.
pub(super) const GAINS: [f64; 2] = [0.01, 100.0];
/// Allowed range of the amplification ratio r.
pub(super) const RATIOS: [f64; 2] = [1.0, 10000.0];

impl LogFit {
    fn at(&self, gain: f64, z: f64) -> f64 {
        libm::exp(self.slope * libm::log(gain) + self.intercept + self.deviation * z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sony() -> Calibration {
        Calibration::preset("sony-a7s2").unwrap()
    }

    #[test]
    fn presets_are_parsed_and_have_their_names() {
        for (name, text) in PRESETS {
            assert_eq!(Calibration::parse(text, name).unwrap().name, name);
        }
        assert!(Calibration::preset("sony").is_none());
    }

    #[test]
    fn fits_give_the_calibrated_medians() {
        for (gain, read, row) in [
            (0.1, 0.6075, 0.1642),
            (0.3, 1.0094, 0.2932),
            (1.0, 1.7607, 0.5534),
            (3.0, 2.9253, 0.9879),
            (6.0, 4.0297, 1.4241),
        ] {
            let noise = sony().noise_at(gain, [0.0; 2], [0.0; 2]);
            assert!((noise.read_scale - read).abs() < 6e-5, "{gain}");
            assert!((noise.row_deviation - row).abs() < 6e-5, "{gain}");
        }
        let scattered = sony().noise_at(1.0, [1.0, -1.0], [0.0; 2]);
        assert!((scattered.read_scale.ln() - 0.56571 - 0.26337).abs() < 1e-5);
        assert!((scattered.row_deviation.ln() + 0.59170 + 0.29429).abs() < 1e-5);
    }

    #[test]
    fn measurements_are_those_of_the_nearest_step() {
        for (gain, step) in [
            (0.01, 0),
            (0.1, 0),
            (0.1328, 0),
            (0.1329, 1),
            (0.7746, 3),
            (4.2, 5),
            (4.3, 6),
            (6.0, 6),
            (100.0, 6),
        ] {
            assert_eq!(sony().step(gain), step, "K = {gain}");
        }
        for (gain, shape) in [(0.1, 0.1143), (0.7746, -0.0429), (6.0, -0.1143)] {
            let noise = sony().noise_at(gain, [0.0; 2], [0.0; 2]);
            assert!((noise.read_shape - shape).abs() < 5e-5);
        }
        let first = sony().noise_at(0.7746, [0.0; 2], [0.0, 0.5]);
        assert!((first.read_shape + 3.0 / 70.0).abs() < 1e-15);
        let second = sony().noise_at(0.7746, [0.0; 2], [0.5, 0.0]);
        assert!((second.read_shape + 4.0 / 70.0).abs() < 1e-15);
        assert!((first.bias[0] - 0.60525787).abs() < 1e-15);
    }

    /// The calibration's columns are R, G1, B, G2; the planes are R, Gr, Gb, B.
    #[test]
    fn offsets_reach_their_planes() {
        let bias = sony().noise_at(6.0, [0.0; 2], [0.0; 2]).bias;
        let expected = [-1.5595009, -1.5976678, -1.3571521, -1.3204409];
        assert!(
            bias.iter()
                .zip(expected)
                .all(|(a, b)| (a - b).abs() < 1e-15)
        );
    }

    #[test]
    fn an_impossible_calibration_is_refused_with_its_key() {
        let good = PRESETS[0].1;
        for (from, to, part) in [
            ("adu-range = 15871.0", "adu-range = nan", "adu-range: NaN"),
            ("gain = [0.1, 6.0]", "gain = [6.0, 0.1]", "gain: the range"),
            ("gain = [0.1, 6.0]", "gain = [0.1, inf]", "gain: inf"),
            ("ratio = [100.0, 300.0]", "ratio = [0.0, 300.0]", "ratio: 0"),
            ("[read-scale]", "[read-scales]", "read-scale"),
            ("[read-scale]", "[read-scale]\nshape = 3", "shape"),
            ("name = ", "nmae = ", "nmae"),
            ("adu-range = 15871.0\n", "", "adu-range"),
            (
                "[[step]]\nshape = [0.1142",
                "[[step]]\nshape = [9.1142",
                "step 1, shape: 9.1",
            ),
        ] {
            assert!(good.contains(from), "{from}");
            let text = good.replacen(from, to, 1);
            let error = Calibration::parse(&text, "my.toml")
                .unwrap_err()
                .to_string();
            assert!(
                error.starts_with("my.toml") && error.contains(part),
                "{error}"
            );
        }
        let bare = good.split("[[step]]").next().unwrap();
        let error = Calibration::parse(bare, "my.toml").unwrap_err().to_string();
        assert!(error.contains("step"), "{error}");
    }
}
