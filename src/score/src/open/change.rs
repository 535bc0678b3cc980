//! Difference of two scores: [`ScoreChange`].

use std::collections::BTreeMap;

use super::answer::ScoredAnswer;
use super::group::Group;
use crate::comparisons::paired::difference;
use crate::estimate::Estimate;
use crate::model_in_condition::ModelInCondition;
use darkqa_ground::types::{AxisLevel, View};

/// Subject that a score is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Baseline {
    /// The same model on the clean frames.
    Clean,
    /// The same model at the same level without an enhancer.
    Raw,
}

/// Score of a subject minus that of a baseline, on the questions for which both have a score.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoreChange {
    pub subject: ModelInCondition,
    pub baseline: Baseline,
    pub group: Group,
    /// Difference of the unrounded means. Its `n` is the number of questions.
    pub difference: Estimate,
}

/// Baselines of a subject; empty for a subject without images.
pub(super) fn baselines(subject: &ModelInCondition) -> Vec<(Baseline, ModelInCondition)> {
    let Some(level) = subject.level.filter(|_| subject.view == Some(View::Image)) else {
        return Vec::new();
    };
    let is_enhanced = subject.enhancer.is_some();
    let has_clean = level != AxisLevel::L0 || is_enhanced;
    let clean = has_clean.then_some((Baseline::Clean, AxisLevel::L0));
    let raw = is_enhanced.then_some((Baseline::Raw, level));
    clean
        .into_iter()
        .chain(raw)
        .map(|(baseline, level)| {
            let (model, variant) = (&subject.model, &subject.variant);
            let other = ModelInCondition::with_images(model, level, variant, None);
            (baseline, other)
        })
        .collect()
}

/// Mean of the first answers minus mean of the second, on the questions for which both have a score. Several answers to one question, by
/// different people, count as their mean.
pub(super) fn change(
    first: &[&ScoredAnswer],
    second: &[&ScoredAnswer],
    in_group: impl Fn(usize) -> bool,
    clusters: &[usize],
) -> Option<Estimate> {
    let [first, second] = [first, second].map(|answers| {
        let mut means = BTreeMap::<usize, (f64, f64)>::new();
        for answer in answers.iter().filter(|answer| in_group(answer.question)) {
            if let Some(points) = answer.outcome.points() {
                let (sum, n) = means.entry(answer.question).or_default();
                (*sum, *n) = (*sum + points, *n + 1.0);
            }
        }
        means
    });
    let mut sums = BTreeMap::<usize, (f64, f64)>::new();
    let (mut squares, mut n) = (0.0, 0);
    for (question, (sum, count)) in &first {
        let Some((other, others)) = second.get(question) else {
            continue;
        };
        let (net, pairs) = sums.entry(clusters[*question]).or_default();
        let change = sum / count - other / others;
        (*net, *pairs) = (*net + change, *pairs + 1.0);
        squares += change * change;
        n += 1;
    }
    let sums: Vec<(f64, f64)> = sums.into_values().collect();
    (n > 0).then(|| difference(&sums, squares, n))
}
