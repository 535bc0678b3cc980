//! Answers of a model to each question of a bank at L0: [`QuestionInLight`].

use std::collections::BTreeMap;

use super::bank_index::BankIndex;
use super::light::{LightAnswers, chosen};
use crate::choice::ParsingMode;
use darkqa_base::types::Family;

/// Share of the most common answer from which a question is uninformative (chosen).
pub const UNINFORMATIVE: f64 = 0.95;

/// Answers of a model to one question of the bank at L0, over all images.
#[derive(Debug, Clone, PartialEq)]
pub struct QuestionInLight {
    pub model: String,
    /// Index among the questions of the bank.
    pub(super) index: usize,
    /// Name of the question in the bank.
    pub bank_id: String,
    pub text: String,
    pub family: Family,
    /// Number of images with a readable answer.
    pub images: usize,
    /// Most common answer, the first by name of several; empty without a readable answer.
    pub top: String,
    /// Share of the images with that answer; 0 without a readable answer.
    pub top_share: f64,
    /// Entropy of the answers, 0 to 1; `None` without a readable answer.
    pub entropy: Option<f64>,
}

impl QuestionInLight {
    /// True if the answers differ between images. Otherwise agreement is no evidence.
    pub fn is_informative(&self) -> bool {
        self.images > 0 && self.top_share < UNINFORMATIVE
    }
}

/// Counts the answers of a model at L0 to every question of the bank, in the order of the bank.
pub(super) fn questions_in_light(
    model: &str,
    answers: &LightAnswers<'_>,
    bank: &BankIndex<'_>,
    mode: ParsingMode,
) -> Vec<QuestionInLight> {
    let mut counts = BTreeMap::<usize, BTreeMap<&str, usize>>::new();
    for trial in answers.first().filter(|trial| !trial.failed()) {
        let Some(question) = bank.position(trial.question()) else {
            continue;
        };
        let counts = counts.entry(question).or_default();
        let choice = chosen(trial, mode).and_then(|index| trial.choices().get(index));
        if let Some(choice) = choice {
            *counts.entry(choice).or_default() += 1;
        }
    }
    counts
        .into_iter()
        .map(|(index, counts)| {
            let example = bank.examples[index];
            let images = counts.values().sum();
            let top = counts.iter().rev().max_by_key(|(_, count)| **count);
            QuestionInLight {
                model: model.to_owned(),
                index,
                bank_id: example.bank_id().to_owned(),
                text: example.text.clone(),
                family: example.family.clone(),
                images,
                top: top.map_or_else(String::new, |(top, _)| (*top).to_owned()),
                top_share: top.map_or(0.0, |(_, count)| *count as f64 / images as f64),
                entropy: entropy(counts.values().copied(), example.choices.len()),
            }
        })
        .collect()
}

/// Shannon entropy of counts, relative to that of `choices` equally frequent answers: 0 if all answers are the same, 1
/// if all choices are equally frequent. `None` without counts.
pub(super) fn entropy(counts: impl Iterator<Item = usize> + Clone, choices: usize) -> Option<f64> {
    let all: usize = counts.clone().sum();
    if all == 0 {
        return None;
    }
    let entropy: f64 = counts
        .filter(|count| *count > 0)
        .map(|count| {
            let share = count as f64 / all as f64;
            -share * libm::log(share)
        })
        .sum();
    // Adding 0 turns −0 into 0.
    Some((entropy + 0.0) / libm::log(choices as f64))
}
