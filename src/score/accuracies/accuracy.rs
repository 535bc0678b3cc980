//! Accuracy of each model in each condition: [`AccuracySummary`].
//!
//! Items that all models were asked: [`CommonItems`].
//!
//! Accuracy of uniform guesses: [`chance`].

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;
use serde::Serialize;

use super::balance::{UnbalancedFamily, balanced_accuracy};
use super::health::{Health, healths};
use crate::choice::ParsingMode;
use crate::estimate::{ClusterCount, Estimate};
use crate::grid::{Grid, GridItem};
use crate::model_in_condition::{CHANCE, ModelInCondition};
use darkqa_base::types::{AskedItem, Family, Question, QuestionId, UnreadReason, Variant, View};

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
        unparsed += usize::from(result.parsed(mode) == Some(None) && !cannot_tell(grid, subject, index));
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
        let Some(chosen) = result.parsed(mode) else {
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

/// Number of questions that a model was asked, in any condition.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AskedQuestions {
    pub model: String,
    /// True if the model was asked without images.
    pub is_blind: bool,
    /// Number of questions.
    pub questions: usize,
}

/// Items that models share although they were not asked the same questions.
#[derive(Debug, Clone, PartialEq)]
pub struct CommonItems {
    /// Number of questions of each model, with and without images.
    pub asked: Vec<AskedQuestions>,
    /// Number of questions that at least one model was asked.
    pub questions: usize,
    /// Number of questions to which every model with images replied.
    pub shared_questions: usize,
    /// Accuracies on the items to which every model with images replied, with chance on the same items.
    pub summary: AccuracySummary,
}

impl CommonItems {
    /// Finds the common items of a grid; `None` if all models were asked the same questions.
    #[must_use]
    pub fn new(grid: &Grid<'_>) -> Option<Self> {
        let all: BTreeSet<&QuestionId> = grid.items.iter().map(|item| &*item.asked.question).collect();
        let mut asked = BTreeMap::<(bool, &str), BTreeSet<&QuestionId>>::new();
        for (index, subject) in model_subjects(grid) {
            let model = (subject.view == Some(View::Blind), &*subject.model);
            let questions = asked.entry(model).or_default();
            if questions.len() == all.len() {
                continue;
            }
            let items = grid.items.iter().enumerate().filter(|(item, _)| grid.trial(index, *item).is_some());
            questions.extend(items.map(|(_, item)| &*item.asked.question));
        }
        if asked.values().all(|questions| questions.len() == all.len()) {
            return None;
        }
        let shared = shared_items(grid);
        let restricted = grid.select_items(&shared);
        let offers: Vec<OfferedChoices> =
            restricted.items.iter().map(|item| OfferedChoices::from_item(item.asked)).collect();
        let shared_questions: BTreeSet<&QuestionId> =
            restricted.items.iter().map(|item| &*item.asked.question).collect();
        Some(Self {
            asked: asked
                .into_iter()
                .map(|((is_blind, model), questions)| AskedQuestions {
                    model: model.to_owned(),
                    is_blind,
                    questions: questions.len(),
                })
                .collect(),
            questions: all.len(),
            shared_questions: shared_questions.len(),
            summary: summarize(&restricted, &healths(&restricted), offers),
        })
    }
}

/// Subjects with their indices. People are left out if there are models.
fn model_subjects<'g>(grid: &'g Grid<'_>) -> impl Iterator<Item = (usize, &'g ModelInCondition)> {
    let models = grid.subjects.iter().map(|subject| &*subject.model);
    let models: BTreeSet<&str> = grid.listing.without_people(models).into_iter().collect();
    grid.subjects.iter().enumerate().filter(move |(_, subject)| models.contains(&*subject.model))
}

/// For each item, returns whether every model with images replied to it, in any condition. Models without any reply do
/// not count, and people count only if there are no models.
#[must_use]
pub fn shared_items(grid: &Grid<'_>) -> Vec<bool> {
    let mut models = BTreeMap::<&str, Vec<bool>>::new();
    for (index, subject) in model_subjects(grid) {
        if subject.view != Some(View::Image) {
            continue;
        }
        let replied = models.entry(&subject.model).or_insert_with(|| vec![false; grid.items.len()]);
        for (item, replied) in replied.iter_mut().enumerate() {
            *replied |= grid.compared_result(index, item).is_reply();
        }
    }
    models.retain(|_, replied| replied.contains(&true));
    (0..grid.items.len()).map(|item| models.values().all(|replied| replied[item])).collect()
}

/// Family of a question, number of choices, and number of their orders that are asked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OfferedChoices {
    /// Family of the question.
    pub family: Family,
    /// Number of its choices.
    pub choices: usize,
    /// Number of orders of the choices; each counts as one question.
    pub orders: usize,
}

impl OfferedChoices {
    /// Creates the entry of an item.
    pub fn from_item(item: &AskedItem) -> Self {
        Self { family: item.family.as_ref().clone(), choices: item.choices.len(), orders: 1 }
    }
}

impl From<&Question> for OfferedChoices {
    fn from(question: &Question) -> Self {
        Self { family: question.family.clone(), choices: question.choices.len(), orders: 1 }
    }
}

/// Exact accuracy of a uniform guess: the mean of 1 / number of choices over all orders that are asked. `None` without
/// questions.
///
/// Questions are grouped by their number of choices, so that their order cannot change the rounding of the sum.
pub(crate) fn chance<'a>(questions: impl IntoIterator<Item = &'a OfferedChoices>) -> Option<Estimate> {
    mean(questions, |question| question.orders)
}

/// Accuracy of a uniform guess with each question counted once, as in the paper (DarkQA, section IV); `None` if it
/// equals [`chance`]. The two differ if several orders are asked, because a question with many choices has many orders.
pub(crate) fn chance_of_questions<'a>(
    questions: impl IntoIterator<Item = &'a OfferedChoices> + Clone,
) -> Option<Estimate> {
    let once = mean(questions.clone(), |_| 1)?;
    let all = chance(questions)?;
    ((once.value - all.value).abs() > 1e-9).then_some(once)
}

fn mean<'a>(
    questions: impl IntoIterator<Item = &'a OfferedChoices>,
    weight: fn(&OfferedChoices) -> usize,
) -> Option<Estimate> {
    let mut counts = std::collections::BTreeMap::<usize, usize>::new();
    for question in questions {
        *counts.entry(question.choices).or_default() += weight(question);
    }
    let n: usize = counts.values().sum();
    let sum: f64 = counts.iter().map(|(&choices, &questions)| questions as f64 / choices as f64).sum();
    (n > 0).then(|| Estimate::exact(sum / n as f64, n))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn question(choices: usize) -> OfferedChoices {
        OfferedChoices { family: Family::Closest, choices, orders: 1 }
    }

    /// A question that is asked once for each rotation of its choices.
    fn rotated(choices: usize) -> OfferedChoices {
        OfferedChoices { orders: choices, ..question(choices) }
    }

    #[test]
    fn with_all_orders_long_questions_count_more() {
        let questions = [rotated(2), rotated(4)];
        assert_eq!(chance(&questions).unwrap(), Estimate::exact(2.0 / 6.0, 6));
        assert_eq!(chance_of_questions(&questions).unwrap(), Estimate::exact(0.375, 2));
        assert_eq!(chance_of_questions(&[rotated(4), rotated(4)]), None);
        assert_eq!(chance_of_questions(&[question(2), question(4)]), None);
    }

    #[test]
    fn chance_is_the_mean_of_one_over_the_choices() {
        let questions = [question(2), question(4), question(2)];
        assert_eq!(chance(&questions).unwrap(), Estimate::exact(1.25 / 3.0, 3));
        assert_eq!(chance([]), None);
    }
}
