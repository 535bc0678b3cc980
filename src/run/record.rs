//! What came of a trial, as a line of `records.jsonl`.

use super::drive::Ready;
use crate::ask::AskError;
use crate::score::choice::readings;
use crate::types::{Answer, Degradation, Outcome, Record, Reply, Variant};

/// The record of a trial: the reply with both readings, or the failure.
pub(super) fn record(ready: Ready, model: &str, result: Result<Reply, AskError>) -> Record {
    let Ready {
        trial,
        condition,
        image,
        view,
    } = ready;
    let question = &*trial.question;
    let degradation = condition.as_ref().map(|condition| condition.degradation);
    let mut record = Record {
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
        outcome: Outcome::Failed,
        failure: None,
        usage: None,
        served_model: None,
        latency_ms: None,
        attempts: 0,
        image: image.map(|image| image.facts().clone()),
    };
    match result {
        Ok(reply) => {
            let (strict, lenient) = readings(&reply, &question.choices);
            record.outcome = match strict {
                Answer::Chosen(index) if index == record.truth => Outcome::Right,
                Answer::Chosen(_) => Outcome::Wrong,
                Answer::Unparsed(_) => Outcome::Unparsed,
            };
            record.strict = Some(strict.into());
            record.lenient = Some(lenient.into());
            record.reply = Some(reply.text);
            record.refusal = reply.refusal;
            record.finish = Some(reply.finish);
            record.usage = reply.usage;
            record.served_model = reply.served_model;
            record.latency_ms = Some(reply.latency_ms);
            record.attempts = reply.attempts;
        }
        Err(error) => {
            record.failure = Some(error.failure);
            record.attempts = error.attempts;
        }
    }
    record
}
