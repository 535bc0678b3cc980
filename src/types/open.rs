//! What came of an open question, or of an answer that was put to a judge: [`OpenRecord`].

use serde::{Deserialize, Serialize};

use super::condition::{Condition, EnhancerName};
use super::digest::Digest;
use super::kept::Kept;
use super::light::{Level, Variant};
use super::question::QuestionId;
use super::reply::{Finish, Usage};
use super::trial::{Failure, TrialKey, Via, View};

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

/// One line of `records.jsonl` in a run of open questions.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct OpenRecord {
    /// What decides the reply, as a digest. A mark's is that of judge and prompt: the same answer to the same question is
    /// judged once, wherever it was given.
    pub key: TrialKey,
    /// What it is.
    pub step: Step,
    /// The question.
    pub question: QuestionId,
    /// Its walk.
    pub episode: String,
    /// Its category.
    pub category: String,
    /// Who was asked: the model, the people, or the judge.
    pub model: String,
    /// Whether it saw the frames.
    pub view: View,
    /// What it saw; `None` where it saw nothing.
    pub condition: Option<Condition>,
    /// The level of that condition.
    pub level: Option<Level>,
    /// The variant of that condition.
    pub variant: Variant,
    /// The enhancer of that condition.
    pub enhancer: Option<EnhancerName>,
    /// Who of several people gave the answer; left out of the file where nobody is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub person: Option<String>,
    /// The answer as it was put to the judge; `None` in answers.
    pub judged: Option<String>,
    /// What was said; `None` where it failed, and where a file of answers has none.
    pub reply: Option<String>,
    /// The words of a refusal that came apart from the reply.
    pub refusal: Option<String>,
    /// Why the model stopped; `None` where it failed.
    pub finish: Option<Finish>,
    /// The mark as upstream's program reads it; `None` in answers, and where it reads none.
    pub upstream: Option<i64>,
    /// The mark in the tolerant reading.
    pub tolerant: Option<i64>,
    /// How it was asked; left out of the file where it was asked directly.
    #[serde(default, skip_serializing_if = "Via::is_direct")]
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
    /// The frames as they were sent.
    pub images: Option<WalkFacts>,
}

impl Kept for OpenRecord {
    const SCHEMA: &'static str = "darkqa.openeqa/1";

    fn key(&self) -> TrialKey {
        self.key
    }

    fn failed(&self) -> bool {
        self.failure.is_some()
    }

    fn via(&self) -> Via {
        self.via
    }

    fn latency_ms(&self) -> Option<u64> {
        self.latency_ms
    }

    fn charged(&self) -> Option<(&str, Usage)> {
        Some((&self.model, self.usage?))
    }
}
