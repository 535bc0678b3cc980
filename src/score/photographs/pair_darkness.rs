//! Exposure drop of dark photographs relative to their frames: [`PairDarkness`].

use std::collections::{BTreeMap, BTreeSet};

use super::realism::quantile::quantile;
use crate::grid::Grid;
use darkqa_base::types::{FrameId, PairFacts, PhotoName};

/// Maximum difference in EV between the drops by mean and by median for a pair that differs in exposure only (chosen).
const MAX_MEAN_MEDIAN_GAP: f64 = 0.5;

/// Darkness of the photographs that a subject was shown, or that its synthetic images were matched to, by frame.
#[must_use]
pub fn pair_facts<'g>(grid: &Grid<'g>, subject: usize) -> BTreeMap<&'g FrameId, PairFacts> {
    (0..grid.items.len())
        .filter_map(|item| grid.trial(subject, item))
        .filter_map(|trial| {
            let image = trial.images()?;
            Some((trial.sent_frame(), *image.pair.as_deref()?))
        })
        .collect()
}

/// Darkness of all photographs of a grid, by name.
#[must_use]
pub fn from_grid(grid: &Grid<'_>) -> Vec<PairDarkness> {
    let named: Vec<(&PhotoName, usize)> = grid
        .subjects
        .iter()
        .enumerate()
        .filter_map(|(index, subject)| Some((subject.variant.photograph()?, index)))
        .collect();
    let names: BTreeSet<&PhotoName> = named.iter().map(|(name, _)| *name).collect();
    names
        .into_iter()
        .filter_map(|name| {
            let facts: BTreeMap<_, _> = named
                .iter()
                .filter(|(other, _)| *other == name)
                .flat_map(|(_, subject)| pair_facts(grid, *subject))
                .collect();
            PairDarkness::new(name, &facts.into_values().collect::<Vec<_>>())
        })
        .collect()
}

/// Exposure drop of the photographs of one name relative to their frames.
#[derive(Debug, Clone, PartialEq)]
pub struct PairDarkness {
    /// Name of the photographs.
    pub name: PhotoName,
    /// Number of frames with a known drop.
    pub frames: usize,
    /// Number of frames with an unknown drop, because the frame or its photograph is black.
    pub unknown: usize,
    /// Lower quartile, median and upper quartile of the drop in EV.
    pub ev: [f64; 3],
    /// Median of the drops that make synthetic images equally dark, in EV; comparable with levels.
    pub synthesis: f64,
    /// Number of frames whose drop is stated by the data set.
    pub stated: usize,
    /// True if the median is measured beyond the measurable range, so that the true drop may be larger.
    pub is_lower_bound: bool,
    /// Number of frames that are not brighter than their photograph.
    pub brighter: usize,
    /// Medians over the frames of the drop by the mean and of the drop by the median of pixels; `None` if they cannot
    /// be measured.
    pub mean_and_median: Option<[f64; 2]>,
}

/// Known values of some facts, in ascending order.
fn sorted(facts: &[PairFacts], of: fn(&PairFacts) -> Option<f64>) -> Vec<f64> {
    let mut values: Vec<f64> = facts.iter().filter_map(of).collect();
    values.sort_by(f64::total_cmp);
    values
}

impl PairDarkness {
    /// Summarizes the photographs of one name, one for each frame; `None` if no drop is known.
    #[must_use]
    pub fn new(name: &PhotoName, facts: &[PairFacts]) -> Option<Self> {
        let all = sorted(facts, PairFacts::ev);
        let ev = [quantile(&all, 0.25)?, quantile(&all, 0.5)?, quantile(&all, 0.75)?];
        let mean = quantile(&sorted(facts, |facts| facts.median.and(facts.mean)), 0.5);
        let median = quantile(&sorted(facts, |facts| facts.mean.and(facts.median)), 0.5);
        let matching = quantile(&sorted(facts, PairFacts::matching), 0.5);
        let stated = facts.iter().filter(|facts| facts.stated.is_some()).count();
        Some(Self {
            name: name.clone(),
            frames: all.len(),
            unknown: facts.len() - all.len(),
            synthesis: matching.unwrap_or(ev[1]),
            ev,
            stated,
            is_lower_bound: stated < facts.len() && ev[1] > PairFacts::MEASURABLE,
            brighter: all.iter().filter(|ev| **ev <= 0.0).count(),
            mean_and_median: mean.zip(median).map(|(mean, median)| [mean, median]),
        })
    }

    /// Median drop, such as `3.6 EV` or `≥ 6.8 EV`.
    #[must_use]
    pub fn short(&self) -> String {
        let least = if self.is_lower_bound { "≥ " } else { "" };
        format!("{least}{:.1} EV", self.ev[1])
    }

    /// Drop with its quartiles, such as `3.6 EV (quartiles 3.5–3.7), as measured`.
    #[must_use]
    pub fn long(&self) -> String {
        let source = match self.stated {
            0 => "as measured".to_owned(),
            all if all == self.frames => "as the data state".to_owned(),
            some => format!("as the data state for {some} frames, the others as measured"),
        };
        let [low, _, high] = self.ev;
        format!("{} (quartiles {low:.2}–{high:.2}), {source}", self.short())
    }

    /// Warnings about unusual pairs, as full sentences.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let name = &self.name;
        let mut all = Vec::new();
        if self.ev[1] < 0.0 {
            all.push(format!(
                "The photographs {name} are brighter than their frames ({}): were normal and low light swapped?",
                self.short()
            ));
        } else if self.brighter > 0 {
            all.push(format!(
                "{} of {} photographs {name} are not darker than their frames.",
                self.brighter, self.frames
            ));
        }
        if let Some([mean, median]) = self.mean_and_median
            && (mean - median).abs() > MAX_MEAN_MEDIAN_GAP
        {
            all.push(format!(
                "The photographs {name} are {mean:.2} EV darker than their frames by the mean and {median:.2} EV by the median of \
                 pixels: they are not one exposure apart, as with another light, a tone curve or synthesis of another kind."
            ));
        }
        if self.is_lower_bound {
            all.push(format!(
                "Above {} EV, noise that is clipped at black hides a part of the drop, so that {} is a lower bound; \"ev\" in \
                 frames.jsonl states it.",
                PairFacts::MEASURABLE,
                self.short()
            ));
        }
        if self.unknown > 0 {
            all.push(format!(
                "Photographs {name} whose drop is not known, because they or their frames are black: {}.",
                self.unknown
            ));
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(facts: &[(Option<f64>, f64, f64)]) -> PairDarkness {
        let facts: Vec<PairFacts> = facts
            .iter()
            .map(|(stated, mean, median)| PairFacts {
                stated: *stated,
                mean: Some(*mean),
                median: Some(*median),
                synthesis: Some(*mean),
            })
            .collect();
        PairDarkness::new(&PhotoName::numbered(0), &facts).unwrap()
    }

    #[test]
    fn one_exposure_is_its_median_with_quartiles_and_nothing_odd() {
        let pairs = pair(&[(None, 3.5, 3.6), (None, 3.6, 3.6), (None, 3.7, 3.7)]);
        assert_eq!(pairs.short(), "3.6 EV");
        assert_eq!(pairs.long(), "3.6 EV (quartiles 3.55–3.65), as measured");
        assert!(pairs.warnings().is_empty(), "{:?}", pairs.warnings());
    }

    #[test]
    fn what_the_data_state_goes_first_and_is_no_lower_bound() {
        let pairs = pair(&[(Some(8.0), 6.9, 6.9)]);
        assert_eq!(pairs.long(), "8.0 EV (quartiles 8.00–8.00), as the data state");
        assert!(pairs.warnings().is_empty());
        let measured = pair(&[(None, 6.9, 6.9)]);
        assert_eq!(measured.short(), "≥ 6.9 EV");
        assert!(measured.warnings()[0].contains("lower bound"));
    }

    #[test]
    fn swapped_pairs_and_other_tones_are_told() {
        let swapped = pair(&[(None, -3.0, -3.1)]);
        assert!(swapped.warnings()[0].contains("swapped"), "{:?}", swapped.warnings());
        let some = pair(&[(None, 3.0, 3.0), (None, 3.0, 3.1), (None, 0.0, 0.0)]);
        assert!(some.warnings()[0].starts_with("1 of 3 photographs dark are not darker"));
        let tone = pair(&[(None, 2.17, 3.33)]);
        assert!(tone.warnings()[0].contains("not one exposure apart"));
    }

    #[test]
    fn black_images_are_counted() {
        let facts = [PairFacts::default(), PairFacts { mean: Some(2.0), ..PairFacts::default() }];
        let pairs = PairDarkness::new(&PhotoName::numbered(0), &facts).unwrap();
        assert_eq!((pairs.frames, pairs.unknown), (1, 1));
        assert!(pairs.warnings()[0].contains("are black"));
        assert_eq!(PairDarkness::new(&PhotoName::numbered(0), &facts[..1]), None);
    }
}
