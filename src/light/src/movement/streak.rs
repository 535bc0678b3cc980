//! The path of a picture during an exposure, [`Streak`], and the weights with which it is averaged.
//!
//! The camera turns at an even speed, so the middle of the picture moves evenly on a straight line. Each point of the path
//! spreads bilinearly over its four neighbours: a pixel at offset (i, j) has the weight
//! w(i, j) = ∫₀¹ Λ(x(s) − i) · Λ(y(s) − j) ds, with Λ(t) = max(0, 1 − |t|), x(s) = ℓ cos θ (s − ½) and
//! y(s) = ℓ sin θ (s − ½). The weights sum to 1, have the mean 0 and are symmetric, so that neither colours nor edges shift.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use darkqa_ground::error::{Error, Result};

/// Longest path, in pixels; chosen: at a width of 4096 pixels a turn of 30°/s passes the whole ladder of exposure times (174 pixels
/// in 1/7.5 s), and a picture that moves farther shows little but streaks.
pub(super) const LONGEST: f64 = 256.0;

/// Smallest weight that counts, and smallest extent of a path along an axis; smaller values are rounding errors.
const LEAST: f64 = 1e-12;

/// The straight path of a picture's middle during an exposure, centred on the pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Streak {
    /// The length ℓ, in pixels.
    length: f64,
    /// The direction θ in degrees, from along a row towards down a column.
    angle: f64,
}

/// The weight of a neighbour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tap {
    /// Pixels to the right and down.
    pub offset: [isize; 2],
    /// Its weight.
    pub weight: f64,
}

impl Streak {
    /// A picture that stands still.
    pub const STILL: Self = Self {
        length: 0.0,
        angle: 0.0,
    };

    /// A path of this length in pixels, in this direction in degrees.
    ///
    /// # Errors
    /// If the length is not from 0 to 256 pixels, or the direction is not finite.
    pub fn new(length: f64, angle: f64) -> Result<Self> {
        if !(0.0..=LONGEST).contains(&length) {
            let problem = format_args!(
                "the picture would move by {length:.2} pixels during the exposure; at most {LONGEST} are possible: ask for a shorter exposure, or set a lower speed with --motion speed=…"
            );
            return Err(Error::usage("--motion", problem));
        }
        if !angle.is_finite() {
            let problem = format_args!("{angle} is not a direction in degrees");
            return Err(Error::usage("--motion", problem));
        }
        Ok(Self { length, angle })
    }

    /// The length, in pixels.
    #[must_use]
    pub fn length(self) -> f64 {
        self.length
    }

    /// The direction in degrees, from along a row towards down a column.
    #[must_use]
    pub fn angle(self) -> f64 {
        self.angle
    }

    /// Whether the picture stands still.
    #[must_use]
    pub fn is_still(self) -> bool {
        self.length <= 0.0
    }

    /// The weights of the neighbours, in the order of their offsets.
    ///
    /// Between two places where x or y crosses a whole number, the weight is a quadratic of s, for which three Gauss points
    /// are exact.
    #[must_use]
    pub fn taps(self) -> Vec<Tap> {
        let radians = self.angle.to_radians();
        let extent = [libm::cos(radians), libm::sin(radians)].map(|share| share * self.length);
        let mut weights = BTreeMap::<[isize; 2], f64>::new();
        for pair in cuts(extent).windows(2) {
            let [begin, end] = [pair[0], pair[1]];
            for (node, share) in GAUSS {
                let s = f64::midpoint(begin, end) + node * (end - begin) / 2.0 - 0.5;
                spread(extent.map(|extent| extent * s), |offset, weight| {
                    *weights.entry(offset).or_default() += (end - begin) * share * weight;
                });
            }
        }
        weights
            .into_iter()
            .filter(|(_, weight)| *weight > LEAST)
            .map(|(offset, weight)| Tap { offset, weight })
            .collect()
    }
}

/// Nodes in (−1, 1) and weights of Gauss and Legendre's rule with three points: ±√(3/5) and 0, with 5/18 and 8/18.
const GAUSS: [(f64, f64); 3] = [
    (-0.774_596_669_241_483_4, 5.0 / 18.0),
    (0.0, 8.0 / 18.0),
    (0.774_596_669_241_483_4, 5.0 / 18.0),
];

/// The shares of the path at which x or y is a whole number, with both ends, in ascending order.
fn cuts(extent: [f64; 2]) -> Vec<f64> {
    let mut cuts = vec![0.0, 1.0];
    for extent in extent.into_iter().filter(|extent| extent.abs() > LEAST) {
        let reach = (extent.abs() / 2.0).floor() as i32;
        let crossings = (-reach..=reach).map(|whole| f64::from(whole) / extent + 0.5);
        cuts.extend(crossings.map(|share| share.clamp(0.0, 1.0)));
    }
    cuts.sort_by(f64::total_cmp);
    cuts.dedup();
    cuts
}

/// Calls `add` with the offsets and the weights of the four pixels around a point.
fn spread([x, y]: [f64; 2], mut add: impl FnMut([isize; 2], f64)) {
    let (column, row) = (x.floor(), y.floor());
    for (right, across) in [(0, 1.0 - (x - column)), (1, x - column)] {
        for (down, along) in [(0, 1.0 - (y - row)), (1, y - row)] {
            add(
                [column as isize + right, row as isize + down],
                across * along,
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taps(length: f64, angle: f64) -> BTreeMap<[isize; 2], f64> {
        Streak::new(length, angle)
            .unwrap()
            .taps()
            .into_iter()
            .map(|tap| (tap.offset, tap.weight))
            .collect()
    }

    /// Lengths and directions of every sort: short and long, along the axes, between them, and beyond a quarter turn.
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

    /// Weights along a row, from the integral by hand.
    #[test]
    fn weights_along_a_row_are_exact() {
        let cases: [(f64, &[f64]); 4] = [
            (0.0, &[1.0]),
            (1.0, &[0.125, 0.75, 0.125]),
            (2.5, &[0.0125, 0.2875, 0.4, 0.2875, 0.0125]),
            (4.0, &[0.125, 0.25, 0.25, 0.25, 0.125]),
        ];
        for (length, expected) in cases {
            for (angle, place) in [(0.0, 0), (90.0, 1), (180.0, 0)] {
                let found = taps(length, angle);
                assert_eq!(
                    found.len(),
                    expected.len(),
                    "{length} at {angle}: {found:?}"
                );
                let first = -(expected.len().cast_signed() / 2);
                for (at, expected) in (first..).zip(expected) {
                    let mut offset = [0; 2];
                    offset[place] = at;
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
        for (offset, expected) in [
            ([-2, -1], 0.141302),
            ([-1, -1], 0.120435),
            ([-3, -2], 0.004609),
        ] {
            let off: f64 = found[&offset] - expected;
            assert!(off.abs() < 1e-6, "{offset:?}: {off}");
        }
    }

    #[test]
    fn weights_sum_to_one_about_the_middle() {
        for (length, angle) in PATHS {
            let found = taps(length, angle);
            let moment = |of: fn(&[isize; 2]) -> f64| -> f64 {
                found
                    .iter()
                    .map(|(offset, weight)| weight * of(offset))
                    .sum()
            };
            assert!((moment(|_| 1.0) - 1.0).abs() < 1e-10, "{length} at {angle}");
            assert!(moment(|[x, _]| *x as f64).abs() < 1e-9);
            assert!(moment(|[_, y]| *y as f64).abs() < 1e-9);
            for ([x, y], weight) in &found {
                let mirrored = found.get(&[-x, -y]).copied().unwrap_or_default();
                assert!((weight - mirrored).abs() < 1e-10, "{length} at {angle}");
            }
        }
    }

    /// The integral in small steps, which knows nothing of pieces or of Gauss points.
    #[test]
    fn weights_are_the_integral() {
        const STEPS: usize = 100_000;
        for (length, angle) in PATHS {
            let mut sums = BTreeMap::<[isize; 2], f64>::new();
            let radians = angle.to_radians();
            for step in 0..STEPS {
                let along = length * ((step as f64 + 0.5) / STEPS as f64 - 0.5);
                spread(
                    [radians.cos() * along, radians.sin() * along],
                    |at, weight| {
                        *sums.entry(at).or_default() += weight / STEPS as f64;
                    },
                );
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
            (
                256.01,
                0.0,
                "256.01 pixels during the exposure; at most 256",
            ),
            (-1.0, 0.0, "at most 256"),
            (f64::NAN, 0.0, "at most 256"),
            (1.0, f64::INFINITY, "not a direction"),
        ] {
            let error = Streak::new(length, angle).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}
