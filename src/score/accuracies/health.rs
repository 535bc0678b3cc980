//! Counts of replies, unreadable replies and failures of each subject: [`Health`].

use std::collections::BTreeMap;

use crate::choice::ParsingMode;
use crate::grid::{Grid, TrialResult};
use crate::model_in_condition::ModelInCondition;
use darkqa_base::types::{FailureKind, TrialRef, UnreadReason};

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
        let Some(strict) = result.reading(ParsingMode::Strict) else {
            if let Some((kind, _)) = trial.failure() {
                *self.failed.entry(kind).or_default() += 1;
            }
            return;
        };
        self.replies += 1;
        self.read += usize::from(strict.is_some());
        let lenient = result.reading(ParsingMode::Lenient).flatten();
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
