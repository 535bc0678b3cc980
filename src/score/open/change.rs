//! One score less another: [`ScoreChange`].

use std::collections::BTreeMap;

use super::answer::ScoredAnswer;
use super::group::Group;
use crate::score::estimate::Estimate;
use crate::score::paired::difference;
use crate::score::subject::Subject;
use crate::types::{AxisLevel, View};

/// What a score is held against.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Baseline {
    /// The same model on the lit frames.
    Lit,
    /// The same model at the same level without an enhancer.
    Raw,
}

/// A subject's score less that of another, on the questions that both were scored on.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoreChange {
    /// Whose.
    pub subject: Subject,
    /// Against what.
    pub against: Baseline,
    /// On what.
    pub group: Group,
    /// The difference of the unrounded means; its `n` counts questions.
    pub difference: Estimate,
}

/// Whom a subject is held against.
pub(super) fn others(subject: &Subject) -> Vec<(Baseline, Subject)> {
    let Some(level) = subject.level.filter(|_| subject.view == Some(View::Image)) else {
        return Vec::new();
    };
    let seeing =
        |level, enhancer| Subject::seeing(&subject.model, level, &subject.variant, enhancer);
    let lit = (level != AxisLevel::L0).then(|| (Baseline::Lit, seeing(AxisLevel::L0, None)));
    let raw = subject
        .enhancer
        .is_some()
        .then(|| (Baseline::Raw, seeing(level, None)));
    lit.into_iter().chain(raw).collect()
}

/// The first's mean less the second's on the questions that both were scored on; several people's answers to one question count as
/// their mean.
pub(super) fn change(
    first: &[&ScoredAnswer],
    second: &[&ScoredAnswer],
    is_of: impl Fn(usize) -> bool,
    cluster: impl Fn(usize) -> usize,
) -> Option<Estimate> {
    let means = |answers: &[&ScoredAnswer]| {
        let mut means = BTreeMap::<usize, (f64, f64)>::new();
        for answer in answers.iter().filter(|answer| is_of(answer.question)) {
            if let Some(points) = answer.outcome.points() {
                let (sum, n) = means.entry(answer.question).or_default();
                (*sum, *n) = (*sum + points, *n + 1.0);
            }
        }
        means
    };
    let (first, second) = (means(first), means(second));
    let mut sums = BTreeMap::<usize, (f64, f64)>::new();
    let mut n = 0;
    for (question, (sum, count)) in &first {
        let Some((other, others)) = second.get(question) else {
            continue;
        };
        let (net, pairs) = sums.entry(cluster(*question)).or_default();
        (*net, *pairs) = (*net + sum / count - other / others, *pairs + 1.0);
        n += 1;
    }
    let sums: Vec<(f64, f64)> = sums.into_values().collect();
    (n > 0).then(|| difference(&sums, n))
}
