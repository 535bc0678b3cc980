//! A model's own answers in the light ([`LightAnswers`]), and records held against them.

use std::collections::{HashMap, HashSet};

use crate::score::choice::ReadingMode;
use crate::score::estimate::Estimate;
use crate::types::question::CANNOT_TELL;
use crate::types::{
    AnswerReading, ChoiceDetail, Condition, LightGroup, QuestionId, Record, Treatment,
    TrialOutcome, UnreadReason, View,
};

/// What identifies a question to a model: its name, and the order of its choices.
type QuestionKey<'a> = (&'a QuestionId, &'a [String]);

/// The replies of one model at L0, each question once: the reference of everything else that it says.
pub(super) struct LightAnswers<'a> {
    model: &'a str,
    by_question: HashMap<QuestionKey<'a>, Vec<&'a Record>>,
}

/// What became of the questions to a model in the light.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LightReplies {
    pub(crate) model: String,
    /// How the replies were read.
    pub(crate) mode: ReadingMode,
    /// Number of questions about images that were asked at L0.
    pub(crate) asked: usize,
    /// Share of the replies in which an answer could be read; `None` without a reply. Its `n` is the number of replies.
    pub(crate) read: Option<Estimate>,
    /// Number of replies that refuse.
    pub(crate) refused: usize,
    /// Number of replies that say that the image does not tell.
    pub(crate) cannot_tell: usize,
    /// Whether the questions have such a choice.
    pub(crate) has_way_out: bool,
}

impl LightReplies {
    /// Whether no answer could be read in any reply.
    pub(crate) fn is_unread(&self) -> bool {
        self.read.is_none_or(|read| read.value <= 0.0)
    }

    /// Number of replies.
    pub(crate) fn replies(&self) -> usize {
        self.read.map_or(0, |read| read.n)
    }
}

/// Whether a record is about an untouched image, without an enhancer.
pub(super) fn is_light(record: &Record) -> bool {
    let condition = record.condition.as_ref();
    record.view == View::Image && condition.is_some_and(is_untouched)
}

fn is_untouched(condition: &Condition) -> bool {
    condition.treatment == Treatment::Untouched && condition.enhancer.is_none()
}

/// The index of the choice that a reading of a record names; `None` if it names none.
pub(super) fn chosen(record: &Record, mode: ReadingMode) -> Option<usize> {
    let reading = match mode {
        ReadingMode::Strict => record.detail.strict,
        ReadingMode::Lenient => record.detail.lenient,
    };
    reading?.chosen
}

/// Whether a choice is the way out of its question.
pub(super) fn is_way_out(choice: &str) -> bool {
    choice.trim().eq_ignore_ascii_case(CANNOT_TELL)
}

/// Whether a reply refuses, or was withheld.
pub(super) fn is_refused(record: &Record) -> bool {
    let why = record.detail.strict.and_then(|reading| reading.why);
    matches!(why, Some(UnreadReason::Refused | UnreadReason::Filtered))
}

impl<'a> LightAnswers<'a> {
    /// The first reply of a model to each question at L0.
    pub(super) fn of(records: &'a [Record], model: &'a str) -> Self {
        let mut by_question = HashMap::<QuestionKey<'a>, Vec<&'a Record>>::new();
        let of_model = records.iter().filter(|record| record.model == model);
        let first = of_model.filter(|record| is_light(record) && record.detail.repeat == 0);
        for record in first {
            let key = (&record.question, record.detail.choices.as_slice());
            by_question.entry(key).or_default().push(record);
        }
        Self { model, by_question }
    }

    /// The first replies, in no order.
    pub(super) fn first(&self) -> impl Iterator<Item = &'a Record> + '_ {
        let lists = self.by_question.values();
        lists.filter_map(|records| records.first().copied())
    }

    /// The choice that the model named at L0; `None` if no choice could be read there.
    fn reference(&self, record: &Record, mode: ReadingMode) -> Option<usize> {
        let key = (&record.question, record.detail.choices.as_slice());
        let group = |record: &Record| record.condition.as_ref().and_then(|at| at.group.clone());
        let own = group(record);
        let mut light = self.by_question.get(&key)?.iter();
        let met = light.find(|light| LightGroup::meet(group(light).as_ref(), own.as_ref()));
        chosen(met?, mode)
    }

    /// The records of the model with its own answer at L0 in the place of the truth. A question without such an answer is left out.
    ///
    /// The first record at L0 is the reference itself and left out; the one after it, where the question was asked again, takes its
    /// place, so that it is paired with the first record of every other condition.
    pub(super) fn held_against(&self, records: &'a [Record], mode: ReadingMode) -> Vec<Record> {
        let of_model = records.iter().filter(|record| record.model == self.model);
        let held = of_model.filter_map(|record| {
            let repeat = if is_light(record) {
                record.detail.repeat.checked_sub(1)?
            } else {
                record.detail.repeat
            };
            Some(held(record, repeat, self.reference(record, mode)?))
        });
        held.collect()
    }

    /// The first readable records of another model at L0, with the answers of this one in the place of the truth.
    pub(super) fn held_against_other(
        &self,
        records: &'a [Record],
        other: &str,
        mode: ReadingMode,
    ) -> Vec<Record> {
        let light = records
            .iter()
            .filter(|record| record.model == other && is_light(record));
        let first = light.filter(|record| record.detail.repeat == 0);
        let read = first.filter(|record| chosen(record, mode).is_some());
        let held = read.filter_map(|record| Some(held(record, 0, self.reference(record, mode)?)));
        held.collect()
    }

    /// What became of the questions in the light, in a reading.
    pub(super) fn replies(&self, mode: ReadingMode) -> LightReplies {
        let replied: Vec<&Record> = self.first().filter(|record| !record.failed()).collect();
        let read = replied
            .iter()
            .filter(|record| chosen(record, mode).is_some());
        let way_out = |record: &&&Record| {
            let choice = chosen(record, mode).and_then(|index| record.detail.choices.get(index));
            choice.is_some_and(|choice| is_way_out(choice))
        };
        LightReplies {
            model: self.model.to_owned(),
            mode,
            asked: self.by_question.len(),
            read: Estimate::share(read.count(), replied.len()),
            refused: replied.iter().filter(|record| is_refused(record)).count(),
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

/// A record without its reply, with an answer in the light in the place of the truth.
fn held(record: &Record, repeat: u32, reference: usize) -> Record {
    let detail = &record.detail;
    let is_same = |reading: AnswerReading| reading.chosen == Some(reference);
    let outcome = match detail.strict {
        None => TrialOutcome::Failed,
        Some(reading) if is_same(reading) => TrialOutcome::Right,
        Some(AnswerReading { chosen: None, .. }) => TrialOutcome::Unparsed,
        Some(_) => TrialOutcome::Wrong,
    };
    let held = ChoiceDetail {
        frame: detail.frame.clone(),
        family: detail.family.clone(),
        choices: detail.choices.clone(),
        truth: Some(reference),
        repeat,
        strict: detail.strict,
        lenient: detail.lenient,
        outcome,
        image: None,
        more_images: Vec::new(),
        shown_frame: None,
        observed: None,
        options: None,
    };
    let (question, condition) = (record.question.clone(), record.condition.clone());
    Record {
        failure: record.failure.clone(),
        ..Record::blank(record.key, question, &record.model, condition, held)
    }
}
