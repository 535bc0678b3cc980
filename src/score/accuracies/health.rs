//! Counts of replies, unreadable replies and failures of each subject: [`Health`].
//!
//! Share of the items answered by other models that a model has answered: [`LevelCoverage`].

use std::collections::{BTreeMap, BTreeSet};

use crate::choice::ParsingMode;
use crate::grid::{Grid, TrialResult};
use crate::model_in_condition::ModelInCondition;
use darkqa_base::types::{AxisLevel, FailureKind, TrialRef, UnreadReason};

/// Counts of replies, unreadable replies and failures of one subject.
#[derive(Debug, Clone, PartialEq)]
pub struct Health {
    pub subject: ModelInCondition,
    /// Number of trials with a reply.
    pub replies: usize,
    /// Number of replies in which the strict parsing found a choice.
    pub read: usize,
    /// Number of replies in which only the lenient parsing found a choice.
    pub lenient_only: usize,
    /// Number of replies in which the strict parsing found no choice, by reason.
    pub unread: BTreeMap<UnreadReason, usize>,
    /// Number of trials without a reply, by kind of failure.
    pub failed: BTreeMap<FailureKind, usize>,
}

impl Health {
    fn count(&mut self, result: TrialResult, trial: TrialRef<'_>) {
        let Some(strict) = result.parsed(ParsingMode::Strict) else {
            if let Some((kind, _)) = trial.failure() {
                *self.failed.entry(kind).or_default() += 1;
            }
            return;
        };
        self.replies += 1;
        self.read += usize::from(strict.is_some());
        let lenient = result.parsed(ParsingMode::Lenient).flatten();
        self.lenient_only += usize::from(strict.is_none() && lenient.is_some());
        if let Some(reason) = trial.strict().and_then(|reading| reading.why) {
            *self.unread.entry(reason).or_default() += 1;
        }
    }

    /// Number of trials without a reply.
    #[must_use]
    pub fn failures(&self) -> usize {
        self.failed.values().sum()
    }

    /// Number of unreadable replies. “Cannot tell” by a person is readable.
    #[must_use]
    pub fn unreadable(&self) -> usize {
        let unread = self.replies - self.read;
        unread.saturating_sub(self.unread_for(&[UnreadReason::CannotTell]))
    }

    /// Number of replies without a choice for one of these reasons.
    #[must_use]
    pub fn unread_for(&self, reasons: &[UnreadReason]) -> usize {
        reasons.iter().map(|reason| self.unread.get(reason).copied().unwrap_or(0)).sum()
    }
}

/// Health of every subject, in the order of the grid.
#[must_use]
pub fn healths(grid: &Grid<'_>) -> Vec<Health> {
    grid.subjects
        .iter()
        .enumerate()
        .map(|(index, subject)| {
            let mut health = Health {
                subject: subject.clone(),
                replies: 0,
                read: 0,
                lenient_only: 0,
                unread: BTreeMap::new(),
                failed: BTreeMap::new(),
            };
            for item in 0..grid.items.len() {
                if let Some(trial) = grid.trial(index, item) {
                    health.count(grid.result(index, item), trial);
                }
            }
            health
        })
        .collect()
}

/// Minimum share of the items of a level that a model must have answered to be averaged or ranked with others (chosen).
/// A few failed trials do not exclude a model; a missing level or a missing part of the questions does.
pub(super) const MIN_SHARE: f64 = 0.9;

/// Items that a model answered at each level, on all sides of a comparison.
#[derive(Debug)]
pub(crate) struct LevelCoverage(BTreeMap<AxisLevel, Vec<bool>>);

impl LevelCoverage {
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
                        .map(|item| {
                            is_about(item)
                                && grid.has_item(subjects.iter().copied(), item)
                                && subjects.iter().all(|side| grid.compared_result(*side, item).is_reply())
                        })
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
pub(crate) fn shared(coverages: &[LevelCoverage]) -> Option<&LevelCoverage> {
    let mut seen = BTreeSet::new();
    let mut best: Option<((usize, usize), &LevelCoverage)> = None;
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
