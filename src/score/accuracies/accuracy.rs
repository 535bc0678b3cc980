//! Accuracy of each model in each condition: [`AccuracySummary`].

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;
use serde::Serialize;

use super::balance::{UnbalancedFamily, balanced_accuracy};
use super::chance::{OfferedChoices, chance, chance_of_questions};
use super::health::Health;
use crate::choice::ParsingMode;
use crate::estimate::{ClusterCount, Estimate};
use crate::grid::{Grid, GridItem};
use crate::model_in_condition::{CHANCE, ModelInCondition};
use darkqa_base::types::{Family, UnreadReason, Variant};

/// Accuracy of one subject on one family in one parsing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AccuracyCell {
    #[serde(flatten)]
    pub subject: ModelInCondition,
    /// Question family; `None` for all families together.
    pub family: Option<Family>,
    /// Parsing of the replies.
    pub mode: ParsingMode,
    /// Number of replies that named the true choice.
    pub right: usize,
    /// Number of unreadable replies. They count as wrong, like “cannot tell” by a person.
    pub unparsed: usize,
    /// Number of trials without a reply. They are not scored.
    pub failed: usize,
    /// Share of right replies among all replies; `None` if there is no reply. Its interval holds for all values of the
    /// missing replies.
    pub accuracy: Option<Estimate>,
    /// Share of questions answered correctly every time: in every order of the choices (MMBench's circular evaluation,
    /// Liu et al. 2023, arXiv:2307.06281, section 4.2) and in every repeat. `None` if each question was asked once.
    pub always: Option<Estimate>,
    /// Accuracy with all true answers weighted alike ([`balanced_accuracy`]); `None` if no family is unbalanced.
    pub balanced: Option<f64>,
}

impl AccuracyCell {
    /// Number of replies behind the accuracy.
    #[must_use]
    pub fn replies(&self) -> usize {
        self.accuracy.map_or(0, |accuracy| accuracy.n)
    }

    /// Accuracy if all missing replies were wrong, and if all were right (the bounds of Manski 1990, Am. Econ. Rev.
    /// 80:319); `None` if no reply is missing, or if there is none.
    #[must_use]
    pub fn bounds(&self) -> Option<[f64; 2]> {
        let all = (self.replies() + self.failed) as f64;
        let has_bounds = self.accuracy.is_some() && self.failed > 0;
        has_bounds.then(|| [self.right, self.right + self.failed].map(|right| right as f64 / all))
    }
}

/// All cells of a run, ordered by subject, family and parsing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AccuracySummary {
    pub cells: Vec<AccuracyCell>,
    /// Number of unreadable replies in the strict parsing, by reason.
    pub unread: BTreeMap<UnreadReason, usize>,
    /// Chance with each question counted once, if several orders of choices are asked and this changes chance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chance_of_questions: Option<Estimate>,
    /// Families with one answer that is true so often that accuracy misleads.
    #[serde(skip)]
    pub unbalanced: Vec<UnbalancedFamily>,
}

impl AccuracySummary {
    /// Cells of a family in one parsing. `None` selects the cells of all families together.
    pub fn family_cells<'s>(
        &'s self,
        family: Option<&'s Family>,
        mode: ParsingMode,
    ) -> impl Iterator<Item = &'s AccuracyCell> + Clone {
        self.cells.iter().filter(move |cell| cell.mode == mode && cell.family.as_ref() == family)
    }

    /// Cell of a subject, family and parsing, if it exists.
    #[must_use]
    pub fn cell(
        &self,
        subject: &ModelInCondition,
        family: Option<&Family>,
        mode: ParsingMode,
    ) -> Option<&AccuracyCell> {
        self.cells.iter().find(|cell| cell.mode == mode && cell.family.as_ref() == family && cell.subject == *subject)
    }
}

/// Computes the accuracies of a run. `health` has one entry for each subject; `questions` are all questions of the run,
/// for the chance line.
#[must_use]
pub(crate) fn summarize(
    grid: &Grid<'_>,
    health: &[Health],
    questions: impl IntoIterator<Item = OfferedChoices>,
) -> AccuracySummary {
    let questions: Vec<OfferedChoices> = questions.into_iter().collect();
    let families = grid.groups();
    let unbalanced = UnbalancedFamily::all(grid);
    let imbalance = &unbalanced[..];
    let mut cells: Vec<AccuracyCell> = (0..grid.subjects.len())
        .into_par_iter()
        .flat_map_iter(|subject| {
            families
                .iter()
                .flat_map(move |family| ParsingMode::ALL.map(|mode| cell(grid, subject, *family, mode, imbalance)))
        })
        .collect();
    // A family that a subject was not asked about gets no cell.
    cells.retain(|cell| cell.accuracy.is_some() || cell.failed > 0);
    cells.extend(chance_cells(&questions));
    AccuracySummary { cells, unread: unread(health), chance_of_questions: chance_of_questions(&questions), unbalanced }
}

/// Counts of unreadable replies by reason, in the strict parsing.
fn unread(health: &[Health]) -> BTreeMap<UnreadReason, usize> {
    let mut unread = BTreeMap::new();
    for (reason, count) in health.iter().flat_map(|health| &health.unread) {
        *unread.entry(*reason).or_default() += count;
    }
    unread
}

fn cell(
    grid: &Grid<'_>,
    subject: usize,
    family: Option<&Family>,
    mode: ParsingMode,
    unbalanced: &[UnbalancedFamily],
) -> AccuracyCell {
    let mut unparsed = 0;
    for (index, _) in grid.items.iter().enumerate().filter(|(_, item)| item.is_in_family(family)) {
        let result = grid.result(subject, index);
        unparsed += usize::from(result.reading(mode) == Some(None) && !cannot_tell(grid, subject, index));
    }
    let counts = grid.counts(subject, family, mode);
    let failed = grid.failed(subject, family);
    let is_unbalanced = unbalanced.iter().any(|one| family.is_none_or(|family| one.family == *family));
    AccuracyCell {
        subject: grid.subjects[subject].clone(),
        family: family.cloned(),
        mode,
        right: counts.iter().map(|count| count.right as usize).sum(),
        unparsed,
        failed: failed.iter().map(|count| *count as usize).sum(),
        accuracy: Estimate::with_missing(&counts, &failed),
        always: always(grid, subject, family, mode),
        balanced: is_unbalanced.then(|| balanced_accuracy(grid, subject, family, mode)).flatten(),
    }
}

/// True if a person answered that they cannot tell, which is readable but not a choice.
fn cannot_tell(grid: &Grid<'_>, subject: usize, item: usize) -> bool {
    let trial = grid.trial(subject, item);
    trial.and_then(darkqa_base::types::TrialRef::strict).and_then(|reading| reading.why)
        == Some(UnreadReason::CannotTell)
}

/// Share of questions answered correctly every time; `None` if each question was asked once.
fn always(grid: &Grid<'_>, subject: usize, family: Option<&Family>, mode: ParsingMode) -> Option<Estimate> {
    let mut clusters = vec![ClusterCount::default(); grid.clusters];
    let mut is_once = true;
    let mut add = |cluster: u32, question: ClusterCount| {
        is_once &= question.replies <= 1;
        if question.replies > 0 {
            let cluster = &mut clusters[cluster as usize];
            cluster.replies += 1;
            cluster.right += u32::from(question.right == question.replies);
        }
    };
    // Items of the same question are adjacent.
    let mut last: Option<&GridItem<'_>> = None;
    let mut count = ClusterCount::default();
    for (item, result) in grid.family_items(subject, family) {
        let Some(chosen) = result.reading(mode) else {
            continue;
        };
        if let Some(last) = last.filter(|last| last.asked.question != item.asked.question) {
            add(last.cluster, std::mem::take(&mut count));
        }
        count.replies += 1;
        count.right += u32::from(item.is_right(chosen));
        last = Some(item);
    }
    add(last?.cluster, count);
    if is_once {
        return None;
    }
    Estimate::clustered(&clusters)
}

/// Cells of the chance line: the accuracy of a uniform guess for each family and parsing.
fn chance_cells(questions: &[OfferedChoices]) -> Vec<AccuracyCell> {
    let families: BTreeSet<&Family> = questions.iter().map(|question| &question.family).collect();
    std::iter::once(None)
        .chain(families.into_iter().map(Some))
        .flat_map(|family| {
            let accuracy =
                chance(questions.iter().filter(|question| family.is_none_or(|family| question.family == *family)));
            ParsingMode::ALL.map(|mode| AccuracyCell {
                subject: ModelInCondition {
                    model: CHANCE.to_owned(),
                    view: None,
                    level: None,
                    variant: Variant::NONE,
                    enhancer: None,
                },
                family: family.cloned(),
                mode,
                right: 0,
                unparsed: 0,
                failed: 0,
                accuracy,
                always: None,
                balanced: None,
            })
        })
        .collect()
}
