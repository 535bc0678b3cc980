//! One score: [`OpenCell`].

use std::collections::BTreeMap;

use super::answer::{AnswerOutcome, ScoredAnswer};
use super::group::Group;
use crate::score::estimate::Estimate;
use crate::score::subject::Subject;

/// How many independent right-or-wrong replies a mark may count for: one on a scale of five steps varies less than such a reply
/// of the same mean, at least where it is not all or nothing.
const MOST: f64 = 4.0;

/// The score of a subject on a group of questions, and what it rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenCell {
    /// Whose.
    pub subject: Subject,
    /// On what.
    pub group: Group,
    /// How many answers are due.
    pub due: usize,
    /// Those not given, or failed.
    pub missing: usize,
    /// Those not judged yet.
    pub unjudged: usize,
    /// Those whose judge gave no mark.
    pub unmarked: usize,
    /// Those that are none.
    pub null: usize,
    /// Those that the protocol has cut.
    pub cut: usize,
    /// The mean, between 0 and 1; `None` where nothing is scored. Its `n` counts answers.
    pub score: Option<Estimate>,
}

impl OpenCell {
    /// How many answers are scored.
    #[must_use]
    pub fn scored(&self) -> usize {
        self.score.map_or(0, |score| score.n)
    }
}

/// Scores the answers of a subject on a group.
pub(super) fn cell(
    subject: &Subject,
    group: &Group,
    answers: &[&ScoredAnswer],
    cluster: impl Fn(usize) -> usize,
) -> OpenCell {
    let count = |outcome| {
        let alike = answers.iter().filter(|answer| answer.outcome == outcome);
        alike.count()
    };
    let mut sums = BTreeMap::<usize, (f64, f64)>::new();
    for answer in answers {
        if let Some(points) = answer.outcome.points() {
            let (sum, n) = sums.entry(cluster(answer.question)).or_default();
            (*sum, *n) = (*sum + points, *n + 1.0);
        }
    }
    let sums: Vec<(f64, f64)> = sums.into_values().collect();
    let n = sums.iter().map(|(_, n)| n).sum::<f64>() as usize;
    OpenCell {
        subject: subject.clone(),
        group: group.clone(),
        due: answers.len(),
        missing: count(AnswerOutcome::Missing),
        unjudged: count(AnswerOutcome::Unjudged),
        unmarked: count(AnswerOutcome::Unmarked),
        null: count(AnswerOutcome::Null),
        cut: answers.iter().filter(|answer| answer.cut).count(),
        score: Estimate::scored(&sums, MOST, n),
    }
}
