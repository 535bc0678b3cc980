//! What an experiment adds to the record of a trial: [`ChoiceDetail`], [`OpenDetail`].

use serde::{Deserialize, Serialize};

use super::condition::Condition;
use super::digest::Digest;
use super::frame::FrameId;
use super::question::{Answer, Family, QuestionId, UnreadReason};
use super::record::{Failure, Record, Via, View};
use super::reply::{Finish, Usage};
use super::trial_key::TrialKey;

/// Declares a detail, and the line of a record with it. serde's `flatten` would read lines a quarter more slowly: it keeps
/// every field aside until it knows whose it is (best of seven times 200,000 lines: 4.1 µs a line instead of 3.2).
macro_rules! details {
    ($(#[$about:meta])* $name:ident, $line:ident { $($(#[$meta:meta])* $field:ident: $type:ty,)+ }) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq, Eq, Serialize)]
        pub struct $name {
            $($(#[$meta])* pub $field: $type,)+
        }

        /// A line of records with such a detail.
        #[derive(Debug, Deserialize)]
        pub struct $line {
            key: TrialKey,
            question: QuestionId,
            model: String,
            view: View,
            condition: Option<Condition>,
            reply: Option<String>,
            refusal: Option<String>,
            finish: Option<Finish>,
            #[serde(default)]
            via: Via,
            failure: Option<Failure>,
            usage: Option<Usage>,
            served_model: Option<String>,
            latency_ms: Option<u64>,
            attempts: u32,
            $($(#[$meta])* $field: $type,)+
        }

        impl From<$line> for Record<$name> {
            fn from(line: $line) -> Self {
                Self {
                    key: line.key,
                    question: line.question,
                    model: line.model,
                    view: line.view,
                    condition: line.condition,
                    reply: line.reply,
                    refusal: line.refusal,
                    finish: line.finish,
                    via: line.via,
                    failure: line.failure,
                    usage: line.usage,
                    served_model: line.served_model,
                    latency_ms: line.latency_ms,
                    attempts: line.attempts,
                    detail: $name { $($field: line.$field,)+ },
                }
            }
        }
    };
}

details! {
    /// A question with choices, and what was read from the reply.
    ChoiceDetail, ChoiceLine {
        /// The frame of the question.
        frame: FrameId,
        /// The family of the question.
        family: Family,
        /// The choices in the order shown.
        choices: Vec<String>,
        /// The index of the true choice.
        truth: usize,
        /// How many times the same was asked before; left out of the file where it is the first.
        #[serde(default, skip_serializing_if = "is_first")]
        repeat: u32,
        /// The strict reading of the reply; `None` where it failed.
        strict: Option<AnswerReading>,
        /// The lenient reading of the reply; `None` where it failed.
        lenient: Option<AnswerReading>,
        /// How the trial ended.
        outcome: TrialOutcome,
        /// The image as it was sent.
        image: Option<ImageFacts>,
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands a reference")]
fn is_first(repeat: &u32) -> bool {
    *repeat == 0
}

details! {
    /// An open question, or an answer to it that was put to a judge.
    OpenDetail, OpenLine {
        /// What the model was asked for.
        step: Step,
        /// The walk of the question.
        episode: String,
        /// The category of the question.
        category: String,
        /// Who of several people gave the answer; left out of the file where nobody is named.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        person: Option<String>,
        /// The answer as it was put to the judge; `None` in answers.
        judged: Option<String>,
        /// The mark as upstream's program reads it; `None` in answers, and where it reads none.
        upstream: Option<i64>,
        /// The mark in the tolerant reading.
        tolerant: Option<i64>,
        /// The frames as they were sent.
        images: Option<WalkFacts>,
    }
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
pub enum TrialOutcome {
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
    pub why: Option<UnreadReason>,
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
