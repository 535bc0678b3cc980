//! A model's own answers in the light ([`LightAnswers`]), and trials held against them.

use std::collections::{HashMap, HashSet};

use crate::choice::ReadingMode;
use crate::estimate::Estimate;
use darkqa_ground::types::questions::CANNOT_TELL;
use darkqa_ground::types::{
    ChoiceDetail, Condition, QuestionId, RunGroup, Treatment, TrialRef, Trials, UnreadReason, View,
};

/// Identity of a question for a model: its name, and the order of its choices.
type QuestionKey<'a> = (&'a QuestionId, &'a [String]);

/// The replies of one model at L0, each question once: the reference for its other replies.
pub(super) struct LightAnswers<'a> {
    model: &'a str,
    by_question: HashMap<QuestionKey<'a>, Vec<TrialRef<'a>>>,
}

/// Counts of a model's replies in the light.
#[derive(Debug, Clone, PartialEq)]
pub struct LightReplies {
    pub model: String,
    /// How the replies were read.
    pub mode: ReadingMode,
    /// Number of questions about images that were asked at L0.
    pub asked: usize,
    /// Share of the replies in which an answer could be read; `None` without a reply. Its `n` is the number of replies.
    pub read: Option<Estimate>,
    /// Number of replies that refuse.
    pub refused: usize,
    /// Number of replies “cannot tell from the image”.
    pub cannot_tell: usize,
    /// Whether the questions have such a choice.
    pub has_way_out: bool,
}

impl LightReplies {
    /// Whether no answer could be read in any reply.
    pub fn is_unread(&self) -> bool {
        self.read.is_none_or(|read| read.value <= 0.0)
    }

    /// Number of replies.
    pub fn replies(&self) -> usize {
        self.read.map_or(0, |read| read.n)
    }
}

/// Whether a trial is about an untouched image, without an enhancer.
pub(super) fn is_light(trial: TrialRef<'_>) -> bool {
    let condition = trial.condition();
    trial.view() == View::Image && condition.is_some_and(is_untouched)
}

fn is_untouched(condition: &Condition) -> bool {
    condition.treatment == Treatment::Untouched && condition.enhancer.is_none()
}

/// The index of the choice that a reading of a trial names; `None` if it names none.
pub(super) fn chosen(trial: TrialRef<'_>, mode: ReadingMode) -> Option<usize> {
    let reading = match mode {
        ReadingMode::Strict => trial.strict(),
        ReadingMode::Lenient => trial.lenient(),
    };
    reading?.chosen
}

/// Whether a choice is the way out of its question.
pub(super) fn is_way_out(choice: &str) -> bool {
    choice.trim().eq_ignore_ascii_case(CANNOT_TELL)
}

/// Whether a reply refuses, or was withheld.
pub(super) fn is_refused(trial: TrialRef<'_>) -> bool {
    let why = trial.strict().and_then(|reading| reading.why);
    matches!(why, Some(UnreadReason::Refused | UnreadReason::Filtered))
}

impl<'a> LightAnswers<'a> {
    /// The first reply of a model to each question at L0.
    pub(super) fn new(trials: &'a Trials<ChoiceDetail>, model: &'a str) -> Self {
        let mut by_question = HashMap::<QuestionKey<'a>, Vec<TrialRef<'a>>>::new();
        for trial in trials
            .iter()
            .filter(|trial| trial.model() == model)
            .filter(|trial| is_light(*trial) && trial.repeat() == 0)
        {
            let key = (trial.question(), trial.choices());
            by_question.entry(key).or_default().push(trial);
        }
        Self { model, by_question }
    }

    /// The first replies, in no order.
    pub(super) fn first(&self) -> impl Iterator<Item = TrialRef<'a>> + '_ {
        self.by_question
            .values()
            .filter_map(|trials| trials.first().copied())
    }

    /// The choice that the model named at L0; `None` if no choice could be read there.
    fn reference(&self, trial: TrialRef<'_>, mode: ReadingMode) -> Option<usize> {
        let key = (trial.question(), trial.choices());
        let group = |trial: TrialRef<'_>| trial.condition().and_then(|at| at.group.clone());
        let own = group(trial);
        let mut light = self.by_question.get(&key)?.iter();
        let met = light.find(|light| RunGroup::meet(group(**light).as_ref(), own.as_ref()));
        chosen(*met?, mode)
    }

    /// The trials of the model with its own answer at L0 in the place of the truth. A question without such an answer is left out.
    ///
    /// The first trial at L0 is the reference itself and left out; the one after it, where the question was asked again, takes its
    /// place, so that it is paired with the first trial of every other condition.
    pub(super) fn held_against(
        &self,
        trials: &'a Trials<ChoiceDetail>,
        mode: ReadingMode,
    ) -> Trials<ChoiceDetail> {
        let held = trials
            .iter()
            .filter(|trial| trial.model() == self.model)
            .filter_map(|trial| {
                let repeat = if is_light(trial) {
                    trial.repeat().checked_sub(1)?
                } else {
                    trial.repeat()
                };
                Some((trial, repeat, self.reference(trial, mode)?))
            });
        all_held(held)
    }

    /// The first readable trials of another model at L0, with the answers of this one in the place of the truth.
    pub(super) fn held_against_other(
        &self,
        trials: &'a Trials<ChoiceDetail>,
        other: &str,
        mode: ReadingMode,
    ) -> Trials<ChoiceDetail> {
        let held = trials
            .iter()
            .filter(|trial| trial.model() == other && is_light(*trial))
            .filter(|trial| trial.repeat() == 0)
            .filter(|trial| chosen(*trial, mode).is_some())
            .filter_map(|trial| Some((trial, 0, self.reference(trial, mode)?)));
        all_held(held)
    }

    /// Counts the replies in the light, in a reading.
    pub(super) fn replies(&self, mode: ReadingMode) -> LightReplies {
        let replied: Vec<TrialRef<'_>> = self.first().filter(|trial| !trial.failed()).collect();
        let read = replied
            .iter()
            .filter(|trial| chosen(**trial, mode).is_some());
        let way_out = |trial: &&TrialRef<'_>| {
            let choice = chosen(**trial, mode).and_then(|index| trial.choices().get(index));
            choice.is_some_and(|choice| is_way_out(choice))
        };
        LightReplies {
            model: self.model.to_owned(),
            mode,
            asked: self.by_question.len(),
            read: Estimate::share(read.count(), replied.len()),
            refused: replied.iter().filter(|trial| is_refused(**trial)).count(),
            cannot_tell: replied.iter().filter(way_out).count(),
            has_way_out: self.has_way_out(),
        }
    }

    fn has_way_out(&self) -> bool {
        let lists: HashSet<&[String]> = self
            .by_question
            .keys()
            .map(|(_, choices)| *choices)
            .collect();
        lists
            .iter()
            .any(|choices| choices.iter().any(|choice| is_way_out(choice)))
    }
}

/// Trials of other numbers of repeats, each with an answer in the light in the place of the truth.
fn all_held<'t>(held: impl Iterator<Item = (TrialRef<'t>, u32, usize)>) -> Trials<ChoiceDetail> {
    let mut trials = Trials::default();
    for (trial, repeat, reference) in held {
        trials.hold(trial, repeat, reference);
    }
    trials
}
