//! Scores of open answers from the marks of a judge: [`OpenSummary`].
//!
//! A score is 100 · mean((clip(mark, 1, 5) − 1) / 4) (Majumdar et al. 2024, CVPR, section 4.2). Questions about one
//! walk share its frames, so the walks are the clusters. With a single walk, the questions are the clusters.

mod answer;
mod cell;
mod change;
mod group;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use self::cell::cell;
use self::change::{baselines, change};
use self::group::groups;
use super::model_in_condition::ModelInCondition;
use darkqa_base::types::ModelListing;

pub use answer::{AnswerOutcome, ScoredAnswer};
pub use cell::OpenCell;
pub use change::Baseline;
pub use change::ScoreChange;
pub use group::{Group, QuestionGroups};

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
