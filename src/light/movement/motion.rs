//! Rotation of the camera during an exposure: [`Motion`].

use std::fmt;
use std::str::FromStr;

use rand::distr::{Distribution as _, Open01};
use serde::{Serialize, Serializer};

use super::streak::Streak;
use crate::draws::{Component, NoiseKey, Site};
use darkqa_base::error::Result;
use darkqa_base::types::flags::key_values::{number, pairs};

/// Rotation of the camera (`--motion`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Motion {
    /// Angular speed, in degrees per second.
    pub speed: f64,
    /// Horizontal field of view for frames of unknown focal length, in degrees.
    pub hfov: f64,
    /// Direction in which the image moves on the sensor.
    pub angle: MotionAngle,
}

/// Direction in which an image moves on the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MotionAngle {
    /// In degrees: 0 is along a row (the camera pans), 90 is down a column (the camera tilts).
    Degrees(f64),
    /// Random for each frame, uniform between 0° and 180°.
    Random,
}

/// Width and focal length of a frame, which determine its motion blur.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrameView {
    /// Width of the image, in pixels.
    pub width: usize,
    /// Horizontal focal length, in pixels of this image; `None` if unknown.
    pub focal: Option<f64>,
}

impl Default for Motion {
    /// Slow pan of a robot with a wide-angle lens; chosen.
    fn default() -> Self {
        Self { speed: 30.0, hfov: 79.0, angle: MotionAngle::Degrees(0.0) }
    }
}

impl Motion {
    /// Streak of the centre of a frame during an exposure. Its length in pixels is focal length · angular speed ·
    /// `seconds`.
    ///
    /// This is the small-angle limit at the centre of the image, and an approximation elsewhere.
    ///
    /// # Errors
    /// If the streak is longer than 256 pixels.
    pub fn streak(&self, seconds: f64, view: FrameView, key: &NoiseKey) -> Result<Streak> {
        let focal = view.focal.unwrap_or_else(|| view.width as f64 / 2.0 / libm::tan(self.hfov.to_radians() / 2.0));
        let angle = match self.angle {
            MotionAngle::Degrees(angle) => angle,
            MotionAngle::Random => {
                let mut random = key.stream(Component::Motion).at(Site::new(0, 0));
                let fraction: f64 = Open01.sample(&mut random);
                180.0 * fraction
            }
        };
        Streak::new(focal * self.speed.to_radians() * seconds, angle)
    }
}

impl FromStr for Motion {
    type Err = String;

    /// Parses `speed=30,hfov=79,angle=0`; missing keys keep their defaults.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut motion = Self::default();
        for (key, value) in pairs(text, &["speed", "hfov", "angle"])? {
            match key {
                "speed" => {
                    motion.speed = number(key, value, "degrees per second", 0.0..=10_000.0)?;
                }
                "hfov" => motion.hfov = number(key, value, "degrees", 1.0..=179.0)?,
                _ => motion.angle = value.parse().map_err(|e| format!("angle={value}: {e}"))?,
            }
        }
        Ok(motion)
    }
}

impl fmt::Display for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { speed, hfov, angle } = self;
        write!(f, "speed={speed},hfov={hfov},angle={angle}")
    }
}

impl FromStr for MotionAngle {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "random" {
            return Ok(Self::Random);
        }
        text.parse()
            .ok()
            .filter(|degrees: &f64| degrees.abs() <= 360.0)
            .map(Self::Degrees)
            .ok_or_else(|| "a number of degrees from -360 to 360, or random, expected".to_owned())
    }
}

impl fmt::Display for MotionAngle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Degrees(degrees) => degrees.fmt(f),
            Self::Random => f.write_str("random"),
        }
    }
}

impl Serialize for MotionAngle {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        match self {
            Self::Degrees(degrees) => serializer.serialize_f64(*degrees),
            Self::Random => serializer.serialize_str("random"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::FrameId;

    fn key(seed: u64, frame: &str) -> NoiseKey {
        NoiseKey::new(seed, &FrameId(frame.to_owned()))
    }

    const VIEW: FrameView = FrameView { width: 640, focal: None };

    fn parse(text: &str) -> Motion {
        text.parse().unwrap()
    }

    fn length(motion: &str, seconds: f64, view: FrameView) -> f64 {
        parse(motion).streak(seconds, view, &key(0, "a")).unwrap().length()
    }

    fn random_angle(seed: u64, frame: &str) -> f64 {
        parse("angle=random").streak(0.01, VIEW, &key(seed, frame)).unwrap().angle()
    }

    /// At 30 °/s and a 79° field of view, a streak in a 640-pixel-wide image is 1.69 pixels long after 1/120 s and 6.78
    /// after 1/30 s.
    #[test]
    fn streak_length_is_focal_length_times_angle() {
        let default = "speed=30";
        assert!((length(default, 1.0 / 120.0, VIEW) - 1.694).abs() < 1e-3);
        assert!((length(default, 1.0 / 30.0, VIEW) - 6.776).abs() < 1e-3);
        assert!(length("speed=0", 1.0, VIEW).abs() < 1e-12);
        // With a known focal length, the field of view has no effect.
        let known = FrameView { focal: Some(600.0), ..VIEW };
        for motion in [default, "hfov=20", "hfov=150"] {
            let expected = 600.0 * 30_f64.to_radians() / 30.0;
            assert!((length(motion, 1.0 / 30.0, known) - expected).abs() < 1e-9);
        }
        assert!(length("hfov=150", 1.0 / 30.0, VIEW) < 2.0);
        let error = parse(default).streak(2.0, VIEW, &key(0, "a")).unwrap_err();
        assert!(error.to_string().contains("at most 256"), "{error}");
    }

    #[test]
    fn a_random_direction_depends_on_seed_and_frame() {
        let fixed = parse("angle=-30.5").streak(0.01, VIEW, &key(0, "a")).unwrap();
        assert!((fixed.angle() + 30.5).abs() < 1e-12);
        assert_eq!(random_angle(0, "a").to_bits(), random_angle(0, "a").to_bits());
        assert!((random_angle(0, "a") - random_angle(0, "b")).abs() > 1e-6);
        assert!((random_angle(0, "a") - random_angle(1, "a")).abs() > 1e-6);
        // Uniform over a half turn: the standard error of the mean of 400 angles is 2.6°.
        let angles: Vec<f64> = (0..400).map(|i| random_angle(i, "a")).collect();
        assert!(angles.iter().all(|angle| (0.0..180.0).contains(angle)));
        let mean = angles.iter().sum::<f64>() / 400.0;
        assert!((mean - 90.0).abs() < 13.0, "{mean}");
    }

    #[test]
    fn settings_round_trip_through_text() {
        assert_eq!(Motion::default().to_string(), "speed=30,hfov=79,angle=0");
        for text in ["speed=30,hfov=79,angle=0", "speed=0.5,hfov=60,angle=random"] {
            assert_eq!(parse(text).to_string(), text);
        }
        assert_eq!(parse("angle=90").to_string(), "speed=30,hfov=79,angle=90");
        for (wrong, part) in [
            ("sped=3", "did you mean speed?"),
            ("speed=-1", "speed=-1: a number from 0 to 10000 expected (degrees per second)"),
            ("hfov=0", "hfov=0: a number from 1 to 179 expected (degrees)"),
            ("angle=up", "angle=up: a number of degrees from -360 to 360, or random, expected"),
            ("angle=361", "angle=361"),
        ] {
            let error = wrong.parse::<Motion>().unwrap_err();
            assert!(error.contains(part), "{wrong}: {error}");
        }
    }
}
