//! Checks of pairs of flats.

use super::super::checks::correlation;
use super::super::sums::{NeighbourSums, TileSums};
use crate::error::{Error, Result};
use crate::types::Digest;

/// Maximum share of the samples of a plane at its maximum code (chosen).
const MAX_AT_TOP: f64 = 1e-3;
/// Share of white below which clipping is suspicious (chosen).
const MIN_CLIPPING: f64 = 0.9;
/// Minimum share of white that the maximum code of the flats should reach (chosen: users are asked for flats up to 60
/// %).
const MIN_REACH: f64 = 0.25;
/// Relative differences of light between the frames of a pair: a note above the first, an error above the second
/// (chosen).
const LIGHT: [f64; 2] = [0.01, 0.05];

/// Minimum share of the tiles of an exposure in the range of light; exposures with fewer are left out (chosen).
const MIN_IN_RANGE: f64 = 0.25;

/// Results of a pair of flats.
#[derive(Debug)]
pub(super) struct PairFacts {
    /// Names of the two files.
    pub(super) names: [String; 2],
    /// Digests of the two files.
    pub(super) digests: [Digest; 2],
    /// Maximum code of both frames.
    pub(super) greatest: u16,
    /// Largest share of the samples of a plane at its maximum code, and this code.
    pub(super) at_top: (f64, u16),
    /// Means of both frames, in ADU.
    pub(super) means: [f64; 2],
    pub(super) neighbours: NeighbourSums,
    pub(super) tiles: Vec<TileSums>,
}

/// Checks of the pairs of an exposure.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExposureCheck<'a> {
    pub(super) name: &'a str,
    pub(super) facts: &'a [PairFacts],
    /// Offsets of the planes in ADU.
    pub(super) offsets: &'a [f64],
    /// Code of white.
    pub(super) white: u16,
}

/// An overexposed exposure.
#[derive(Debug)]
pub(super) struct Clipped {
    /// Reason for leaving it out.
    pub(super) reason: String,
    /// Warning about the code of white, if the exposure is clipped far below it.
    pub(super) doubt: Option<String>,
}

impl PairFacts {
    /// Names and digests of both files.
    pub(super) fn files(&self) -> [(&str, Digest); 2] {
        [0, 1].map(|frame| (&*self.names[frame], self.digests[frame]))
    }

    /// Ratio of the light of the first frame to that of the second, by plane. The ratio of a plane with little light is
    /// unreliable, so it is limited to twice the allowed difference; without light it is 1.
    pub(super) fn light_ratios(&self, offsets: &[f64]) -> Vec<f64> {
        offsets.iter().enumerate().map(|(plane, offset)| self.light_ratio(plane, *offset)).collect()
    }

    fn light_ratio(&self, plane: usize, offset: f64) -> f64 {
        let [count, a, b] = self
            .tiles
            .iter()
            .filter(|tile| tile.plane == plane)
            .fold([0.0; 3], |[count, a, b], tile| [count + tile.count, a + tile.sums[0], b + tile.sums[1]]);
        let [a, b] = [a, b].map(|sum| sum - count * offset);
        if a > 0.0 && b > 0.0 { (a / b).clamp(1.0 - 2.0 * LIGHT[1], 1.0 + 2.0 * LIGHT[1]) } else { 1.0 }
    }
}

impl ExposureCheck<'_> {
    /// Checks that no code is above white.
    ///
    /// # Errors
    /// If a code is above white.
    pub(super) fn check_white(&self) -> Result<()> {
        let white = self.white;
        match self.facts.iter().find(|pair| pair.greatest > white) {
            Some(pair) => Err(Error::data(
                format_args!("{} and {}", pair.names[0], pair.names[1]),
                format_args!(
                    "code {} is above white, {white}: state the greatest code of the sensor with --white, or see the frames in white/",
                    pair.greatest
                ),
            )),
            None => Ok(()),
        }
    }

    /// Checks for overexposure; `None` if the exposure is not overexposed.
    pub(super) fn find_clipping(&self) -> Option<Clipped> {
        let (share, code) =
            self.facts.iter().map(|pair| pair.at_top).fold((0.0, 0), |max, top| if top.0 > max.0 { top } else { max });
        let Self { name, white, .. } = self;
        let at = if code == *white {
            format!("white, {white}")
        } else {
            format!("code {code}, the greatest, where white is {white}")
        };
        (share > MAX_AT_TOP).then(|| Clipped {
            reason: format!(
                "exposure {name}: clipped, {:.1} % of a colour are at {at}",
                100.0 * share
            ),
            doubt: (f64::from(code) < MIN_CLIPPING * f64::from(*white)).then(|| {
                format!(
                    "exposure {name} is clipped at {code}, far below white, {white}: if {code} is the greatest code of the sensor, state it with --white; with a white that is too large, the range of codes is, too"
                )
            }),
        })
    }

    /// Checks the pairs, and returns notes on small differences of light.
    ///
    /// # Errors
    /// If the light of the two frames differs too much, or neighbours correlate.
    pub(super) fn check_pairs(&self) -> Result<Vec<String>> {
        let mut notes = Vec::new();
        let offset = self.offset();
        for pair in self.facts {
            let [a, b] = pair.means.map(|mean| mean - offset);
            let ratio = b / a - 1.0;
            let [first, second] = &pair.names;
            let percent = 100.0 * ratio.abs();
            let word = if ratio < 0.0 { "less" } else { "more" };
            if a > 0.0 && ratio.abs() > LIGHT[1] {
                return Err(Error::data(
                    first,
                    format_args!(
                        "{second} has {percent:.1} % {word} light than this frame; the two frames of a pair must have equal light (limit {} %); were exposures mixed, or does the lamp flicker?",
                        100.0 * LIGHT[1]
                    ),
                ));
            }
            if a > 0.0 && ratio.abs() > LIGHT[0] {
                notes.push(format!(
                    "{first} and {second}: a pair whose second frame has {percent:.1} % {word} light; this is taken off, and K is right if all parts of the frame changed alike; take flats under steadier light"
                ));
            }
            let ratios = pair.light_ratios(self.offsets);
            correlation(pair.neighbours.correlation(&ratios)).map_err(|problem| Error::data(first, problem))?;
        }
        Ok(notes)
    }

    /// Reason for leaving out the exposure if too few tiles are in the range of light, of which `used` are; otherwise
    /// `None`.
    pub(super) fn out_of_range(&self, used: usize, range: [f64; 2]) -> Option<String> {
        let all: usize = self.facts.iter().map(|pair| pair.tiles.len()).sum();
        let share = used as f64 / all.max(1) as f64;
        (share < MIN_IN_RANGE).then(|| {
            let mean = self.facts.iter().flat_map(|pair| pair.means).sum::<f64>() / (2 * self.facts.len()) as f64
                - self.offset();
            let [low, high] = range.map(|share| 100.0 * share);
            format!(
                "exposure {}: {mean:.0} ADU of light are outside of {low} to {high} % of white, {}",
                self.name, self.white
            )
        })
    }

    /// Mean offset of the planes in ADU.
    fn offset(&self) -> f64 {
        self.offsets.iter().sum::<f64>() / self.offsets.len() as f64
    }
}

/// Warning about the code of white, if all codes of all exposures are far below it.
pub(super) fn far_below_white(exposures: &[Vec<PairFacts>], white: u16) -> Option<String> {
    let greatest = exposures.iter().flatten().map(|pair| pair.greatest).max()?;
    let share = f64::from(greatest) / f64::from(white);
    (share < MIN_REACH).then(|| {
        format!(
            "the greatest code of the flats, {greatest}, is {:.0} % of white, {white}: is white right? Flats of up to 60 % of white would show it",
            100.0 * share
        )
    })
}
