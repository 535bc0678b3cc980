//! A model's own answers at L0 ([`LightAnswers`]), and trials scored against them.
//!
//! Answers of a model to each question of a bank at L0: [`QuestionInLight`].

use std::collections::{BTreeMap, HashMap, HashSet};

use super::bank_index::BankIndex;
use crate::choice::ParsingMode;
use crate::estimate::Estimate;
use darkqa_base::types::questions::CANNOT_TELL;
use darkqa_base::types::{
    ChoiceDetail, Condition, Family, ItemKey, RunGroup, Treatment, TrialRef, Trials, UnreadReason, View,
};

/// The first reply of one model to each question at L0: the reference for its other replies.
pub(super) struct LightAnswers<'a> {
    model: &'a str,
    by_question: HashMap<ItemKey<'a>, Vec<TrialRef<'a>>>,
}

/// Counts of a model's replies at L0.
#[derive(Debug, Clone, PartialEq)]
pub struct LightReplies {
    pub model: String,
    /// Parsing of the replies.
    pub mode: ParsingMode,
    /// Number of questions about images that were asked at L0.
    pub asked: usize,
    /// Share of readable replies; `None` without a reply. Its `n` is the number of replies.
    pub read: Option<Estimate>,
    /// Number of refusals.
    pub refused: usize,
    /// Number of replies “cannot tell from the image”.
    pub cannot_tell: usize,
    /// True if the questions have this choice.
    pub offers_cannot_tell: bool,
}

impl LightReplies {
    /// True if no reply is readable.
    pub fn is_unread(&self) -> bool {
        self.read.is_none_or(|read| read.value <= 0.0)
    }

    /// Number of replies.
    pub fn replies(&self) -> usize {
        self.read.map_or(0, |read| read.n)
    }
}

/// True if a trial is about an untouched image without an enhancer.
pub(super) fn is_light(trial: TrialRef<'_>) -> bool {
    let condition = trial.condition();
    trial.view() == View::Image && condition.is_some_and(is_untouched)
}

fn is_untouched(condition: &Condition) -> bool {
    condition.treatment == Treatment::Untouched && condition.enhancer.is_none()
}

/// Index of the choice parsed from the reply of a trial; `None` if no choice could be parsed.
pub(super) fn chosen(trial: TrialRef<'_>, mode: ParsingMode) -> Option<usize> {
    let reading = match mode {
        ParsingMode::Strict => trial.strict(),
        ParsingMode::Lenient => trial.lenient(),
    };
    reading?.chosen
}

/// True if a choice is “cannot tell from the image”.
pub(super) fn is_cannot_tell(choice: &str) -> bool {
    choice.trim().eq_ignore_ascii_case(CANNOT_TELL)
}

/// True if a reply is a refusal or was filtered.
pub(super) fn is_refused(trial: TrialRef<'_>) -> bool {
    let why = trial.strict().and_then(|reading| reading.why);
    matches!(why, Some(UnreadReason::Refused | UnreadReason::Filtered))
}

impl<'a> LightAnswers<'a> {
    /// Collects the replies of a model at L0.
    pub(super) fn new(trials: &'a Trials<ChoiceDetail>, model: &'a str) -> Self {
        let mut by_question = HashMap::<ItemKey<'a>, Vec<TrialRef<'a>>>::new();
        for trial in
            trials.iter().filter(|trial| trial.model() == model).filter(|trial| is_light(*trial) && trial.repeat() == 0)
        {
            let key = question_key(trial);
            by_question.entry(key).or_default().push(trial);
        }
        Self { model, by_question }
    }

    /// First reply to each question, in arbitrary order.
    pub(super) fn first(&self) -> impl Iterator<Item = TrialRef<'a>> + '_ {
        self.by_question.values().filter_map(|trials| trials.first().copied())
    }

    /// Choice of the model at L0 for the question of a trial; `None` if it is unreadable or missing.
    fn reference(&self, trial: TrialRef<'_>, mode: ParsingMode) -> Option<usize> {
        let key = question_key(trial);
        let own = run_group(trial);
        let light = self.by_question.get(&key)?.iter().find(|light| RunGroup::overlap(run_group(**light), own))?;
        chosen(*light, mode)
    }

    /// Returns the trials of the model with its own answer at L0 as the truth. Questions without such an answer are
    /// left out.
    ///
    /// The first trial at L0 is the reference itself and is left out. If the question was asked again, the second trial
    /// takes its place, so that it is paired with the first trial of every other condition.
    pub(super) fn scored_against_light(
        &self,
        trials: &'a Trials<ChoiceDetail>,
        mode: ParsingMode,
    ) -> Trials<ChoiceDetail> {
        let scored = trials.iter().filter(|trial| trial.model() == self.model).filter_map(|trial| {
            let repeat = if is_light(trial) { trial.repeat().checked_sub(1)? } else { trial.repeat() };
            Some((trial, repeat, self.reference(trial, mode)?))
        });
        with_references(scored)
    }

    /// Returns the first readable trials of another model at L0, with the answers of this model as the truth.
    pub(super) fn scored_against_other(
        &self,
        trials: &'a Trials<ChoiceDetail>,
        other: &str,
        mode: ParsingMode,
    ) -> Trials<ChoiceDetail> {
        let scored = trials
            .iter()
            .filter(|trial| trial.model() == other && is_light(*trial))
            .filter(|trial| trial.repeat() == 0)
            .filter(|trial| chosen(*trial, mode).is_some())
            .filter_map(|trial| Some((trial, 0, self.reference(trial, mode)?)));
        with_references(scored)
    }

    /// Counts the replies at L0, in one parsing.
    pub(super) fn replies(&self, mode: ParsingMode) -> LightReplies {
        let replied: Vec<TrialRef<'_>> = self.first().filter(|trial| !trial.failed()).collect();
        let read = replied.iter().filter(|trial| chosen(**trial, mode).is_some()).count();
        LightReplies {
            model: self.model.to_owned(),
            mode,
            asked: self.by_question.len(),
            read: Estimate::share(read, replied.len()),
            refused: replied.iter().filter(|trial| is_refused(**trial)).count(),
            cannot_tell: replied
                .iter()
                .filter_map(|trial| trial.choices().get(chosen(*trial, mode)?))
                .filter(|choice| is_cannot_tell(choice))
                .count(),
            offers_cannot_tell: self.offers_cannot_tell(),
        }
    }

    fn offers_cannot_tell(&self) -> bool {
        let lists: HashSet<&[String]> = self.by_question.keys().map(|key| key.choices).collect();
        lists.iter().any(|choices| choices.iter().any(|choice| is_cannot_tell(choice)))
    }
}

/// Identity of the item of a trial, without its repeat.
fn question_key(trial: TrialRef<'_>) -> ItemKey<'_> {
    ItemKey { repeat: 0, ..trial.item().key() }
}

fn run_group(trial: TrialRef<'_>) -> Option<&RunGroup> {
    trial.condition()?.group.as_ref()
}

/// Copies trials, each with a new repeat number and a reference answer as the truth.
fn with_references<'t>(scored: impl Iterator<Item = (TrialRef<'t>, u32, usize)>) -> Trials<ChoiceDetail> {
    let mut trials = Trials::default();
    for (trial, repeat, reference) in scored {
        trials.add_scored_against(trial, repeat, reference);
    }
    trials
}

/// Share of the most common answer from which a question is uninformative (chosen).
const UNINFORMATIVE: f64 = 0.95;

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
                bank_id: example.bank_id().into_owned(),
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
