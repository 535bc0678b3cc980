//! The scores of open answers: [`OpenSummary`], from the marks of a judge.
//!
//! A score is 100 · mean((clip(mark, 1, 5) − 1) / 4) (Majumdar et al. 2024, CVPR, section 4.2). Questions about one walk share
//! its frames, so that walks are the clusters; of one walk alone the questions are.

mod answer;
mod cell;
mod change;
mod group;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use self::cell::cell;
use self::change::{change, others};
use self::group::groups;
use super::subject::Subject;

pub use answer::{AnswerOutcome, ScoredAnswer};
pub(crate) use cell::OpenCell;
pub use change::Baseline;
pub(crate) use change::ScoreChange;
pub use group::{Group, QuestionGroups};

/// Every score of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenSummary {
    /// What the clusters are: `episode`, or `question` of one episode alone.
    pub unit: &'static str,
    /// How many there are.
    pub clusters: usize,
    /// Scores by subject, and by group within.
    pub cells: Vec<OpenCell>,
    /// Differences, likewise.
    pub changes: Vec<ScoreChange>,
}

impl OpenSummary {
    /// The cell of a subject on a group.
    #[must_use]
    pub fn cell(&self, subject: &Subject, group: &Group) -> Option<&OpenCell> {
        let mut cells = self.cells.iter();
        cells.find(|cell| cell.subject == *subject && cell.group == *group)
    }

    /// How a subject does against another on a group.
    #[must_use]
    pub fn change(
        &self,
        subject: &Subject,
        against: Baseline,
        group: &Group,
    ) -> Option<&ScoreChange> {
        self.changes.iter().find(|change| {
            change.subject == *subject && change.against == against && change.group == *group
        })
    }

    /// All groups in their order.
    #[must_use]
    pub fn groups(&self) -> BTreeSet<&Group> {
        self.cells.iter().map(|cell| &cell.group).collect()
    }
}

/// Scores answers; `topics` holds what each question belongs to.
#[must_use]
pub fn open_summary(answers: &[ScoredAnswer], topics: &[QuestionGroups]) -> OpenSummary {
    let episodes: BTreeMap<&str, usize> = topics
        .iter()
        .map(|topic| &*topic.episode)
        .collect::<BTreeSet<_>>()
        .into_iter()
        .zip(0..)
        .collect();
    let walks = episodes.len() > 1;
    let cluster = |question: usize| {
        if walks {
            episodes[&*topics[question].episode]
        } else {
            question
        }
    };
    let mut by_subject = BTreeMap::<&Subject, Vec<&ScoredAnswer>>::new();
    for answer in answers {
        by_subject.entry(&answer.subject).or_default().push(answer);
    }
    let groups = groups(topics);
    let (mut cells, mut changes) = (Vec::new(), Vec::new());
    for (subject, answers) in &by_subject {
        for group in &groups {
            let of = |answer: &&&ScoredAnswer| group.has(&topics[answer.question]);
            let here: Vec<&ScoredAnswer> = answers.iter().filter(of).copied().collect();
            cells.push(cell(subject, group, &here, cluster));
        }
        for (against, other) in others(subject) {
            let Some(theirs) = by_subject.get(&other) else {
                continue;
            };
            for group in &groups {
                let is_of = |question: usize| group.has(&topics[question]);
                let difference = change(answers, theirs, is_of, cluster);
                changes.extend(difference.map(|difference| ScoreChange {
                    subject: (*subject).clone(),
                    against,
                    group: group.clone(),
                    difference,
                }));
            }
        }
    }
    OpenSummary {
        unit: if walks { "episode" } else { "question" },
        clusters: if walks { episodes.len() } else { topics.len() },
        cells,
        changes,
    }
}
