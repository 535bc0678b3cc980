//! Score of a subject on a group of questions: [`OpenCell`].

use std::collections::BTreeMap;

use super::answer::{AnswerOutcome, ScoredAnswer};
use super::group::Group;
use crate::estimate::Estimate;
use crate::model_in_condition::ModelInCondition;

/// Maximum number of independent binary replies that one mark may count as. A mark on a five-step scale varies less
/// than a binary reply with the same mean, unless all marks are 1 or 5.
const MAX_WEIGHT: f64 = 4.0;

/// Score of a subject on a group of questions, with the counts behind it.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenCell {
    pub subject: ModelInCondition,
    pub group: Group,
    /// Number of answers that the run asks for.
    pub planned: usize,
    /// Number of missing answers and failed trials.
    pub missing: usize,
    /// Number of answers that are not judged yet.
    pub unjudged: usize,
    /// Number of answers without a mark in the judge's reply.
    pub unmarked: usize,
    /// Number of null answers, which score 0.
    pub null: usize,
    /// Number of answers that the protocol shortened before they were judged.
    pub cut: usize,
    /// Mean score, between 0 and 1; `None` if no answer is scored. Its `n` is the number of scored answers; its
    /// interval holds for all scores of the others.
    pub score: Option<Estimate>,
}

impl OpenCell {
    /// Number of scored answers.
    #[must_use]
    pub fn scored(&self) -> usize {
        self.score.map_or(0, |score| score.n)
    }
}

/// Computes the cell of a subject and a group; `cluster` returns the cluster of a question.
pub(super) fn cell(
    subject: &ModelInCondition,
    group: &Group,
    answers: &[&ScoredAnswer],
    clusters: &[usize],
) -> OpenCell {
    let count = |outcome| answers.iter().filter(|answer| answer.outcome == outcome).count();
    // Sums of the scores by cluster, with a value in place of a missing score.
    let sums = |if_missing: Option<f64>| -> Vec<(f64, f64)> {
        let mut sums = BTreeMap::<usize, (f64, f64)>::new();
        for answer in answers {
            if let Some(points) = answer.outcome.points().or(if_missing) {
                let (sum, n) = sums.entry(clusters[answer.question]).or_default();
                (*sum, *n) = (*sum + points, *n + 1.0);
            }
        }
        sums.into_values().collect()
    };
    let n = answers.iter().filter(|answer| answer.outcome.points().is_some()).count();
    let score = Estimate::from_scores(&sums(None), MAX_WEIGHT, n);
    let score = if n < answers.len() {
        let bounds = [0.0, 1.0].map(|points| Estimate::from_scores(&sums(Some(points)), MAX_WEIGHT, n));
        score.map(|score| score.covering(bounds.into_iter().flatten()))
    } else {
        score
    };
    OpenCell {
        subject: subject.clone(),
        group: group.clone(),
        planned: answers.len(),
        missing: count(AnswerOutcome::Missing),
        unjudged: count(AnswerOutcome::Unjudged),
        unmarked: count(AnswerOutcome::Unmarked),
        null: count(AnswerOutcome::Null),
        cut: answers.iter().filter(|answer| answer.cut).count(),
        score,
    }
}
