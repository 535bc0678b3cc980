//! Items that all models were asked: [`CommonItems`].

use std::collections::{BTreeMap, BTreeSet};

use super::accuracy::{AccuracySummary, summarize};
use super::chance::OfferedChoices;
use super::health::healths;
use crate::grid::Grid;
use crate::model_in_condition::ModelInCondition;
use darkqa_base::types::{QuestionId, View};

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
            *replied |= grid.result(index, item).is_reply();
        }
    }
    models.retain(|_, replied| replied.contains(&true));
    (0..grid.items.len()).map(|item| models.values().all(|replied| replied[item])).collect()
}
