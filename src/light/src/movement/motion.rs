//! How the camera moves during an exposure: [`Motion`].

use std::fmt;
use std::str::FromStr;

use rand::distr::{Distribution as _, Open01};
use serde::{Serialize, Serializer};

use super::streak::Streak;
use crate::draws::{Component, NoiseKey, Site};
use darkqa_ground::error::Result;
use darkqa_ground::types::flags::key_values::{number, pairs};

/// The turn of a camera (`--motion`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Motion {
    /// Angular speed, in degrees per second.
    pub speed: f64,
    /// Horizontal field of view of cameras whose focal length is not known, in degrees.
    pub hfov: f64,
    /// Direction in which the picture moves.
    pub angle: MotionAngle,
}

/// Direction in which a picture moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MotionAngle {
    /// In degrees, from along a row (0, the camera turns to the side) towards down a column (90, it nods).
    Degrees(f64),
    /// Uniform over all directions, drawn for each frame.
    Random,
}

/// A frame as the camera saw it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrameView {
    /// Width of the image, in pixels.
    pub width: usize,
    /// Focal length along a row, in pixels of this image; `None` if the data set does not state it.
    pub focal: Option<f64>,
}

impl Default for Motion {
    /// A robot that turns slowly to the side, with a wide lens; chosen.
    fn default() -> Self {
        Self {
            speed: 30.0,
            hfov: 79.0,
            angle: MotionAngle::Degrees(0.0),
        }
    }
}

impl Motion {
    /// The path of a frame's middle during an exposure of this many seconds: its length is focal length · angular speed · time.
    ///
    /// Exact for a small turn to the side in the middle of the picture; used as an approximation for the whole picture.
    ///
    /// # Errors
    /// If it is longer than 256 pixels.
    pub fn streak(&self, seconds: f64, view: FrameView, key: &NoiseKey) -> Result<Streak> {
        let focal = view
            .focal
            .unwrap_or_else(|| view.width as f64 / 2.0 / libm::tan(self.hfov.to_radians() / 2.0));
        let angle = match self.angle {
            MotionAngle::Degrees(angle) => angle,
            MotionAngle::Random => {
                let mut words = key.stream(Component::Motion).at(Site::new(0, 0));
                let share: f64 = Open01.sample(&mut words);
                180.0 * share
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
        let degrees = text.parse().ok();
        degrees
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
    use darkqa_ground::types::FrameId;

    fn key(seed: u64, frame: &str) -> NoiseKey {
        NoiseKey::new(seed, &FrameId(frame.to_owned()))
    }

    const VIEW: FrameView = FrameView {
        width: 640,
        focal: None,
    };

    fn read(text: &str) -> Motion {
        text.parse().unwrap()
    }

    /// 30 °/s at 79°: 1.69 pixels in 1/120 s and 6.78 pixels in 1/30 s.
    #[test]
    fn the_path_is_focal_length_times_angle() {
        let length = |motion: &str, seconds: f64, view| {
            let streak = read(motion).streak(seconds, view, &key(0, "a"));
            streak.unwrap().length()
        };
        let default = "speed=30";
        assert!((length(default, 1.0 / 120.0, VIEW) - 1.694).abs() < 1e-3);
        assert!((length(default, 1.0 / 30.0, VIEW) - 6.776).abs() < 1e-3);
        assert!(length("speed=0", 1.0, VIEW).abs() < 1e-12);
        // A known focal length counts, and the field of view does not.
        let known = FrameView {
            focal: Some(600.0),
            ..VIEW
        };
        for motion in [default, "hfov=20", "hfov=150"] {
            let expected = 600.0 * 30_f64.to_radians() / 30.0;
            assert!((length(motion, 1.0 / 30.0, known) - expected).abs() < 1e-9);
        }
        assert!(length("hfov=150", 1.0 / 30.0, VIEW) < 2.0);
        let error = read(default).streak(2.0, VIEW, &key(0, "a")).unwrap_err();
        assert!(error.to_string().contains("at most 256"), "{error}");
    }

    #[test]
    fn a_random_direction_is_that_of_its_frame() {
        let angle = |motion: &str, seed, frame: &str| {
            let streak = read(motion).streak(0.01, VIEW, &key(seed, frame));
            streak.unwrap().angle()
        };
        assert!((angle("angle=-30.5", 0, "a") + 30.5).abs() < 1e-12);
        let random = |seed, frame: &str| angle("angle=random", seed, frame);
        assert_eq!(random(0, "a").to_bits(), random(0, "a").to_bits());
        assert!((random(0, "a") - random(0, "b")).abs() > 1e-6);
        assert!((random(0, "a") - random(1, "a")).abs() > 1e-6);
        // Uniform over a half turn: the deviation of the mean of 400 is 2.6°.
        let angles: Vec<f64> = (0..400).map(|i| random(i, "a")).collect();
        assert!(angles.iter().all(|angle| (0.0..180.0).contains(angle)));
        let mean = angles.iter().sum::<f64>() / 400.0;
        assert!((mean - 90.0).abs() < 13.0, "{mean}");
    }

    #[test]
    fn settings_are_written_as_they_are_read() {
        assert_eq!(Motion::default().to_string(), "speed=30,hfov=79,angle=0");
        for text in ["speed=30,hfov=79,angle=0", "speed=0.5,hfov=60,angle=random"] {
            assert_eq!(read(text).to_string(), text);
        }
        assert_eq!(read("angle=90").to_string(), "speed=30,hfov=79,angle=90");
        for (wrong, part) in [
            ("sped=3", "did you mean speed?"),
            (
                "speed=-1",
                "speed=-1: a number from 0 to 10000 expected (degrees per second)",
            ),
            (
                "hfov=0",
                "hfov=0: a number from 1 to 179 expected (degrees)",
            ),
            (
                "angle=up",
                "angle=up: a number of degrees from -360 to 360, or random, expected",
            ),
            ("angle=361", "angle=361"),
        ] {
            let error = wrong.parse::<Motion>().unwrap_err();
            assert!(error.contains(part), "{wrong}: {error}");
        }
    }
}
