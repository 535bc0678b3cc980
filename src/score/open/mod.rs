//! Scores of open answers from the marks of a judge: [`OpenSummary`].
//!
//! A score is 100 · mean((clip(mark, 1, 5) − 1) / 4) (Majumdar et al. 2024, CVPR, section 4.2). Questions about one
//! walk share its frames, so the walks are the clusters. With a single walk, the questions are the clusters.
//!
//! Open answers and their outcomes: [`ScoredAnswer`], [`AnswerOutcome`].
//!
//! Score of a subject on a group of questions: [`OpenCell`].
//!
//! Difference of two scores: [`ScoreChange`].
//!
//! Groups of questions that are scored together ([`Group`]), and the groups of one question ([`QuestionGroups`]).

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use super::model_in_condition::ModelInCondition;
use crate::choice::llm_match::points;
use crate::comparisons::paired::difference;
use crate::estimate::Estimate;
use darkqa_base::types::{AxisLevel, ModelListing, View};

/// All scores of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenSummary {
    /// Unit of the clusters: `episode`, or `question` if there is only one episode.
    pub unit: &'static str,
    /// Number of clusters of all questions.
    pub clusters: usize,
    /// Scores, ordered by subject with the models in their order, then by group.
    pub cells: Vec<OpenCell>,
    /// Differences of scores, ordered by subject, baseline and group.
    pub changes: Vec<ScoreChange>,
    /// The order, groups and marks of the models.
    pub listing: ModelListing,
}

impl OpenSummary {
    /// Score of a subject on a group.
    #[must_use]
    pub fn cell(&self, subject: &ModelInCondition, group: &Group) -> Option<&OpenCell> {
        self.cells.iter().find(|cell| cell.subject == *subject && cell.group == *group)
    }

    /// Difference of a subject from a baseline on a group.
    #[must_use]
    pub fn change(&self, subject: &ModelInCondition, baseline: Baseline, group: &Group) -> Option<&ScoreChange> {
        self.changes
            .iter()
            .find(|change| change.subject == *subject && change.baseline == baseline && change.group == *group)
    }

    /// All groups that have a score, sorted.
    #[must_use]
    pub fn groups(&self) -> BTreeSet<&Group> {
        self.cells.iter().map(|cell| &cell.group).collect()
    }
}

/// Computes the scores of the answers; `questions` lists the groups of each question.
#[must_use]
pub fn open_summary(answers: &[ScoredAnswer], questions: &[QuestionGroups]) -> OpenSummary {
    open_summary_listed(answers, questions, &ModelListing::default())
}

/// Computes the scores like [`open_summary`], with the models in the order of `listing`.
#[must_use]
pub fn open_summary_listed(
    answers: &[ScoredAnswer],
    questions: &[QuestionGroups],
    listing: &ModelListing,
) -> OpenSummary {
    let episodes: BTreeMap<&str, usize> =
        questions.iter().map(|question| &*question.episode).collect::<BTreeSet<_>>().into_iter().zip(0..).collect();
    let by_walk = episodes.len() > 1;
    let clusters: Vec<usize> = questions
        .iter()
        .enumerate()
        .map(|(index, question)| if by_walk { episodes[&*question.episode] } else { index })
        .collect();
    let mut by_subject = BTreeMap::<&ModelInCondition, Vec<&ScoredAnswer>>::new();
    for answer in answers {
        by_subject.entry(&answer.subject).or_default().push(answer);
    }
    let groups = groups(questions);
    let mut by_subject: Vec<(&ModelInCondition, Vec<&ScoredAnswer>)> = by_subject.into_iter().collect();
    by_subject.sort_by_cached_key(|(subject, _)| listing.place(&subject.model));
    let (mut cells, mut changes) = (Vec::new(), Vec::new());
    for (subject, answers) in &by_subject {
        for group in &groups {
            let in_group: Vec<&ScoredAnswer> =
                answers.iter().filter(|answer| group.contains(&questions[answer.question])).copied().collect();
            cells.push(cell(subject, group, &in_group, &clusters));
        }
        for (baseline, other) in baselines(subject) {
            let Some((_, baseline_answers)) =
                by_subject.iter().find(|(subject, _)| subject.matches_up_to_group(&other))
            else {
                continue;
            };
            for group in &groups {
                let difference =
                    change(answers, baseline_answers, |question| group.contains(&questions[question]), &clusters);
                changes.extend(difference.map(|difference| ScoreChange {
                    subject: (*subject).clone(),
                    baseline,
                    group: group.clone(),
                    difference,
                }));
            }
        }
    }
    OpenSummary {
        unit: if by_walk { "episode" } else { "question" },
        clusters: if by_walk { episodes.len() } else { questions.len() },
        cells,
        changes,
        listing: listing.clone(),
    }
}

/// Outcome of an open answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AnswerOutcome {
    /// The answer is missing so far, or the trial failed. Not scored.
    Missing,
    /// The answer is not judged yet. Not scored.
    Unjudged,
    /// The judge's reply has no mark. Not scored.
    Unmarked,
    /// A null answer, which gets 0 points without a judge.
    Null,
    /// The mark from the judge's reply, before it is clipped to 1 to 5.
    Marked(i64),
}

impl AnswerOutcome {
    /// Points between 0 and 1; `None` if the answer is not scored.
    #[must_use]
    pub fn points(self) -> Option<f64> {
        match self {
            Self::Missing | Self::Unjudged | Self::Unmarked => None,
            Self::Null => Some(points(None)),
            Self::Marked(mark) => Some(points(Some(mark))),
        }
    }
}

/// One answer of one subject to one question.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoredAnswer {
    /// Model and condition that gave the answer.
    pub subject: ModelInCondition,
    /// Index of the question among those asked.
    pub question: usize,
    /// Outcome of the answer.
    pub outcome: AnswerOutcome,
    /// True if the protocol shortened the answer before it was judged.
    pub cut: bool,
}

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
fn cell(subject: &ModelInCondition, group: &Group, answers: &[&ScoredAnswer], clusters: &[usize]) -> OpenCell {
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
fn baselines(subject: &ModelInCondition) -> Vec<(Baseline, ModelInCondition)> {
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
fn change(
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

/// Walk, category and split of a question.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct QuestionGroups {
    /// Name of the walk.
    pub episode: String,
    /// Name of the category.
    pub category: String,
    /// Name of the split.
    pub split: String,
}

/// A group of questions that are scored together.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// All questions of the run.
    All,
    /// The questions of a split.
    Split(String),
    /// The questions of a category.
    Category(String),
}

impl Group {
    /// True if a question belongs to the group.
    fn contains(&self, question: &QuestionGroups) -> bool {
        match self {
            Self::All => true,
            Self::Split(split) => *split == question.split,
            Self::Category(category) => *category == question.category,
        }
    }

    /// Name of the group in files and tables.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::All => "all",
            Self::Split(name) | Self::Category(name) => name,
        }
    }

    /// Kind of group in files: `all`, `split` or `category`.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Split(_) => "split",
            Self::Category(_) => "category",
        }
    }
}

/// Groups to score: all questions, then each split and each category if there are several.
fn groups(questions: &[QuestionGroups]) -> Vec<Group> {
    let splits: BTreeSet<&String> = questions.iter().map(|question| &question.split).collect();
    let categories: BTreeSet<&String> = questions.iter().map(|question| &question.category).collect();
    let mut groups = vec![Group::All];
    if splits.len() > 1 {
        groups.extend(splits.into_iter().cloned().map(Group::Split));
    }
    if categories.len() > 1 {
        groups.extend(categories.into_iter().cloned().map(Group::Category));
    }
    groups
}
