//! What came of a trial, as a line of `records.jsonl`.

use super::plan::Choice;
use super::trial::{Item, Slide, Trial};
use crate::ask::Query;
use crate::error::Result;
use crate::score::choice::readings;
use crate::types::{
    Answer, Choices, Degradation, Failure, Finish, Kept, Outcome, Record, Reply, Variant, Via,
};

/// A record that something comes of.
pub(super) trait Entry: Kept + Send {
    /// How many choices the question had; 0 where the answer is open.
    fn choices(&self) -> usize;

    /// The record with the reply and what is read from it.
    fn answered(self, reply: Reply) -> Result<Self>;

    /// The record with what went wrong after so many requests.
    fn failed_by(self, failure: Failure, attempts: u32) -> Self;

    /// The record as one that was asked in a batch.
    fn batched(self) -> Self;
}

impl Item for Choice {
    type Record = Record;

    // It names a letter.
    const REPLY: f64 = 4.0;

    fn query(&self) -> Query<'_> {
        Query::Choice(&self.question)
    }

    fn place(&self) -> &str {
        &self.question.frame.0
    }

    fn turn(&self) -> u32 {
        self.turn
    }

    fn blank(trial: &Trial<Self>, slide: &Slide, model: &str) -> Record {
        blank(trial, slide, model)
    }
}

impl Entry for Record {
    fn choices(&self) -> usize {
        self.choices.len()
    }

    fn answered(mut self, reply: Reply) -> Result<Self> {
        let choices = choices(&self)?;
        read(&mut self, &reply, &choices);
        self.reply = Some(reply.text);
        self.refusal = reply.refusal;
        self.finish = Some(reply.finish);
        self.usage = reply.usage;
        self.served_model = reply.served_model;
        self.latency_ms = Some(reply.latency_ms);
        self.attempts = reply.attempts;
        Ok(self)
    }

    fn failed_by(self, failure: Failure, attempts: u32) -> Self {
        Self {
            failure: Some(failure),
            attempts,
            ..self
        }
    }

    fn batched(self) -> Self {
        Self {
            via: Via::Batch,
            ..self
        }
    }
}

fn blank(trial: &Trial<Choice>, slide: &Slide, model: &str) -> Record {
    let question = &*trial.item.question;
    let condition = slide.condition.clone();
    let degradation = condition.as_ref().map(|condition| condition.degradation);
    Record {
        key: trial.key,
        question: question.id.clone(),
        frame: question.frame.clone(),
        family: question.family.clone(),
        model: model.to_owned(),
        view: slide.view(),
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
        repeat: trial.item.repeat,
        via: Via::Direct,
        outcome: Outcome::Failed,
        failure: None,
        usage: None,
        served_model: None,
        latency_ms: None,
        attempts: 0,
        image: slide.images.first().map(|image| image.facts().clone()),
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
