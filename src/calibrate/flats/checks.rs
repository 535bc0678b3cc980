//! Checks of pairs of flats.

use super::super::checks::correlation;
use super::super::inputs::same_frame;
use super::super::sums::Tile;
use crate::error::{Error, Result};

/// Largest share of samples of a plane at its greatest code (chosen).
const AT_TOP: f64 = 1e-3;
/// Differences of light between the frames of a pair, as shares: above the first a note, above the second they are no pair (chosen).
const LIGHT: [f64; 2] = [0.01, 0.05];

/// Least share of the tiles of an exposure in the range of light; an exposure with fewer is left out (chosen).
const LEAST_IN_RANGE: f64 = 0.25;

/// What a pair of flats gives.
#[derive(Debug)]
pub(super) struct PairFacts {
    /// Names of the two files.
    pub(super) names: [String; 2],
    /// Largest share of samples of a plane at its greatest code.
    pub(super) top: f64,
    /// Means of both frames, in ADU.
    pub(super) means: [f64; 2],
    /// Correlation of neighbours in the difference.
    pub(super) correlation: f64,
    pub(super) tiles: Vec<Tile>,
    /// Whether the two files are copies.
    pub(super) are_equal: bool,
}

/// The pairs of an exposure, to be checked.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExposureCheck<'a> {
    pub(super) name: &'a str,
    pub(super) facts: &'a [PairFacts],
    /// Mean offset of the planes in ADU.
    pub(super) offset: f64,
}

impl ExposureCheck<'_> {
    /// Why the exposure is overexposed; `None` if it is not.
    pub(super) fn clipped(&self) -> Option<String> {
        let top = self.facts.iter().map(|pair| pair.top).fold(0.0, f64::max);
        (top > AT_TOP).then(|| {
            format!(
                "exposure {}: {:.1} % of a colour are at its greatest code, clipped",
                self.name,
                100.0 * top
            )
        })
    }

    /// Notes on pairs whose light differs a little.
    ///
    /// # Errors
    /// If the two of a pair are copies or differ much in light, or neighbours correlate.
    pub(super) fn pairs(&self) -> Result<Vec<String>> {
        let mut notes = Vec::new();
        for pair in self.facts {
            let [a, b] = pair.means.map(|mean| mean - self.offset);
            let ratio = b / a - 1.0;
            let [first, second] = &pair.names;
            if pair.are_equal {
                return Err(Error::data(second, same_frame(first)));
            }
            let percent = 100.0 * ratio;
            if a > 0.0 && ratio.abs() > LIGHT[1] {
                return Err(Error::data(
                    first,
                    format_args!(
                        "no pair with {second}: it has {percent:+.1} % of light, and the two of a pair must have the same (limit {} %); were exposures mixed, or does the lamp flicker?",
                        100.0 * LIGHT[1]
                    ),
                ));
            }
            if a > 0.0 && ratio.abs() > LIGHT[0] {
                notes.push(format!(
                    "{first} and {second}: a pair that differs by {percent:+.1} % in light; K is too large by up to half of that"
                ));
            }
            correlation(pair.correlation).map_err(|problem| Error::data(first, problem))?;
        }
        Ok(notes)
    }

    /// Why too few tiles of the exposure are in the range of light; `None` if enough are.
    pub(super) fn out_of_range(&self, used: &[Vec<Tile>], range: [f64; 2]) -> Option<String> {
        let all: usize = self.facts.iter().map(|pair| pair.tiles.len()).sum();
        let used: usize = used.iter().map(Vec::len).sum();
        let share = used as f64 / all.max(1) as f64;
        (share < LEAST_IN_RANGE).then(|| {
            let means = self.facts.iter().flat_map(|pair| pair.means);
            let mean = means.sum::<f64>() / (2 * self.facts.len()) as f64 - self.offset;
            let [low, high] = range.map(|share| 100.0 * share);
            format!(
                "exposure {}: {mean:.0} ADU of light are outside of {low} to {high} % of white",
                self.name
            )
        })
    }
}
