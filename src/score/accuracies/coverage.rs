//! Share of the items answered by other models that a model has answered: [`Coverage`].

use std::collections::{BTreeMap, BTreeSet};

use crate::grid::Grid;
use darkqa_base::types::AxisLevel;

/// Minimum share of the items of a level that a model must have answered to be averaged or ranked with others (chosen).
/// A few failed trials do not exclude a model; a missing level or a missing part of the questions does.
pub(super) const MIN_SHARE: f64 = 0.9;

/// Items that a model answered at each level, on all sides of a comparison.
#[derive(Debug)]
pub(crate) struct Coverage(BTreeMap<AxisLevel, Vec<bool>>);

impl Coverage {
    /// Finds the items at each level to which all of these subjects, given by their indices, replied.
    pub(crate) fn new(
        grid: &Grid<'_>,
        levels: impl IntoIterator<Item = (AxisLevel, Vec<usize>)>,
        is_about: impl Fn(usize) -> bool,
    ) -> Self {
        Self(
            levels
                .into_iter()
                .map(|(level, subjects)| {
                    let items = (0..grid.items.len())
                        .map(|item| is_about(item) && subjects.iter().all(|side| grid.result(*side, item).is_reply()))
                        .collect();
                    (level, items)
                })
                .collect(),
        )
    }

    /// Number of answered items over all levels.
    pub(super) fn total(&self) -> usize {
        self.0.values().flatten().filter(|answered| **answered).count()
    }

    /// Number of answered items at each level.
    fn counts(&self) -> Vec<(AxisLevel, usize)> {
        self.0.iter().map(|(level, items)| (*level, items.iter().filter(|answered| **answered).count())).collect()
    }

    /// Levels with at least one answered item.
    pub(crate) fn levels(&self) -> impl Iterator<Item = AxisLevel> {
        self.counts().into_iter().filter(|(_, count)| *count > 0).map(|(level, _)| level)
    }

    /// Number of items of `most` at a level, and number of these items that are answered here.
    fn level_counts(&self, most: &Self, level: AxisLevel) -> [usize; 2] {
        let Some(all) = most.0.get(&level) else {
            return [0, 0];
        };
        [Some(all), self.0.get(&level)]
            .map(|answered| answered.into_iter().flatten().zip(all).filter(|(here, there)| **here && **there).count())
    }

    /// Levels at which less than [`MIN_SHARE`] of the items of `most` are answered, with both numbers of items.
    pub(crate) fn lacking(&self, most: &Self) -> Lacking {
        most.0
            .keys()
            .map(|level| (*level, self.level_counts(most, *level)))
            .filter(|(_, [all, here])| (*here as f64) < MIN_SHARE * *all as f64)
            .collect()
    }
}

/// Levels with the numbers of items answered by the others and by the model.
pub(crate) type Lacking = Vec<(AxisLevel, [usize; 2])>;

/// Selects the coverage to average over: the one that retains the most answers if models that lack some of it are
/// reported separately. Ties go to the larger one, then to the first. A model that was asked fewer or more items than
/// the others therefore does not change their results. `None` without models.
pub(crate) fn shared(coverages: &[Coverage]) -> Option<&Coverage> {
    let mut seen = BTreeSet::new();
    let mut best: Option<((usize, usize), &Coverage)> = None;
    for coverage in coverages {
        // Most models have the same coverage.
        if !seen.insert(coverage.counts()) {
            continue;
        }
        let models = coverages.iter().filter(|other| other.lacking(coverage).is_empty()).count();
        let total = coverage.total();
        let score = (models * total, total);
        if best.is_none_or(|(highest, _)| score > highest) {
            best = Some((score, coverage));
        }
    }
    best.map(|(_, coverage)| coverage)
}
