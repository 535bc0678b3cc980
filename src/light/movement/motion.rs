//! Rotation of the camera during an exposure: [`Motion`].
//!
//! Path of an image on the sensor during an exposure ([`Streak`]), and the weights of its motion blur ([`Tap`]).
//!
//! The camera turns at constant speed, so that the centre of the image moves uniformly on a straight line. Each point
//! of the path is distributed bilinearly over its four neighbours: a pixel at offset (i, j) has the weight w(i, j) =
//! ∫₀¹ Λ(x(s) − i) · Λ(y(s) − j) ds, with Λ(t) = max(0, 1 − |t|), x(s) = ℓ cos θ (s − ½) and y(s) = ℓ sin θ (s − ½).
//! The weights sum to 1, have the mean 0 and are symmetric, so that neither colours nor edges shift.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use rand::distr::{Distribution as _, Open01};
use serde::{Deserialize, Serialize, Serializer};

use crate::draws::{Component, NoiseKey, Site};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::flags::{number, pairs};

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

/// Maximum length of a path, in pixels; chosen. At a width of 4096 pixels, a rotation of 30°/s stays below it at all
/// exposure times of the ladder (174 pixels in 1/7.5 s), and images with longer paths show only streaks.
const MAX_LENGTH: f64 = 256.0;

/// Smaller weights and extents of a path along an axis are rounding errors and ignored.
const NEGLIGIBLE: f64 = 1e-12;

/// Straight path of the image centre during an exposure, centred on its pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Streak {
    /// Length ℓ, in pixels.
    length: f64,
    /// Direction θ in degrees: 0 is along a row, 90 is down a column.
    angle: f64,
}

/// Weight of a neighbouring pixel in a weighted mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tap {
    /// Offset to the right and down, in pixels.
    pub offset: [isize; 2],
    /// Weight; all weights of a path sum to 1.
    pub weight: f64,
}

impl Streak {
    /// The path without motion.
    pub const STILL: Self = Self { length: 0.0, angle: 0.0 };

    /// A path of this length in pixels, in this direction in degrees.
    ///
    /// # Errors
    /// If the length is not from 0 to 256 pixels, or the direction is not finite.
    pub fn new(length: f64, angle: f64) -> Result<Self> {
        if !(0.0..=MAX_LENGTH).contains(&length) {
            let problem = format_args!(
                "the picture would move by {length:.2} pixels during the exposure; at most {MAX_LENGTH} are possible: ask for a shorter exposure, or set a lower speed with --motion speed=…"
            );
            return Err(Error::usage("--motion", problem));
        }
        if !angle.is_finite() {
            let problem = format_args!("{angle} is not a direction in degrees");
            return Err(Error::usage("--motion", problem));
        }
        Ok(Self { length, angle })
    }

    /// Length, in pixels.
    #[must_use]
    pub fn length(self) -> f64 {
        self.length
    }

    /// Direction in degrees: 0 is along a row, 90 is down a column.
    #[must_use]
    pub fn angle(self) -> f64 {
        self.angle
    }

    /// True for a path without motion.
    #[must_use]
    pub fn is_still(self) -> bool {
        self.length <= 0.0
    }

    /// The weights of the neighbours, in the order of their offsets.
    ///
    /// Between two points where x or y is a whole number, the weight is a quadratic polynomial of s, for which three
    /// Gauss points are exact.
    #[must_use]
    pub fn taps(self) -> Vec<Tap> {
        let radians = self.angle.to_radians();
        let extent = [libm::cos(radians), libm::sin(radians)].map(|part| part * self.length);
        let mut weights = BTreeMap::<[isize; 2], f64>::new();
        for pair in breakpoints(extent).windows(2) {
            let [begin, end] = [pair[0], pair[1]];
            for (node, gauss_weight) in GAUSS {
                let s = f64::midpoint(begin, end) + node * (end - begin) / 2.0 - 0.5;
                distribute_bilinearly(extent.map(|extent| extent * s), |offset, weight| {
                    *weights.entry(offset).or_default() += (end - begin) * gauss_weight * weight;
                });
            }
        }
        weights
            .into_iter()
            .filter(|(_, weight)| *weight > NEGLIGIBLE)
            .map(|(offset, weight)| Tap { offset, weight })
            .collect()
    }
}

/// Nodes in (−1, 1) and weights of the Gauss–Legendre rule with three points: ±√(3/5) and 0, with 5/18 and 8/18.
const GAUSS: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 18.0), (0.0, 8.0 / 18.0), (0.774_596_669_241_483_4, 5.0 / 18.0)];

/// The values of s at which x or y is a whole number, and both ends 0 and 1, in ascending order.
fn breakpoints(extent: [f64; 2]) -> Vec<f64> {
    let mut breakpoints = vec![0.0, 1.0];
    for extent in extent.into_iter().filter(|extent| extent.abs() > NEGLIGIBLE) {
        let reach = (extent.abs() / 2.0).floor() as i32;
        breakpoints.extend((-reach..=reach).map(|whole| f64::from(whole) / extent + 0.5).map(|s| s.clamp(0.0, 1.0)));
    }
    breakpoints.sort_by(f64::total_cmp);
    breakpoints.dedup();
    breakpoints
}

/// Calls `add` with the offset and the bilinear weight of each of the four pixels around a point.
fn distribute_bilinearly([x, y]: [f64; 2], mut add: impl FnMut([isize; 2], f64)) {
    let (column, row) = (x.floor(), y.floor());
    for (right, across) in [(0, 1.0 - (x - column)), (1, x - column)] {
        for (down, along) in [(0, 1.0 - (y - row)), (1, y - row)] {
            add([column as isize + right, row as isize + down], across * along);
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

    fn taps(length: f64, angle: f64) -> BTreeMap<[isize; 2], f64> {
        Streak::new(length, angle).unwrap().taps().into_iter().map(|tap| (tap.offset, tap.weight)).collect()
    }

    /// Lengths and directions: short and long, along the axes, between them, and beyond a quarter turn.
    const PATHS: [(f64, f64); 10] = [
        (0.0, 0.0),
        (0.3, 20.0),
        (1.0, 0.0),
        (2.5, 90.0),
        (5.5, 30.0),
        (8.0, 45.0),
        (16.0, 137.0),
        (33.3, 179.9),
        (63.9, -60.0),
        (64.0, 5.0),
    ];

    /// Expected weights were integrated by hand.
    #[test]
    fn weights_along_a_row_are_exact() {
        let cases: [(f64, &[f64]); 4] = [
            (0.0, &[1.0]),
            (1.0, &[0.125, 0.75, 0.125]),
            (2.5, &[0.0125, 0.2875, 0.4, 0.2875, 0.0125]),
            (4.0, &[0.125, 0.25, 0.25, 0.25, 0.125]),
        ];
        for (length, expected) in cases {
            for (angle, axis) in [(0.0, 0), (90.0, 1), (180.0, 0)] {
                let found = taps(length, angle);
                assert_eq!(found.len(), expected.len(), "{length} at {angle}: {found:?}");
                let first = -(expected.len().cast_signed() / 2);
                for (at, expected) in (first..).zip(expected) {
                    let mut offset = [0; 2];
                    offset[axis] = at;
                    let off = found[&offset] - expected;
                    assert!(off.abs() < 1e-12, "{length} at {angle}, {at}: {off}");
                }
            }
        }
    }

    #[test]
    fn weights_of_a_slanted_path_are_exact() {
        let found = taps(5.5, 30.0);
        assert_eq!(found.len(), 19);
        for (offset, expected) in [([-2, -1], 0.141302), ([-1, -1], 0.120435), ([-3, -2], 0.004609)] {
            let off: f64 = found[&offset] - expected;
            assert!(off.abs() < 1e-6, "{offset:?}: {off}");
        }
    }

    #[test]
    fn weights_sum_to_one_and_are_symmetric() {
        for (length, angle) in PATHS {
            let found = taps(length, angle);
            let (mut sum, mut mean) = (0.0, [0.0; 2]);
            for ([x, y], weight) in &found {
                sum += weight;
                mean[0] += weight * *x as f64;
                mean[1] += weight * *y as f64;
            }
            assert!((sum - 1.0).abs() < 1e-10, "{length} at {angle}");
            assert!(mean[0].abs() < 1e-9 && mean[1].abs() < 1e-9);
            for ([x, y], weight) in &found {
                let mirrored = found.get(&[-x, -y]).copied().unwrap_or_default();
                assert!((weight - mirrored).abs() < 1e-10, "{length} at {angle}");
            }
        }
    }

    /// Independent integration in small steps.
    #[test]
    fn weights_equal_the_integral() {
        const STEPS: usize = 100_000;
        for (length, angle) in PATHS {
            let mut sums = BTreeMap::<[isize; 2], f64>::new();
            let radians = angle.to_radians();
            for step in 0..STEPS {
                let along = length * ((step as f64 + 0.5) / STEPS as f64 - 0.5);
                distribute_bilinearly([radians.cos() * along, radians.sin() * along], |at, weight| {
                    *sums.entry(at).or_default() += weight / STEPS as f64;
                });
            }
            let found = taps(length, angle);
            for (offset, expected) in sums {
                let weight = found.get(&offset).copied().unwrap_or_default();
                assert!((weight - expected).abs() < 1e-7, "{length} at {angle}");
            }
        }
    }

    #[test]
    fn an_impossible_path_is_refused() {
        for (length, angle, part) in [
            (256.01, 0.0, "256.01 pixels during the exposure; at most 256"),
            (-1.0, 0.0, "at most 256"),
            (f64::NAN, 0.0, "at most 256"),
            (1.0, f64::INFINITY, "not a direction"),
        ] {
            let error = Streak::new(length, angle).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}
