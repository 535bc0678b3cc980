//! The accuracy of each model in each condition: [`AccuracySummary`].

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::chance::{OfferedChoices, chance};
use super::choice::ReadingMode;
use super::estimate::Estimate;
use super::grid::{ClusterCount, Grid, TrialResult};
use super::health::Health;
use super::subject::{CHANCE, Subject};
use crate::types::{Family, KindReading, QuestionId, UnreadReason};

/// The accuracy of one subject on one family, in one reading.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AccuracyCell {
    /// What it is about.
    #[serde(flatten)]
    pub subject: Subject,
    /// The family; `None` for all together.
    pub family: Option<Family>,
    /// How the replies were read.
    pub mode: ReadingMode,
    /// Replies that named the true choice.
    pub right: usize,
    /// Replies in which no choice could be read: they count as wrong.
    pub unparsed: usize,
    /// Trials without a reply: they do not count.
    pub failed: usize,
    /// The share of right ones among the replies; `None` where none came.
    pub accuracy: Option<Estimate>,
    /// The share of questions answered rightly every time, where some were asked more than once: in every order of their
    /// choices (MMBench's circular evaluation, Liu et al. 2023, arXiv:2307.06281, section 4.2) and every repeat.
    pub always: Option<Estimate>,
}

impl AccuracyCell {
    /// How many replies stand behind the accuracy.
    #[must_use]
    pub fn replies(&self) -> usize {
        self.accuracy.map_or(0, |accuracy| accuracy.n)
    }
}

/// All cells of a run, ordered by subject, family and reading.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AccuracySummary {
    /// The cells.
    pub cells: Vec<AccuracyCell>,
    /// Why replies were unparsed in the strict reading, and how many.
    pub unread: BTreeMap<UnreadReason, usize>,
}

impl AccuracySummary {
    /// The cells of a family in one reading; of `None` those of all families together.
    pub fn of<'s>(
        &'s self,
        family: Option<&'s Family>,
        mode: ReadingMode,
    ) -> impl Iterator<Item = &'s AccuracyCell> + Clone {
        let cells = self.cells.iter();
        cells.filter(move |cell| cell.mode == mode && cell.family.as_ref() == family)
    }

    /// The cell of a subject.
    #[must_use]
    pub fn cell(
        &self,
        subject: &Subject,
        family: Option<&Family>,
        mode: ReadingMode,
    ) -> Option<&AccuracyCell> {
        self.cells.iter().find(|cell| {
            cell.mode == mode && cell.family.as_ref() == family && cell.subject == *subject
        })
    }
}

/// Scores the items of a run; `health` is that of its subjects, and `questions` are what it asks, for the chance line.
#[must_use]
pub(crate) fn summarize(
    grid: &Grid<'_>,
    health: &[Health],
    questions: impl IntoIterator<Item = OfferedChoices>,
) -> AccuracySummary {
    let questions: Vec<OfferedChoices> = questions.into_iter().collect();
    let families = grid.groups();
    let mut cells = Vec::new();
    for subject in 0..grid.subjects.len() {
        for family in &families {
            cells.extend(ReadingMode::ALL.map(|mode| cell(grid, subject, *family, mode)));
        }
    }
    // A family that a subject was not asked about has no cell.
    cells.retain(|cell| cell.accuracy.is_some() || cell.failed > 0);
    cells.extend(guesses(&questions));
    AccuracySummary {
        cells,
        unread: unread(health),
    }
}

/// Why replies could not be read, in the strict reading.
fn unread(health: &[Health]) -> BTreeMap<UnreadReason, usize> {
    let mut unread = BTreeMap::new();
    for (why, count) in health.iter().flat_map(|health| &health.unread) {
        *unread.entry(*why).or_default() += count;
    }
    unread
}

fn cell(
    grid: &Grid<'_>,
    subject: usize,
    family: Option<&Family>,
    mode: ReadingMode,
) -> AccuracyCell {
    let (mut unparsed, mut failed) = (0, 0);
    for (_, mark) in grid.of_family(subject, family) {
        failed += usize::from(mark == TrialResult::Failed);
        unparsed += usize::from(mark.reading(mode) == Some(None));
    }
    let counts = grid.counts(subject, family, mode);
    AccuracyCell {
        subject: grid.subjects[subject].clone(),
        family: family.cloned(),
        mode,
        right: counts.iter().map(|count| count.right as usize).sum(),
        unparsed,
        failed,
        accuracy: Estimate::clustered(&counts),
        always: always(grid, subject, family, mode),
    }
}

/// The share of questions that were answered rightly every time; `None` where all were asked once.
fn always(
    grid: &Grid<'_>,
    subject: usize,
    family: Option<&Family>,
    mode: ReadingMode,
) -> Option<Estimate> {
    // Items of a question stand together.
    let mut questions = BTreeMap::<(u32, &QuestionId), ClusterCount>::new();
    for (item, mark) in grid.of_family(subject, family) {
        if let Some(chosen) = mark.reading(mode) {
            let count = questions
                .entry((item.cluster, &item.record.question))
                .or_default();
            count.replies += 1;
            count.right += u32::from(item.is_right(chosen));
        }
    }
    if questions.values().all(|count| count.replies == 1) {
        return None;
    }
    let mut clusters = vec![ClusterCount::default(); grid.clusters];
    for ((cluster, _), count) in questions {
        let cluster = &mut clusters[cluster as usize];
        cluster.replies += 1;
        cluster.right += u32::from(count.right == count.replies);
    }
    Estimate::clustered(&clusters)
}

fn guesses(questions: &[OfferedChoices]) -> Vec<AccuracyCell> {
    let families: BTreeSet<&Family> = questions.iter().map(|question| &question.family).collect();
    let groups = std::iter::once(None).chain(families.into_iter().map(Some));
    let cells = groups.flat_map(|family| {
        let asked = questions
            .iter()
            .filter(|question| family.is_none_or(|family| question.family == *family));
        let accuracy = chance(asked);
        ReadingMode::ALL.map(|mode| AccuracyCell {
            subject: Subject {
                model: CHANCE.to_owned(),
                view: None,
                level: None,
                variant: KindReading::NONE,
                enhancer: None,
            },
            family: family.cloned(),
            mode,
            right: 0,
            unparsed: 0,
            failed: 0,
            accuracy,
            always: None,
        })
    });
    cells.collect()
}
