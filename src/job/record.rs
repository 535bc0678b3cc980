//! What a reply says, in the record of a question with choices: [`reread`].

use super::trial::Entry;
use crate::error::Result;
use crate::score::choice::readings;
use crate::types::{
    Answer, Choices, Condition, Failure, Finish, Outcome, QuestionId, Record, Reply, Via,
};

impl Entry for Record {
    fn model(&self) -> &str {
        &self.model
    }

    fn question(&self) -> &QuestionId {
        &self.question
    }

    fn condition(&self) -> Option<&Condition> {
        self.condition.as_ref()
    }

    fn repeat(&self) -> u32 {
        self.repeat
    }

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

fn choices(record: &Record) -> Result<Choices> {
    Choices::new(record.choices.clone(), record.truth)
        .map_err(|e| e.at(format!("the record of question {:?}", record.question.0)))
}

/// The record with its kept reply read as this version of the program reads.
pub(crate) fn reread(mut record: Record) -> Result<Record> {
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
