//! An exposure drop as a camera with automatic exposure meets it: [`AutoExposure`] and its answer, [`AutoShot`].
//!
//! The scene is ΔEV darker. The camera opens its shutter s stops longer, adds g stops of gain, and leaves d = ΔEV − s − g dark. So the
//! photons fall by 2^−(ΔEV − s), the picture by 2^−d, and the longer exposure blurs it if the camera turns. The sensor adds the noise of
//! the noise profile `physical` at the drop d, with the gain K = K₀ · 2^g and the ratio r = 2^d. The shot noise of a sample y then has the
//! relative variance K · r / y = K₀ · 2^(ΔEV − s) / y, however the rest is divided between gain and darkness.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use super::camera::CameraModel;
use super::camera::calibration::GAINS;
use super::noise_profile::{NoiseProfile, Synthesis};
use darkqa_ground::error::{Error, Result};
use darkqa_ground::types::Severity;
use darkqa_ground::types::flags::key_values::{number, pairs};

/// How automatic exposure answers less light.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct AutoExposure {
    /// Most stops of longer exposure, in EV.
    pub shutter: f64,
    /// Most stops of gain, in EV.
    pub gain: f64,
    /// System gain K₀ without a drop, in ADU per electron.
    pub base_gain: f64,
    /// Exposure time without a drop, in seconds.
    pub base_time: f64,
}

/// Most stops of gain by default, where noise reduction would take over; chosen.
const MOST_GAIN: f64 = 4.0;

/// The settings as the user writes them (`--auto`). Gain settings that are not given follow from the camera.
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
        Self {
            shutter: 2.0,
            gain: None,
            base_gain: None,
            base_time: 1.0 / 120.0,
        }
    }
}

impl AutoSettings {
    /// The settings for a camera. If the gain is not given, it ends at the camera's greatest K, [`MOST_GAIN`] stops above K₀ if the
    /// camera's range is that large.
    #[must_use]
    pub fn for_camera(&self, camera: &CameraModel) -> AutoExposure {
        let [low, high] = camera.gain_range();
        let base_gain = self
            .base_gain
            .unwrap_or_else(|| low.max(high / libm::exp2(MOST_GAIN)));
        let most = || libm::log2(high / base_gain).clamp(0.0, MOST_GAIN);
        AutoExposure {
            shutter: self.shutter,
            gain: self.gain.unwrap_or_else(most),
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

/// The answer of automatic exposure to one exposure drop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AutoShot {
    /// Stops of longer exposure, in EV.
    pub shutter: f64,
    /// Stops of gain, in EV.
    pub gain: f64,
    /// Darkness that the exposure does not compensate, in EV.
    pub dark: f64,
    /// Exposure time, in seconds.
    pub time: f64,
    /// System gain K, in ADU per electron.
    pub system_gain: f64,
}

impl AutoExposure {
    /// The answer to an exposure drop.
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

/// How far K may be outside the range of the camera, as a share: a measured K has an error of 0.1 to 0.2 % (`calibrate`), and who types
/// it rounds it.
const GAIN_ERROR: f64 = 2e-3;

impl AutoShot {
    /// The sensor branch for this shot: physical, with the gain K of the shot.
    ///
    /// # Errors
    /// If the camera has no such gain.
    pub fn synthesis(&self, camera: &CameraModel) -> Result<Synthesis> {
        let [low, high] = camera.gain_range();
        let gain = self.system_gain;
        if gain < low * (1.0 - GAIN_ERROR) || gain > high * (1.0 + GAIN_ERROR) {
            let rounded = |gain: f64| (gain * 1e4).round() / 1e4;
            let problem = format_args!(
                "at {} stops of gain, K is {}, but {} has K from {} to {}; set another base-gain or fewer stops of gain",
                self.gain,
                rounded(gain),
                camera.name(),
                rounded(low),
                rounded(high)
            );
            return Err(Error::usage("--auto", problem));
        }
        let mut camera = camera.unpinned();
        camera.pin_gain(gain)?;
        Ok(Synthesis::new(NoiseProfile::Physical, camera))
    }
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

/// Longest exposure without a drop, in seconds; chosen.
const LONGEST: f64 = 10.0;

/// Reads a time in seconds, as `1/120` or `0.01`.
fn seconds(value: &str) -> Result<f64, String> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let seconds = match value.split_once('/') {
        None => number(value),
        Some((above, below)) => number(above)
            .zip(number(below))
            .map(|(above, below)| above / below),
    };
    seconds.filter(|seconds| *seconds > 0.0 && *seconds <= LONGEST).ok_or_else(|| {
        format!("base-time={value}: a number of seconds above 0, up to {LONGEST}, expected, as 1/120 or 0.01")
    })
}

impl fmt::Display for AutoSettings {
    /// Writes the given settings in the form that is parsed.
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
        let named = AutoSettings {
            shutter: self.shutter,
            gain: Some(self.gain),
            base_gain: Some(self.base_gain),
            base_time: self.base_time,
        };
        named.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let found = [
                shot.shutter,
                shot.gain,
                shot.dark,
                shot.time,
                shot.system_gain,
            ];
            for (found, expected) in found.iter().zip([shutter, gain, dark, time, system_gain]) {
                assert!((found - expected).abs() < 1e-12, "{drop}: {shot:?}");
            }
        }
    }

    #[test]
    fn a_gain_that_the_camera_lacks_is_refused() {
        let camera = CameraModel::default();
        let settings = |auto: &str| auto.parse::<AutoSettings>().unwrap();
        let shot = |auto: &str, drop| settings(auto).for_camera(&camera).shot(drop);
        let most = shot("gain=4", Severity::L3).synthesis(&camera).unwrap();
        assert_eq!(most.name().as_str(), "physical");
        for auto in [
            "gain=4.01",
            "gain=4,base-gain=0.38",
            "gain=0,base-gain=0.09",
        ] {
            let error = shot(auto, Severity::L5).synthesis(&camera).unwrap_err();
            let error = error.to_string();
            assert!(
                error.starts_with("--auto: at ") && error.contains("sony-a7s2 has K from 0.1 to 6"),
                "{error}"
            );
        }
        // At L2 only two stops are taken, so that nothing is beyond the camera.
        shot("gain=5", Severity::L2).synthesis(&camera).unwrap();
    }

    #[test]
    fn the_gain_follows_from_the_camera() {
        let of = |auto: &str, camera: &CameraModel| {
            let settings: AutoSettings = auto.parse().unwrap();
            let auto = settings.for_camera(camera);
            // Whatever the camera, no level is refused.
            for drop in [Severity::L1, Severity::L3, Severity::L5] {
                auto.shot(drop).synthesis(camera).unwrap();
            }
            (auto.base_gain, auto.gain)
        };
        let nikon = CameraModel::preset("nikon-d850").unwrap();
        let [_, high] = nikon.gain_range();
        assert_eq!(of("shutter=2", &nikon), (high / 16.0, 4.0));
        assert_eq!(of("gain=2", &nikon), (high / 16.0, 2.0));
        let quarter = high / 4.0;
        assert_eq!(of(&format!("base-gain={quarter}"), &nikon), (quarter, 2.0));
        // One setting was measured: there is no gain to raise. Its K is typed with the digits of a table.
        let mut own = CameraModel::default();
        own.set_gain_range([0.399_7, 0.399_7]).unwrap();
        assert_eq!(of("shutter=2", &own), (0.399_7, 0.0));
        assert_eq!(of("gain=0,base-gain=0.4", &own), (0.4, 0.0));
        let shot = "gain=0,base-gain=0.401".parse::<AutoSettings>().unwrap();
        let shot = shot.for_camera(&own).shot(Severity::L1);
        let error = shot.synthesis(&own).unwrap_err().to_string();
        assert!(
            error.contains("K is 0.401, but sony-a7s2 has K from 0.3997 to 0.3997"),
            "{error}"
        );
    }

    #[test]
    fn settings_are_written_as_they_are_read() {
        let written = "shutter=2,gain=4,base-gain=0.375,base-time=1/120";
        assert_eq!(AutoExposure::default().to_string(), written);
        let of_flag = "shutter=2,base-time=1/120";
        assert_eq!(AutoSettings::default().to_string(), of_flag);
        for text in [
            written,
            of_flag,
            "shutter=2,base-gain=1,base-time=1/120",
            "shutter=0,gain=0,base-gain=6,base-time=0.5",
            "shutter=1.5,gain=3,base-gain=0.1,base-time=2.5",
            "shutter=1,gain=1,base-gain=1,base-time=1/3",
        ] {
            let auto: AutoSettings = text.parse().unwrap();
            let again: AutoSettings = auto.to_string().parse().unwrap();
            assert_eq!(again, auto, "{text}");
        }
        for (wrong, part) in [
            ("basegain=1", "did you mean base-gain?"),
            ("shuter=1", "did you mean shutter?"),
            (
                "shutter=17",
                "shutter=17: a number from 0 to 16 expected (EV)",
            ),
            (
                "base-gain=0",
                "base-gain=0: a number from 0.01 to 100 expected (ADU per electron)",
            ),
            ("base-time=0", "base-time=0: a number of seconds above 0"),
            ("base-time=1/0", "base-time=1/0"),
            ("base-time=11", "up to 10, expected, as 1/120 or 0.01"),
        ] {
            let error = wrong.parse::<AutoSettings>().unwrap_err();
            assert!(error.contains(part), "{wrong}: {error}");
        }
    }
}
