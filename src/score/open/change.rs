//! Difference of two scores: [`ScoreChange`].

use std::collections::BTreeMap;

use super::answer::ScoredAnswer;
use super::group::Group;
use crate::comparisons::paired::difference;
use crate::estimate::Estimate;
use crate::model_in_condition::ModelInCondition;
use darkqa_base::types::{AxisLevel, View};

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

/// Mean of the first answers minus mean of the second, on the questions for which both have a score. Several answers to
/// one question, by different people, count as their mean. The interval holds for all scores of answers without one, on
/// the questions with a score on either side.
pub(super) fn change(
    first: &[&ScoredAnswer],
    second: &[&ScoredAnswer],
    in_group: impl Fn(usize) -> bool,
    clusters: &[usize],
) -> Option<Estimate> {
    let [first, second] = [first, second].map(|answers| {
        let mut means = BTreeMap::<usize, AnswerScores>::new();
        for answer in answers.iter().filter(|answer| in_group(answer.question)) {
            means.entry(answer.question).or_default().add(answer);
        }
        means
    });
    let mut changes = Vec::new();
    for (question, scores) in &first {
        if let Some(others) = second.get(question) {
            changes.push((clusters[*question], [scores, others]));
        }
    }
    let estimate = |value: &dyn Fn([&AnswerScores; 2]) -> Option<f64>| {
        let mut sums = BTreeMap::<usize, (f64, f64)>::new();
        let (mut squares, mut n) = (0.0, 0);
        for (cluster, sides) in &changes {
            let Some(change) = value(*sides) else {
                continue;
            };
            let (net, pairs) = sums.entry(*cluster).or_default();
            (*net, *pairs) = (*net + change, *pairs + 1.0);
            squares += change * change;
            n += 1;
        }
        let sums: Vec<(f64, f64)> = sums.into_values().collect();
        (n > 0).then(|| difference(&sums, squares, n))
    };
    let scored = estimate(&|[first, second]| Some(first.mean()? - second.mean()?))?;
    if changes.iter().all(|(_, sides)| sides.iter().all(|side| side.missing == 0)) {
        return Some(scored);
    }
    let bounds = [(0.0, 1.0), (1.0, 0.0)].map(|(first_points, second_points)| {
        estimate(&|[first, second]| {
            let has_score = first.mean().or(second.mean()).is_some();
            has_score.then(|| first.filled(first_points) - second.filled(second_points))
        })
    });
    Some(scored.covering(bounds.into_iter().flatten()))
}

/// Scores of the answers to one question.
#[derive(Debug, Clone, Copy, Default)]
struct AnswerScores {
    sum: f64,
    scored: usize,
    /// Number of answers without a score.
    missing: usize,
}

impl AnswerScores {
    fn add(&mut self, answer: &ScoredAnswer) {
        match answer.outcome.points() {
            Some(points) => {
                self.sum += points;
                self.scored += 1;
            }
            None => self.missing += 1,
        }
    }

    /// Mean score; `None` without a score.
    fn mean(&self) -> Option<f64> {
        (self.scored > 0).then(|| self.sum / self.scored as f64)
    }

    /// Mean score if each answer without a score has this one.
    fn filled(&self, points: f64) -> f64 {
        let all = (self.scored + self.missing) as f64;
        (self.sum + points * self.missing as f64) / all
    }
}
