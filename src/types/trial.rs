//! One question put to one model in one condition, and what came of it: [`Record`].

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::condition::{Condition, EnhancerName};
use super::digest::Digest;
use super::frame::FrameId;
use super::light::{Level, Variant};
use super::question::{Answer, Family, QuestionId, Why};
use super::reply::{Finish, Usage};
use crate::error::Error;

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
        f.pad(match self {
            Self::Image => "image",
            Self::Blind => "blind",
        })
    }
}

/// The digest of everything that decides a reply: question and choices as shown, the recipe of the image, prompt, model
/// and parameters. Two trials with one key are one trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TrialKey([u8; 16]);

impl From<Digest> for TrialKey {
    fn from(digest: Digest) -> Self {
        let mut key = [0; 16];
        key.copy_from_slice(&digest.as_bytes()[..16]);
        Self(key)
    }
}

impl fmt::Display for TrialKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", u128::from_be_bytes(self.0))
    }
}

impl FromStr for TrialKey {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let digits = text.len() == 32 && text.bytes().all(|b| b.is_ascii_hexdigit());
        let key = digits
            .then(|| u128::from_str_radix(text, 16).ok())
            .flatten();
        key.map(|key| Self(key.to_be_bytes()))
            .ok_or_else(|| Error::data("key", format_args!("{text:?} is no key of 32 digits")))
    }
}

impl Serialize for TrialKey {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for TrialKey {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?
            .parse()
            .map_err(serde::de::Error::custom)
    }
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

/// What one reading made of a reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reading {
    /// The index of the choice.
    pub chosen: Option<usize>,
    /// Why there is none.
    pub why: Option<Why>,
}

impl From<Answer> for Reading {
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
    pub(super) fn is_direct(&self) -> bool {
        *self == Self::Direct
    }
}

/// One line of `records.jsonl`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Record {
    /// What decides the reply, as a digest.
    pub key: TrialKey,
    /// The question.
    pub question: QuestionId,
    /// Its frame.
    pub frame: FrameId,
    /// Its family.
    pub family: Family,
    /// The model asked.
    pub model: String,
    /// Whether it saw the image.
    pub view: View,
    /// What it saw; `None` where it saw nothing.
    pub condition: Option<Condition>,
    /// The level of that condition.
    pub level: Option<Level>,
    /// The variant of that condition.
    pub variant: Variant,
    /// The enhancer of that condition.
    pub enhancer: Option<EnhancerName>,
    /// The choices in the order shown.
    pub choices: Vec<String>,
    /// The index of the true one.
    pub truth: usize,
    /// What the model said; `None` where it failed.
    pub reply: Option<String>,
    /// The words of a refusal that came apart from the reply.
    pub refusal: Option<String>,
    /// Why the model stopped; `None` where it failed.
    pub finish: Option<Finish>,
    /// The strict reading of the reply; `None` where it failed.
    pub strict: Option<Reading>,
    /// The lenient reading of the reply; `None` where it failed.
    pub lenient: Option<Reading>,
    /// How many times the same was asked before; left out of the file where it is the first.
    #[serde(default, skip_serializing_if = "is_first")]
    pub repeat: u32,
    /// How it was asked; left out of the file where it was asked directly.
    #[serde(default, skip_serializing_if = "Via::is_direct")]
    pub via: Via,
    /// How it ended.
    pub outcome: Outcome,
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
    /// The image as it was sent.
    pub image: Option<ImageFacts>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands a reference")]
fn is_first(repeat: &u32) -> bool {
    *repeat == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_read_back() {
        let key = TrialKey::from(Digest::of(b"a trial"));
        assert_eq!(key.to_string().parse::<TrialKey>().unwrap(), key);
        for wrong in ["", "12", &"g".repeat(32), &format!("+{}", "1".repeat(31))] {
            assert!(wrong.parse::<TrialKey>().is_err(), "{wrong}");
        }
    }
}
