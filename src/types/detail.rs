//! What an experiment adds to the record of a trial: [`Detail`], [`ChoiceDetail`], [`OpenDetail`].

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::digest::Digest;
use super::frame::FrameId;
use super::question::{Answer, Family, Why};
use super::reply::Reply;
use crate::error::Result;

/// What an experiment adds to a record.
pub trait Detail: Clone + Serialize + DeserializeOwned + Send {
    /// The schema of a run with these records.
    const SCHEMA: &'static str;

    /// Enters what is read from a reply; also when a kept reply is read again.
    ///
    /// # Errors
    /// If the detail does not say what the reply is an answer to.
    fn read(&mut self, reply: &Reply) -> Result<()>;

    /// How many choices the question had; 0 where the answer is open.
    fn choices(&self) -> usize;
}

/// A question with choices, and what was read from the reply.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChoiceDetail {
    /// The frame of the question.
    pub frame: FrameId,
    /// The family of the question.
    pub family: Family,
    /// The choices in the order shown.
    pub choices: Vec<String>,
    /// The index of the true choice.
    pub truth: usize,
    /// How many times the same was asked before; left out of the file where it is the first.
    #[serde(default, skip_serializing_if = "is_first")]
    pub repeat: u32,
    /// The strict reading of the reply; `None` where it failed.
    pub strict: Option<AnswerReading>,
    /// The lenient reading of the reply; `None` where it failed.
    pub lenient: Option<AnswerReading>,
    /// How the trial ended.
    pub outcome: Outcome,
    /// The image as it was sent.
    pub image: Option<ImageFacts>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands a reference")]
fn is_first(repeat: &u32) -> bool {
    *repeat == 0
}

/// An open question, or an answer to it that was put to a judge.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct OpenDetail {
    /// What the model was asked for.
    pub step: Step,
    /// The walk of the question.
    pub episode: String,
    /// The category of the question.
    pub category: String,
    /// Who of several people gave the answer; left out of the file where nobody is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub person: Option<String>,
    /// The answer as it was put to the judge; `None` in answers.
    pub judged: Option<String>,
    /// The mark as upstream's program reads it; `None` in answers, and where it reads none.
    pub upstream: Option<i64>,
    /// The mark in the tolerant reading.
    pub tolerant: Option<i64>,
    /// The frames as they were sent.
    pub images: Option<WalkFacts>,
}

/// What a model was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Step {
    /// An answer to the question.
    Answer,
    /// A mark for an answer.
    Mark,
}

/// The frames of a walk as they were sent together.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct WalkFacts {
    /// How many images, repeated ones included.
    pub images: usize,
    /// The size of all files together, in bytes.
    pub bytes: usize,
    /// The digest of the files' digests, in order.
    pub digest: Digest,
    /// The width of the first, in pixels.
    pub width: usize,
    /// The height of the first, in pixels.
    pub height: usize,
    /// `png` or `jpeg`.
    pub format: String,
}

/// How a trial ended, by the strict reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// The true choice.
    Right,
    /// Another choice.
    Wrong,
    /// A reply without a readable choice: scored wrong, counted apart.
    Unparsed,
    /// No reply: not scored, asked again on resume.
    Failed,
}

/// What is read from a reply in one way, strict or lenient.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct AnswerReading {
    /// The index of the choice.
    pub chosen: Option<usize>,
    /// Why there is none.
    pub why: Option<Why>,
}

impl From<Answer> for AnswerReading {
    fn from(answer: Answer) -> Self {
        match answer {
            Answer::Chosen(index) => Self {
                chosen: Some(index),
                why: None,
            },
            Answer::Unparsed(why) => Self {
                chosen: None,
                why: Some(why),
            },
        }
    }
}

/// The image as it was sent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ImageFacts {
    /// The digest of the encoded file.
    pub digest: Digest,
    /// Its size in bytes.
    pub bytes: usize,
    /// Its width in pixels.
    pub width: usize,
    /// Its height in pixels.
    pub height: usize,
    /// `png` or `jpeg`.
    pub format: String,
}
