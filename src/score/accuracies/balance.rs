//! Families whose true answers are unbalanced ([`UnbalancedFamily`]), and the accuracy with all true answers weighted
//! alike ([`balanced_accuracy`]).

use std::collections::{BTreeMap, BTreeSet};

use crate::choice::ParsingMode;
use crate::grid::{Grid, GridItem};
use darkqa_base::types::{Family, QuestionId};

/// Share of one true answer from which a constant reply scores so well that accuracy misleads (chosen).
pub const MAX_ANSWER_SHARE: f64 = 0.6;

/// Minimum distance of that share from guessing (chosen).
const MIN_EXCESS: f64 = 0.2;

/// Minimum number of questions of a family (chosen): among fewer, one answer is common by chance.
const MIN_QUESTIONS: usize = 10;

/// A family with one true answer to [`MAX_ANSWER_SHARE`] of its questions or more, and to 20 points more than guessing
/// would hit.
#[derive(Debug, Clone, PartialEq)]
pub struct UnbalancedFamily {
    pub family: Family,
    /// The commonest true answer, in lower case.
    pub answer: String,
    /// Number of questions with that true answer.
    pub count: usize,
    /// Number of questions.
    pub questions: usize,
}

impl UnbalancedFamily {
    /// Families of a grid with an unbalanced truth, sorted.
    #[must_use]
    pub fn all(grid: &Grid<'_>) -> Vec<Self> {
        let mut seen = BTreeSet::<&QuestionId>::new();
        // Numbers of questions by true answer, and the expected number of right guesses.
        let mut families = BTreeMap::<&Family, (BTreeMap<String, usize>, f64)>::new();
        for item in &grid.items {
            if let (true, Some(answer)) = (seen.insert(&*item.asked.question), true_answer(item)) {
                let (answers, guesses) = families.entry(&*item.asked.family).or_default();
                *answers.entry(answer).or_default() += 1;
                *guesses += 1.0 / item.asked.choices.len() as f64;
            }
        }
        families
            .into_iter()
            .filter_map(|(family, (answers, guesses))| {
                let questions: usize = answers.values().sum();
                // Of equally common answers, the first.
                let (answer, count) = answers.into_iter().rev().max_by_key(|(_, count)| *count)?;
                let all = questions as f64;
                let is_common = count as f64 >= MAX_ANSWER_SHARE * all && count as f64 >= guesses + MIN_EXCESS * all;
                (questions >= MIN_QUESTIONS && is_common).then(|| Self {
                    family: family.clone(),
                    answer,
                    count,
                    questions,
                })
            })
            .collect()
    }

    /// True if the common answer is the true one of an item.
    pub(super) fn is_true_of(&self, item: &GridItem<'_>) -> bool {
        true_answer(item).as_ref() == Some(&self.answer)
    }
}

/// The true answer of an item in lower case.
fn true_answer(item: &GridItem<'_>) -> Option<String> {
    Some(item.asked.choices.get(item.asked.truth?)?.to_lowercase())
}

/// Accuracy of a subject with all true answers of a family weighted alike: the mean over the true answers of the share
/// of right replies (Brodersen et al. 2010, ICPR, p. 3121). Over several families it is their mean, weighted by their
/// replies. It equals the accuracy if every answer of a family is true equally often. `None` without a reply.
#[must_use]
pub(super) fn balanced_accuracy(
    grid: &Grid<'_>,
    subject: usize,
    family: Option<&Family>,
    mode: ParsingMode,
) -> Option<f64> {
    let mut families = BTreeMap::<&Family, BTreeMap<String, [usize; 2]>>::new();
    for (item, result) in grid.family_items(subject, family) {
        if let (Some(chosen), Some(answer)) = (result.parsed(mode), true_answer(item)) {
            let answers = families.entry(&*item.asked.family).or_default();
            let [right, replies] = answers.entry(answer).or_default();
            *right += usize::from(item.is_right(chosen));
            *replies += 1;
        }
    }
    let (mut sum, mut all) = (0.0, 0);
    for answers in families.values() {
        let replies: usize = answers.values().map(|[_, replies]| replies).sum();
        let shares: f64 = answers.values().map(|[right, replies]| *right as f64 / *replies as f64).sum();
        sum += shares / answers.len() as f64 * replies as f64;
        all += replies;
    }
    (all > 0).then(|| sum / all as f64)
}
