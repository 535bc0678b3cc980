//! Answers to open questions in the form that a judge gets: [`predictions`].

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use darkqa_ask::prompts::blind_answer;
use darkqa_base::types::{OpenDetail, QuestionId, Record, Step, Via, View};
use darkqa_score::choice::llm_match::{Protocol, truncate_answer};
use darkqa_score::choice::open_answer;
use darkqa_score::model_in_condition::ModelInCondition;

/// The state of one answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AnswerState {
    /// No reply yet, or the trial failed.
    Missing,
    /// A reply without an answer. It scores 0 without being judged.
    Null,
    /// The text to judge.
    Text {
        answer: Arc<str>,
        /// True if the protocol shortened the answer.
        cut: bool,
    },
}

/// One answer to one question.
#[derive(Debug, Clone)]
pub struct QuestionAnswer {
    pub subject: ModelInCondition,
    /// Index of the question among those of the run.
    pub question: usize,
    /// Answer before the protocol shortens it; `None` if there is none.
    pub full_answer: Option<String>,
    pub state: AnswerState,
}

/// All answers of a run in the order of its questions: requested ones, including missing ones, and those from files. A
/// subject that was asked any question is expected to have answers to all.
pub fn predictions(
    records: &[Record<OpenDetail>],
    questions: &[&QuestionId],
    protocol: Protocol,
) -> Vec<QuestionAnswer> {
    let places: HashMap<&QuestionId, usize> = questions.iter().copied().zip(0..).collect();
    let mut answers = BTreeMap::<(usize, ModelInCondition), Vec<&Record<OpenDetail>>>::new();
    let mut asked_subjects = BTreeSet::new();
    for record in records.iter().filter(|record| record.detail.step == Step::Answer) {
        let subject = ModelInCondition::new(&record.model, record.condition.as_ref());
        if record.via != Via::File {
            asked_subjects.insert(subject.clone());
        }
        if let Some(&question) = places.get(&record.question).filter(|_| !record.failed()) {
            let of_subject = answers.entry((question, subject)).or_default();
            of_subject.push(record);
        }
    }
    for question in 0..questions.len() {
        for subject in &asked_subjects {
            answers.entry((question, subject.clone())).or_default();
        }
    }
    let mut predictions = Vec::new();
    for ((question, subject), records) in answers {
        let missing = records.is_empty().then_some(None);
        for record in records.into_iter().map(Some).chain(missing) {
            let (full_answer, state) = state(record, protocol);
            predictions.push(QuestionAnswer { subject: subject.clone(), question, full_answer, state });
        }
    }
    predictions
}

/// The state of the answer in a record that has not failed.
pub fn answer_state(record: &Record<OpenDetail>, protocol: Protocol) -> AnswerState {
    state(Some(record), protocol).1
}

fn state(record: Option<&Record<OpenDetail>>, protocol: Protocol) -> (Option<String>, AnswerState) {
    let Some(record) = record else {
        return (None, AnswerState::Missing);
    };
    let Some(full) = full_answer(record, protocol) else {
        return (None, AnswerState::Null);
    };
    let answer = match protocol {
        Protocol::Upstream => truncate_answer(&full),
        Protocol::Tolerant => &full,
    };
    let state = AnswerState::Text { answer: answer.into(), cut: answer != full };
    (Some(full), state)
}

/// The answer in a model's reply, without thoughts and template tokens; `None` if there is none, which upstream treats
/// as an error. A missing, empty or refused reply has no answer, and neither have thoughts that do not end.
fn full_answer(record: &Record<OpenDetail>, protocol: Protocol) -> Option<String> {
    let reply = record.reply.as_deref().filter(|_| record.refusal.is_none())?;
    let reply = open_answer(reply).ok()?;
    match (record.view, blind_answer(&reply), protocol) {
        (View::Image, _, _) => Some(reply.into_owned()),
        (View::Blind, Some(answer), _) => Some(answer),
        (View::Blind, None, Protocol::Upstream) => None,
        (View::Blind, None, Protocol::Tolerant) => Some(reply.trim().to_owned()),
    }
}
