//! Reaction of a camera with automatic exposure to an exposure drop: the settings [`AutoExposure`] and the result
//! [`AutoShot`].
//!
//! For a scene that is ΔEV darker, the camera exposes s stops longer, adds g stops of gain, and leaves d = ΔEV − s − g
//! uncompensated. The number of photons falls by 2^−(ΔEV − s), the brightness of the image by 2^−d, and the longer
//! exposure blurs the image if the camera turns. The noise is that of the noise profile `physical` at the drop d, with
//! the gain K = K₀ · 2^g and the ratio r = 2^d. The relative variance of the shot noise of a sample y is then K · r / y
//! = K₀ · 2^(ΔEV − s) / y, whatever the split between gain and darkness.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use super::camera::{CameraModel, GAINS};
use super::noise_profile::{NoiseProfile, Synthesis};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Severity;
use darkqa_base::types::flags::{number, pairs};

/// Settings of automatic exposure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct AutoExposure {
    /// Maximum lengthening of the exposure, in EV.
    pub shutter: f64,
    /// Maximum additional gain, in EV.
    pub gain: f64,
    /// System gain K₀ without a drop, in ADU per electron.
    pub base_gain: f64,
    /// Exposure time without a drop, in seconds.
    pub base_time: f64,
}

/// Default maximum additional gain, in EV; chosen, because beyond it cameras rely on noise reduction.
const MAX_GAIN: f64 = 4.0;

/// Settings of the flag `--auto`. Missing gain settings are derived from the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AutoSettings {
    shutter: f64,
    gain: Option<f64>,
    base_gain: Option<f64>,
    base_time: f64,
}

impl Default for AutoSettings {
    /// From 1/120 s to the 1/30 s of a video with 30 frames a second; chosen.
    fn default() -> Self {
        Self { shutter: 2.0, gain: None, base_gain: None, base_time: 1.0 / 120.0 }
    }
}

impl AutoSettings {
    /// The settings for a camera. By default, the gain reaches the camera's largest K, and K₀ is [`MAX_GAIN`] stops
    /// below it, or the camera's smallest K if that is larger.
    #[must_use]
    pub fn for_camera(&self, camera: &CameraModel) -> AutoExposure {
        let [low, high] = camera.gain_range();
        let base_gain = self.base_gain.unwrap_or_else(|| low.max(high / libm::exp2(MAX_GAIN)));
        AutoExposure {
            shutter: self.shutter,
            gain: self.gain.unwrap_or_else(|| libm::log2(high / base_gain).clamp(0.0, MAX_GAIN)),
            base_gain,
            base_time: self.base_time,
        }
    }
}

impl Default for AutoExposure {
    /// Settings for the paper's camera.
    fn default() -> Self {
        AutoSettings::default().for_camera(&CameraModel::default())
    }
}

/// Exposure that automatic exposure chooses for one exposure drop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AutoShot {
    /// Lengthening of the exposure, in EV.
    pub shutter: f64,
    /// Additional gain, in EV.
    pub gain: f64,
    /// Uncompensated rest of the drop, in EV.
    pub dark: f64,
    /// Exposure time, in seconds.
    pub time: f64,
    /// System gain K, in ADU per electron.
    pub system_gain: f64,
}

impl AutoExposure {
    /// The exposure for an exposure drop.
    #[must_use]
    pub fn shot(&self, drop: Severity) -> AutoShot {
        let drop = drop.value();
        let shutter = drop.min(self.shutter);
        let gain = (drop - shutter).min(self.gain);
        AutoShot {
            shutter,
            gain,
            dark: drop - shutter - gain,
            time: self.base_time * libm::exp2(shutter),
            system_gain: self.base_gain * libm::exp2(gain),
        }
    }
}

/// Relative tolerance for K outside the camera's range: a measured K has an error of 0.1 to 0.2 % (`calibrate`), and
/// users round it.
const GAIN_TOLERANCE: f64 = 2e-3;

impl AutoShot {
    /// The noise profile `physical` with the gain K of this shot.
    ///
    /// # Errors
    /// If the camera has no such gain.
    pub fn synthesis(&self, camera: &CameraModel) -> Result<Synthesis> {
        let [low, high] = camera.gain_range();
        let gain = self.system_gain;
        if gain < low * (1.0 - GAIN_TOLERANCE) || gain > high * (1.0 + GAIN_TOLERANCE) {
            let problem = format_args!(
                "at {} stops of gain, K is {}, but {} has K from {} to {}; set another base-gain or fewer stops of gain",
                self.gain,
                round_to_4_decimals(gain),
                camera.name(),
                round_to_4_decimals(low),
                round_to_4_decimals(high)
            );
            return Err(Error::usage("--auto", problem));
        }
        let mut camera = camera.unpinned();
        camera.pin_gain(gain)?;
        Ok(Synthesis::new(NoiseProfile::Physical, camera))
    }
}

fn round_to_4_decimals(gain: f64) -> f64 {
    (gain * 1e4).round() / 1e4
}

impl FromStr for AutoSettings {
    type Err = String;

    /// Parses `shutter=2,gain=4,base-gain=0.375,base-time=1/120`; missing keys keep their defaults.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut auto = Self::default();
        for (key, value) in pairs(text, &["shutter", "gain", "base-gain", "base-time"])? {
            match key {
                "shutter" => auto.shutter = number(key, value, "EV", 0.0..=16.0)?,
                "gain" => auto.gain = Some(number(key, value, "EV", 0.0..=16.0)?),
                "base-gain" => {
                    let [low, high] = GAINS;
                    let base_gain = number(key, value, "ADU per electron", low..=high)?;
                    auto.base_gain = Some(base_gain);
                }
                _ => auto.base_time = seconds(value)?,
            }
        }
        Ok(auto)
    }
}

/// Maximum exposure time without a drop, in seconds; chosen.
const MAX_BASE_TIME: f64 = 10.0;

/// Parses a time in seconds, such as `1/120` or `0.01`.
fn seconds(value: &str) -> Result<f64, String> {
    let (numerator, denominator) = value.split_once('/').unwrap_or((value, "1"));
    let numerator: Option<f64> = numerator.trim().parse().ok();
    let denominator: Option<f64> = denominator.trim().parse().ok();
    let seconds = numerator.zip(denominator).map(|(numerator, denominator)| numerator / denominator);
    seconds.filter(|seconds| *seconds > 0.0 && *seconds <= MAX_BASE_TIME).ok_or_else(|| {
        format!("base-time={value}: a number of seconds above 0, up to {MAX_BASE_TIME}, expected, as 1/120 or 0.01")
    })
}

impl fmt::Display for AutoSettings {
    /// Writes the settings in the form that [`FromStr`] parses.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "shutter={},", self.shutter)?;
        for (key, value) in [("gain", self.gain), ("base-gain", self.base_gain)] {
            if let Some(value) = value {
                write!(f, "{key}={value},")?;
            }
        }
        f.write_str("base-time=")?;
        let whole = self.base_time.recip().round();
        if whole > 1.0 && whole.recip().to_bits() == self.base_time.to_bits() {
            write!(f, "1/{whole}")
        } else {
            write!(f, "{}", self.base_time)
        }
    }
}

impl fmt::Display for AutoExposure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let settings = AutoSettings {
            shutter: self.shutter,
            gain: Some(self.gain),
            base_gain: Some(self.base_gain),
            base_time: self.base_time,
        };
        settings.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shot(settings: &str, camera: &CameraModel, drop: Severity) -> AutoShot {
        let settings: AutoSettings = settings.parse().unwrap();
        settings.for_camera(camera).shot(drop)
    }

    /// Base gain and maximum gain for a camera, after a check that the camera has the gain of every level.
    fn gains(settings: &str, camera: &CameraModel) -> (f64, f64) {
        let settings: AutoSettings = settings.parse().unwrap();
        let auto = settings.for_camera(camera);
        for drop in [Severity::L1, Severity::L3, Severity::L5] {
            auto.shot(drop).synthesis(camera).unwrap();
        }
        (auto.base_gain, auto.gain)
    }

    #[test]
    fn shutter_comes_first_then_gain_then_darkness() {
        let auto = AutoExposure::default();
        for (drop, [shutter, gain, dark, time, system_gain]) in [
            (100, [1.0, 0.0, 0.0, 1.0 / 60.0, 0.375]),
            (200, [2.0, 0.0, 0.0, 1.0 / 30.0, 0.375]),
            (400, [2.0, 2.0, 0.0, 1.0 / 30.0, 1.5]),
            (600, [2.0, 4.0, 0.0, 1.0 / 30.0, 6.0]),
            (750, [2.0, 4.0, 1.5, 1.0 / 30.0, 6.0]),
            (900, [2.0, 4.0, 3.0, 1.0 / 30.0, 6.0]),
        ] {
            let shot = auto.shot(Severity::from_hundredths(drop));
            let found = [shot.shutter, shot.gain, shot.dark, shot.time, shot.system_gain];
            for (found, expected) in found.iter().zip([shutter, gain, dark, time, system_gain]) {
                assert!((found - expected).abs() < 1e-12, "{drop}: {shot:?}");
            }
        }
    }

    #[test]
    fn a_gain_that_the_camera_lacks_is_refused() {
        let camera = CameraModel::default();
        let max_gain = shot("gain=4", &camera, Severity::L3).synthesis(&camera).unwrap();
        assert_eq!(max_gain.name().as_str(), "physical");
        for auto in ["gain=4.01", "gain=4,base-gain=0.38", "gain=0,base-gain=0.09"] {
            let error = shot(auto, &camera, Severity::L5).synthesis(&camera).unwrap_err().to_string();
            assert!(error.starts_with("--auto: at ") && error.contains("sony-a7s2 has K from 0.1 to 6"), "{error}");
        }
        // At L2 only two stops of gain are used, which the camera has.
        shot("gain=5", &camera, Severity::L2).synthesis(&camera).unwrap();
    }

    #[test]
    fn the_gain_follows_from_the_camera() {
        let nikon = CameraModel::preset("nikon-d850").unwrap();
        let [_, high] = nikon.gain_range();
        assert_eq!(gains("shutter=2", &nikon), (high / 16.0, 4.0));
        assert_eq!(gains("gain=2", &nikon), (high / 16.0, 2.0));
        let quarter = high / 4.0;
        assert_eq!(gains(&format!("base-gain={quarter}"), &nikon), (quarter, 2.0));
        // Only one gain was measured, so the gain cannot be raised. Users may type its K rounded.
        let mut own = CameraModel::default();
        own.set_gain_range([0.399_7, 0.399_7]).unwrap();
        assert_eq!(gains("shutter=2", &own), (0.399_7, 0.0));
        assert_eq!(gains("gain=0,base-gain=0.4", &own), (0.4, 0.0));
        let error = shot("gain=0,base-gain=0.401", &own, Severity::L1).synthesis(&own).unwrap_err().to_string();
        assert!(error.contains("K is 0.401, but sony-a7s2 has K from 0.3997 to 0.3997"), "{error}");
    }

    #[test]
    fn settings_parse_their_own_text() {
        let written = "shutter=2,gain=4,base-gain=0.375,base-time=1/120";
        assert_eq!(AutoExposure::default().to_string(), written);
        let default_flag = "shutter=2,base-time=1/120";
        assert_eq!(AutoSettings::default().to_string(), default_flag);
        for text in [
            written,
            default_flag,
            "shutter=2,base-gain=1,base-time=1/120",
            "shutter=0,gain=0,base-gain=6,base-time=0.5",
            "shutter=1.5,gain=3,base-gain=0.1,base-time=2.5",
            "shutter=1,gain=1,base-gain=1,base-time=1/3",
        ] {
            let auto: AutoSettings = text.parse().unwrap();
            let reparsed: AutoSettings = auto.to_string().parse().unwrap();
            assert_eq!(reparsed, auto, "{text}");
        }
        for (wrong, part) in [
            ("basegain=1", "did you mean base-gain?"),
            ("shuter=1", "did you mean shutter?"),
            ("shutter=17", "shutter=17: a number from 0 to 16 expected (EV)"),
            ("base-gain=0", "base-gain=0: a number from 0.01 to 100 expected (ADU per electron)"),
            ("base-time=0", "base-time=0: a number of seconds above 0"),
            ("base-time=1/0", "base-time=1/0"),
            ("base-time=11", "up to 10, expected, as 1/120 or 0.01"),
        ] {
            let error = wrong.parse::<AutoSettings>().unwrap_err();
            assert!(error.contains(part), "{wrong}: {error}");
        }
    }
}
