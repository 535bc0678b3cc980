//! What became of the trials of each subject, besides right and wrong: [`Health`].

use std::collections::BTreeMap;

use super::choice::ReadingMode;
use super::grid::{Grid, TrialResult};
use super::subject::Subject;
use crate::types::{FailureKind, Record, UnreadReason};

/// What became of the trials of one subject.
#[derive(Debug, Clone, PartialEq)]
pub struct Health {
    /// Whose.
    pub subject: Subject,
    /// Trials with a reply.
    pub replies: usize,
    /// Replies in which the strict reading found a choice.
    pub read: usize,
    /// Replies in which only the lenient reading found one.
    pub lenient_only: usize,
    /// Why the strict reading found none, and how often.
    pub unread: BTreeMap<UnreadReason, usize>,
    /// Why no reply came, and how often.
    pub failed: BTreeMap<FailureKind, usize>,
}

impl Health {
    fn count(&mut self, mark: TrialResult, record: &Record) {
        let Some(strict) = mark.reading(ReadingMode::Strict) else {
            if let Some(failure) = &record.failure {
                *self.failed.entry(failure.kind).or_default() += 1;
            }
            return;
        };
        self.replies += 1;
        self.read += usize::from(strict.is_some());
        let lenient = mark.reading(ReadingMode::Lenient).flatten();
        self.lenient_only += usize::from(strict.is_none() && lenient.is_some());
        if let Some(why) = record.detail.strict.and_then(|reading| reading.why) {
            *self.unread.entry(why).or_default() += 1;
        }
    }

    /// How many trials have no reply.
    #[must_use]
    pub fn failures(&self) -> usize {
        self.failed.values().sum()
    }

    /// How often a reply could not be read for one of these reasons.
    #[must_use]
    pub fn unread_for(&self, reasons: &[UnreadReason]) -> usize {
        let count = |why| self.unread.get(why).copied().unwrap_or(0);
        reasons.iter().map(count).sum()
    }
}

/// The health of every subject, in their order.
#[must_use]
pub(crate) fn healths(grid: &Grid<'_>) -> Vec<Health> {
    let subjects = grid.subjects.iter().enumerate();
    let healths = subjects.map(|(index, subject)| {
        let mut health = Health {
            subject: subject.clone(),
            replies: 0,
            read: 0,
            lenient_only: 0,
            unread: BTreeMap::new(),
            failed: BTreeMap::new(),
        };
        for item in 0..grid.items.len() {
            if let Some(record) = grid.record(index, item) {
                health.count(grid.mark(index, item), record);
            }
        }
        health
    });
    healths.collect()
}
