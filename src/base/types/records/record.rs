//! [`Record`]: one trial with its question, model, condition and result.

use std::fmt;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::trial_key::TrialKey;
use super::trials::AskedParts;
use crate::types::degradations::{Condition, ConditionColumns};
use crate::types::questions::QuestionId;
use crate::types::replies::{Finish, LostAttempts, Usage};
use crate::types::values::Digest;

/// One line of `records.jsonl`: the fields of every trial, and those that its experiment adds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Record<D> {
    /// The digest of everything that decides the reply.
    pub key: TrialKey,
    /// The name of the question.
    pub question: QuestionId,
    /// The name of the model, the judge or the group of people that was asked.
    pub model: String,
    /// Whether the model was shown the images.
    pub view: View,
    /// The condition of the images; `None` if the model was shown none. Written to the file as several columns
    /// ([`ConditionColumns`]).
    #[serde(flatten, serialize_with = "condition_columns")]
    pub condition: Option<Condition>,
    /// The text of the reply; `None` if no reply came.
    pub reply: Option<String>,
    /// The text of a refusal that the server sent separately from the reply.
    pub refusal: Option<String>,
    /// The reason why the model stopped; `None` if no reply came, unless the last attempt broke off in the middle.
    pub finish: Option<Finish>,
    /// The way in which the model was asked; not in the file if it was asked directly.
    #[serde(skip_serializing_if = "Via::is_direct")]
    pub via: Via,
    /// The reason why no reply came; `None` if one came.
    pub failure: Option<Failure>,
    /// Token limit of the reply if it exceeds that of the run's first call; absent in the file otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_tokens: Option<u32>,
    /// The tokens that the server charged; `None` if it did not report them.
    pub usage: Option<Usage>,
    /// The model's name in the server's reply.
    pub served_model: Option<String>,
    /// The provider that a router passed the request on to; not in the file if the server names none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub provider: Option<String>,
    /// The replica of the endpoint that replied, by its place among the addresses; not in the file if there is one
    /// address.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub endpoint: Option<usize>,
    /// The duration of the last try, in milliseconds.
    pub latency_ms: Option<u64>,
    /// The number of requests that were sent.
    pub attempts: u32,
    /// The attempts that were charged and gave no reply; not in the file if there were none.
    #[serde(skip_serializing_if = "LostAttempts::is_none")]
    pub lost: LostAttempts,
    /// The fields that the experiment adds.
    #[serde(flatten)]
    pub detail: D,
}

#[expect(clippy::ref_option, reason = "serde hands a reference")]
fn condition_columns<S: Serializer>(
    condition: &Option<Condition>,
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    ConditionColumns::new(condition.as_ref()).serialize(serializer)
}

/// The fields that an experiment adds to a record.
pub trait StoredDetail: Clone + PartialEq + Serialize + Send {
    /// A complete line of a record file; records are read through this type in one pass.
    type Line: DeserializeOwned + Into<Record<Self>>;

    /// Facts that reports keep in addition to those of every record.
    type Facts: Clone + fmt::Debug + Send + Sync;

    /// Tables that these facts refer to.
    type Tables: Clone + Default + fmt::Debug + Send + Sync;

    /// The schema of a run with these records.
    const SCHEMA: &'static str;

    /// The question as asked, independent of the model.
    fn asked(&self) -> AskedParts<'_>;

    /// Extracts the facts that reports keep of a record.
    fn extract_facts(record: &Record<Self>, tables: &mut Self::Tables) -> Self::Facts;

    /// Copies facts into other tables.
    fn move_facts(facts: &Self::Facts, from: &Self::Tables, to: &mut Self::Tables) -> Self::Facts;

    /// Name of the frame or walk that was shown, if it differs from the frame that was asked about.
    fn source_of<'t>(facts: &'t Self::Facts, tables: &'t Self::Tables) -> Option<&'t str>;

    /// Digest of the images sent; `None` if no image was sent or the digest is unknown.
    fn sent_digest_of(facts: &Self::Facts, tables: &Self::Tables) -> Option<Digest>;

    /// The choices in the order shown; empty if the question is open.
    fn choices(&self) -> &[String];

    /// How many times the same question was asked before.
    fn repeat(&self) -> u32;

    /// Name of the frame or walk that was shown.
    fn source(&self) -> &str;

    /// Digest of the images sent; `None` if no image was sent or the digest is unknown.
    fn sent_digest(&self) -> Option<Digest>;
}

impl<'de, D: StoredDetail> Deserialize<'de> for Record<D> {
    fn deserialize<S: Deserializer<'de>>(deserializer: S) -> std::result::Result<Self, S::Error> {
        D::Line::deserialize(deserializer).map(Into::into)
    }
}

impl<D> Record<D> {
    /// The record of a trial without a result yet. Without a condition the model is shown no image.
    #[must_use]
    pub fn blank(key: TrialKey, question: QuestionId, model: &str, condition: Option<Condition>, detail: D) -> Self {
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
            max_tokens: None,
            usage: None,
            served_model: None,
            provider: None,
            endpoint: None,
            latency_ms: None,
            attempts: 0,
            lost: LostAttempts::default(),
            detail,
        }
    }

    /// Whether no reply came, so that the trial is asked again.
    #[must_use]
    pub fn failed(&self) -> bool {
        self.failure.is_some()
    }

    /// Text of the reply, or else of the refusal, or else of the error.
    #[must_use]
    pub fn text_or_error(&self) -> Option<&str> {
        self.reply
            .as_deref()
            .filter(|text| !text.is_empty())
            .or(self.refusal.as_deref())
            .or_else(|| self.failure.as_ref().map(|failure| &*failure.message))
    }

    /// The record with a failure after this number of requests.
    #[must_use]
    pub fn with_failure(self, failure: Failure, attempts: u32) -> Self {
        Self { failure: Some(failure), attempts, ..self }
    }

    /// The record, marked as asked in a batch.
    #[must_use]
    pub fn in_batch(self) -> Self {
        Self { via: Via::Batch, ..self }
    }
}

/// Whether the model was shown the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum View {
    /// The model was shown the image.
    Image,
    /// The model was asked without the image.
    Blind,
}

impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// The reason why no reply came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FailureKind {
    /// No connection could be made, or it broke.
    Connection,
    /// The reply was not complete in time.
    Timeout,
    /// The server refused the request because of its rate limit, also after all retries.
    RateLimit,
    /// The server failed, also after all retries.
    Server,
    /// The request was refused, by the server or by a model in this process.
    Request,
    /// Moderation refused the image or the question.
    Filtered,
    /// The response was not a chat completion.
    Response,
    /// The image could not be made, so no request was sent.
    Image,
}

impl FailureKind {
    /// All kinds of failure, in the order of tables.
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
    /// The kind of failure.
    pub kind: FailureKind,
    /// The HTTP status; `None` if the server sent none.
    pub status: Option<u16>,
    /// The error text, shortened and without secrets.
    pub message: String,
}

/// The way in which a question reached its model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Via {
    /// As a single request.
    #[default]
    Direct,
    /// In a file of a Batch API, which costs less.
    Batch,
    /// Not asked: the answer came from a file, made by people or another program.
    File,
}

impl Via {
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands a reference")]
    fn is_direct(&self) -> bool {
        *self == Self::Direct
    }
}
