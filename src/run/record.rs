//! What came of a trial, as a line of `records.jsonl`.

use super::plan::Trial;
use crate::error::Result;
use crate::score::choice::readings;
use crate::types::{
    Answer, Choices, Condition, Degradation, Failure, Finish, ImageFacts, Outcome, Record, Reply,
    Variant, Via, View,
};

/// The record of a trial before anything came of it.
pub(super) fn blank(
    trial: &Trial,
    view: View,
    condition: Option<Condition>,
    model: &str,
    image: Option<&ImageFacts>,
) -> Record {
    let question = &*trial.question;
    let degradation = condition.as_ref().map(|condition| condition.degradation);
    Record {
        key: trial.key,
        question: question.id.clone(),
        frame: question.frame.clone(),
        family: question.family.clone(),
        model: model.to_owned(),
        view,
        level: degradation.map(Degradation::level),
        variant: degradation.map_or(Variant::None, Degradation::variant),
        enhancer: condition
            .as_ref()
            .and_then(|condition| condition.enhancer.clone()),
        condition,
        choices: question.choices.texts().to_vec(),
        truth: question.choices.truth(),
        reply: None,
        refusal: None,
        finish: None,
        strict: None,
        lenient: None,
        repeat: trial.repeat,
        via: Via::Direct,
        outcome: Outcome::Failed,
        failure: None,
        usage: None,
        served_model: None,
        latency_ms: None,
        attempts: 0,
        image: image.cloned(),
    }
}

/// The record with the reply and both its readings.
pub(super) fn answered(mut record: Record, reply: Reply) -> Result<Record> {
    let choices = choices(&record)?;
    read(&mut record, &reply, &choices);
    record.reply = Some(reply.text);
    record.refusal = reply.refusal;
    record.finish = Some(reply.finish);
    record.usage = reply.usage;
    record.served_model = reply.served_model;
    record.latency_ms = Some(reply.latency_ms);
    record.attempts = reply.attempts;
    Ok(record)
}

/// The record with what went wrong after so many requests.
pub(super) fn failed(record: Record, failure: Failure, attempts: u32) -> Record {
    Record {
        failure: Some(failure),
        attempts,
        ..record
    }
}

fn choices(record: &Record) -> Result<Choices> {
    Choices::new(record.choices.clone(), record.truth)
        .map_err(|e| e.at(format!("the record of question {:?}", record.question.0)))
}

/// The record with its kept reply read as this version of the program reads.
pub(super) fn reread(mut record: Record) -> Result<Record> {
    if let Some(text) = record.reply.clone() {
        let choices = choices(&record)?;
        let reply = Reply {
            refusal: record.refusal.clone(),
            finish: record.finish.clone().unwrap_or(Finish::Unknown),
            ..Reply::local(text)
        };
        read(&mut record, &reply, &choices);
    }
    Ok(record)
}

/// Enters both readings of a reply and the outcome, which is the strict one's.
fn read(record: &mut Record, reply: &Reply, choices: &Choices) {
    let (strict, lenient) = readings(reply, choices);
    record.outcome = match strict {
        Answer::Chosen(index) if index == choices.truth() => Outcome::Right,
        Answer::Chosen(_) => Outcome::Wrong,
        Answer::Unparsed(_) => Outcome::Unparsed,
    };
    record.strict = Some(strict.into());
    record.lenient = Some(lenient.into());
}
