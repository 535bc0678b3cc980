//! Path of an image on the sensor during an exposure ([`Streak`]), and the weights of its motion blur ([`Tap`]).
//!
//! The camera turns at constant speed, so that the centre of the image moves uniformly on a straight line. Each point
//! of the path is distributed bilinearly over its four neighbours: a pixel at offset (i, j) has the weight w(i, j) =
//! ∫₀¹ Λ(x(s) − i) · Λ(y(s) − j) ds, with Λ(t) = max(0, 1 − |t|), x(s) = ℓ cos θ (s − ½) and y(s) = ℓ sin θ (s − ½).
//! The weights sum to 1, have the mean 0 and are symmetric, so that neither colours nor edges shift.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use darkqa_base::error::{Error, Result};

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
