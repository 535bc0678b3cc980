//! How much of what others answered a model has answered: [`Coverage`].

use std::collections::{BTreeMap, BTreeSet};

use crate::grid::Grid;
use darkqa_ground::types::AxisLevel;

/// Smallest share of the items of a level that a model must have answered to be averaged or ranked with others; chosen. A few failed
/// trials leave a model in, a level or a part of the questions that it was never asked leave it out.
pub(super) const LEAST_SHARE: f64 = 0.9;

/// The items that a model answered at each level, on all sides of a comparison.
#[derive(Debug)]
pub(crate) struct Coverage(BTreeMap<AxisLevel, Vec<bool>>);

impl Coverage {
    /// The items at each level to which all of these subjects, given by their indices, replied.
    pub(crate) fn new(
        grid: &Grid<'_>,
        levels: impl IntoIterator<Item = (AxisLevel, Vec<usize>)>,
        is_about: impl Fn(usize) -> bool,
    ) -> Self {
        let answered = levels.into_iter().map(|(level, subjects)| {
            let items = (0..grid.items.len()).map(|item| {
                let mut sides = subjects.iter();
                is_about(item) && sides.all(|side| grid.result(*side, item).is_reply())
            });
            (level, items.collect())
        });
        Self(answered.collect())
    }

    /// Number of answered items over all levels.
    pub(super) fn total(&self) -> usize {
        self.0
            .values()
            .flatten()
            .filter(|answered| **answered)
            .count()
    }

    /// Number of answered items at each level.
    fn counts(&self) -> Vec<(AxisLevel, usize)> {
        self.0
            .iter()
            .map(|(level, items)| (*level, items.iter().filter(|answered| **answered).count()))
            .collect()
    }

    /// The levels with any answer.
    pub(crate) fn levels(&self) -> impl Iterator<Item = AxisLevel> {
        self.counts()
            .into_iter()
            .filter(|(_, count)| *count > 0)
            .map(|(level, _)| level)
    }

    /// Numbers of items of `most` at a level, and of those among them that are answered here.
    fn level_counts(&self, most: &Self, level: AxisLevel) -> [usize; 2] {
        let Some(all) = most.0.get(&level) else {
            return [0, 0];
        };
        let count = |answered: Option<&Vec<bool>>| {
            answered
                .into_iter()
                .flatten()
                .zip(all)
                .filter(|(here, there)| **here && **there)
                .count()
        };
        [count(Some(all)), count(self.0.get(&level))]
    }

    /// The levels at which less is answered than [`LEAST_SHARE`] of what `most` has, with both numbers of items.
    pub(crate) fn lacking(&self, most: &Self) -> Lacking {
        most.0
            .keys()
            .map(|level| (*level, self.level_counts(most, *level)))
            .filter(|(_, [all, here])| (*here as f64) < LEAST_SHARE * *all as f64)
            .collect()
    }
}

/// Levels with the numbers of items that the others and a model answered there.
pub(crate) type Lacking = Vec<(AxisLevel, [usize; 2])>;

/// The coverage to average over: the one that retains most answers if models that lack some of it are reported separately. Ties go to the
/// larger one, then to the first. A model that was asked less or more than the others therefore does not change their results. `None`
/// without models.
pub(crate) fn shared(coverages: &[Coverage]) -> Option<&Coverage> {
    let mut seen = BTreeSet::new();
    let mut best: Option<((usize, usize), &Coverage)> = None;
    for coverage in coverages {
        // Most models were asked the same.
        if !seen.insert(coverage.counts()) {
            continue;
        }
        let complete = coverages
            .iter()
            .filter(|other| other.lacking(coverage).is_empty());
        let (models, total) = (complete.count(), coverage.total());
        let worth = (models * total, total);
        if best.is_none_or(|(known, _)| worth > known) {
            best = Some((worth, coverage));
        }
    }
    best.map(|(_, coverage)| coverage)
}
