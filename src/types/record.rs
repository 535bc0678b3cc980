//! What was asked of a model in a trial and what came of it: [`Record`].

use std::fmt;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize};

use super::condition::Condition;
use super::question::QuestionId;
use super::reply::{Finish, Reply, Usage};
use super::trial_key::TrialKey;
use crate::error::Result;

/// One line of `records.jsonl`: what every trial has, and what its experiment adds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Record<D> {
    /// What decides the reply, as a digest.
    pub key: TrialKey,
    /// The question.
    pub question: QuestionId,
    /// Who was asked: the model, the judge, or the people.
    pub model: String,
    /// Whether it saw the images.
    pub view: View,
    /// What it saw; `None` where it saw nothing. A line has what follows from it in columns too.
    #[serde(flatten, serialize_with = "shown::serialize")]
    pub condition: Option<Condition>,
    /// The reply; `None` where it failed.
    pub reply: Option<String>,
    /// The words of a refusal that came apart from the reply.
    pub refusal: Option<String>,
    /// Why the model stopped; `None` where it failed.
    pub finish: Option<Finish>,
    /// How it was asked; left out of the file where it was asked directly.
    #[serde(skip_serializing_if = "Via::is_direct")]
    pub via: Via,
    /// What went wrong, where it failed.
    pub failure: Option<Failure>,
    /// Tokens charged.
    pub usage: Option<Usage>,
    /// The model's name as the server gave it.
    pub served_model: Option<String>,
    /// How long the last try took, in milliseconds.
    pub latency_ms: Option<u64>,
    /// How many requests it took.
    pub attempts: u32,
    /// What the experiment adds.
    #[serde(flatten)]
    pub detail: D,
}

/// What an experiment adds to a record.
pub trait Detail: Clone + Serialize + Send {
    /// A whole line of records, from which it is read in one pass.
    type Line: DeserializeOwned + Into<Record<Self>>;

    /// The schema of a run with these records.
    const SCHEMA: &'static str;

    /// Enters what is read from a reply; also when a kept reply is read again.
    ///
    /// # Errors
    /// If the detail does not say what the reply is an answer to.
    fn read(&mut self, reply: &Reply) -> Result<()>;

    /// The choices in the order shown; none if the answer is open.
    fn choices(&self) -> &[String];

    /// How many times the same was asked before.
    fn repeat(&self) -> u32;
}

impl<'de, D: Detail> Deserialize<'de> for Record<D> {
    fn deserialize<S: Deserializer<'de>>(deserializer: S) -> std::result::Result<Self, S::Error> {
        D::Line::deserialize(deserializer).map(Into::into)
    }
}

impl<D> Record<D> {
    /// The record of a trial before anything came of it; without a condition the model sees nothing.
    #[must_use]
    pub fn blank(
        key: TrialKey,
        question: QuestionId,
        model: &str,
        condition: Option<Condition>,
        detail: D,
    ) -> Self {
        Self {
            key,
            question,
            model: model.to_owned(),
            view: condition.as_ref().map_or(View::Blind, |_| View::Image),
            condition,
            reply: None,
            refusal: None,
            finish: None,
            via: Via::Direct,
            failure: None,
            usage: None,
            served_model: None,
            latency_ms: None,
            attempts: 0,
            detail,
        }
    }

    /// Whether no reply came, so that the trial is asked again.
    #[must_use]
    pub fn failed(&self) -> bool {
        self.failure.is_some()
    }

    /// The record with what went wrong after so many requests.
    #[must_use]
    pub fn failed_by(self, failure: Failure, attempts: u32) -> Self {
        Self {
            failure: Some(failure),
            attempts,
            ..self
        }
    }

    /// The record as one that was asked in a batch.
    #[must_use]
    pub fn batched(self) -> Self {
        Self {
            via: Via::Batch,
            ..self
        }
    }
}

impl<D: Detail> Record<D> {
    /// The record with a reply and what is read from it.
    ///
    /// # Errors
    /// If the record does not say what the reply is an answer to.
    pub fn answered(mut self, reply: Reply) -> Result<Self> {
        self.read(&reply)?;
        self.reply = Some(reply.text);
        self.refusal = reply.refusal;
        self.finish = Some(reply.finish);
        self.usage = reply.usage;
        self.served_model = reply.served_model;
        self.latency_ms = Some(reply.latency_ms);
        self.attempts = reply.attempts;
        Ok(self)
    }

    /// The record with its kept reply read as this version of the program reads.
    ///
    /// # Errors
    /// As of [`answered`](Self::answered).
    pub fn reread(mut self) -> Result<Self> {
        if let Some(text) = self.reply.clone() {
            let reply = Reply {
                refusal: self.refusal.clone(),
                finish: self.finish.clone().unwrap_or(Finish::Unknown),
                ..Reply::local(text)
            };
            self.read(&reply)?;
        }
        Ok(self)
    }

    fn read(&mut self, reply: &Reply) -> Result<()> {
        let question = &self.question.0;
        let read = self.detail.read(reply);
        read.map_err(|e| e.at(format!("the record of question {question:?}")))
    }
}

/// The columns that follow from a condition.
mod shown {
    use serde::{Serialize, Serializer};

    use crate::types::degradation::{Axis, Degradation, ReadingName, Severity};
    use crate::types::{AxisLevel, Condition, EnhancerName};

    #[derive(Serialize)]
    struct Written<'a> {
        condition: Option<&'a Condition>,
        level: Option<AxisLevel>,
        variant: &'static str,
        ev: Option<f64>,
        /// In place of `ev` for kinds that are measured in another unit.
        #[serde(skip_serializing_if = "Option::is_none")]
        severity: Option<Severity>,
        reading: Option<&'a ReadingName>,
        enhancer: Option<&'a EnhancerName>,
    }

    #[expect(clippy::ref_option, reason = "serde hands a reference")]
    pub(super) fn serialize<S: Serializer>(
        condition: &Option<Condition>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let condition = condition.as_ref();
        let degradation = condition.and_then(|condition| condition.degradation.as_ref());
        let level = condition.map(Condition::level);
        let light = level.filter(|level| level.axis().is_none_or(|axis| axis == Axis::LIGHT));
        let severity = degradation.map(Degradation::severity);
        Written {
            condition,
            level,
            variant: degradation.map_or("none", |how| how.kind().word()),
            ev: light.map(AxisLevel::value),
            severity: severity.filter(|_| light.is_none()),
            reading: degradation.and_then(Degradation::reading),
            enhancer: condition.and_then(|condition| condition.enhancer.as_ref()),
        }
        .serialize(serializer)
    }
}

/// Whether the model was shown the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum View {
    /// It was.
    Image,
    /// It had the words alone.
    Blind,
}

impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// What went wrong where no reply came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FailureKind {
    /// No connection, or it broke.
    Connection,
    /// Not finished in time.
    Timeout,
    /// Too many requests, after all retries.
    RateLimit,
    /// The server failed, after all retries.
    Server,
    /// The request was refused.
    Request,
    /// A moderator refused what the request showed or asked.
    Filtered,
    /// The answer was not a chat completion.
    Response,
    /// The image could not be made.
    Image,
}

impl FailureKind {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Connection,
        Self::Timeout,
        Self::RateLimit,
        Self::Server,
        Self::Request,
        Self::Filtered,
        Self::Response,
        Self::Image,
    ];
}

/// A trial without a reply.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// What kind.
    pub kind: FailureKind,
    /// The HTTP status, where there was one.
    pub status: Option<u16>,
    /// What was said, shortened and without secrets.
    pub message: String,
}

/// How a question reached its model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Via {
    /// As a request of its own.
    #[default]
    Direct,
    /// In a file of a Batch API, which costs less.
    Batch,
    /// Not at all: the answer was given in a file, by people or another program.
    File,
}

impl Via {
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands a reference")]
    fn is_direct(&self) -> bool {
        *self == Self::Direct
    }
}
