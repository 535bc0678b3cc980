//! [`Record`]: one trial with its question, model, condition and result.
//!
//! The fields that an experiment adds to the record of a trial: [`ChoiceDetail`], [`OpenDetail`].
//!
//! The key that identifies a trial: [`TrialKey`].
//!
//! Facts about images that were sent, stored next to the records of a run for its report: small copies ([`Thumbnail`])
//! and the similarity to the clean frame ([`ImageFidelity`]).

use std::fmt;
use std::str::FromStr;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::trials::AskedParts;
use crate::error::Error;
use crate::types::degradations::{Condition, ConditionColumns, ExposureFacts, PairFacts};
use crate::types::images::FrameId;
use crate::types::questions::{Answer, Family, PixelBox, QuestionId, UnreadReason};
use crate::types::replies::{Finish, LostAttempts, Observed, OptionProbabilities, Usage};
use crate::types::text::words::as_text;
use crate::types::values::{Digest, Shared};

/// Declares a detail, and the type of a record line that contains it. serde's `flatten` would take a quarter more time
/// to read a line, because it buffers every field (best of seven times 200,000 lines: 4.1 µs a line instead of 3.2).
macro_rules! details {
    ($(#[$about:meta])* $name:ident, $line:ident { $($(#[$meta:meta])* $field:ident: $type:ty,)+ }) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq, Eq, Serialize)]
        pub struct $name {
            $($(#[$meta])* pub $field: $type,)+
        }

        /// One line of a record file: the fields of every trial and those of the detail.
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
            #[serde(default)]
            max_tokens: Option<u32>,
            usage: Option<Usage>,
            served_model: Option<String>,
            #[serde(default)]
            provider: Option<String>,
            #[serde(default)]
            endpoint: Option<usize>,
            latency_ms: Option<u64>,
            attempts: u32,
            #[serde(default)]
            lost: LostAttempts,
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
                    max_tokens: line.max_tokens,
                    usage: line.usage,
                    served_model: line.served_model,
                    provider: line.provider,
                    endpoint: line.endpoint,
                    latency_ms: line.latency_ms,
                    attempts: line.attempts,
                    lost: line.lost,
                    detail: $name { $($field: line.$field,)+ },
                }
            }
        }
    };
}

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

details! {
    /// A question with choices, and the answer parsed from the reply.
    ChoiceDetail, ChoiceLine {
        /// The frame of the question.
        frame: FrameId,
        /// The family of the question.
        family: Family,
        /// The choices in the order shown.
        choices: Vec<String>,
        /// The index of the true choice; `None` if nobody knows it.
        truth: Option<usize>,
        /// How many times the same question was asked before; not in the file if 0.
        #[serde(default, skip_serializing_if = "is_first")]
        repeat: u32,
        /// The name of the prompts, if the run asks with several; not in the file otherwise.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        wording: Option<String>,
        /// The number of the order of the choices among those of the question, from 0; not in the file if 0.
        #[serde(default, skip_serializing_if = "is_first")]
        order: u32,
        /// The strict parsing of the reply; `None` if no reply came.
        strict: Option<ParsedAnswer>,
        /// The lenient parsing of the reply; `None` if no reply came.
        lenient: Option<ParsedAnswer>,
        /// How the trial ended.
        outcome: TrialOutcome,
        /// The image as it was sent, or the first of several.
        image: Option<ImageFacts>,
        /// The other images of a question that shows several, in order; not in the file otherwise.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        more_images: Vec<ImageFacts>,
        /// The frame whose image was shown, if it is not the frame of the question: a control of the observer. Not in
        /// the file otherwise.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        shown_frame: Option<FrameId>,
        /// The observer's view of the frame; absent in the file for other models and without an image.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        observed: Option<Observed>,
        /// The model's probability of each choice; absent in the file if it was not requested, or not reported by the
        /// server.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        options: Option<OptionProbabilities>,
    }
}

impl ChoiceDetail {
    /// All images as they were sent, in order.
    pub fn images(&self) -> impl Iterator<Item = &ImageFacts> {
        self.image.iter().chain(&self.more_images)
    }

    /// The digest of the file that was sent, or of all files in order; `None` without an image.
    #[must_use]
    pub fn file_digest(&self) -> Option<Digest> {
        Digest::from_file_digests(self.images().map(|image| image.digest))
    }

    /// The frame whose image was shown.
    #[must_use]
    pub fn sent_frame(&self) -> &FrameId {
        self.shown_frame.as_ref().unwrap_or(&self.frame)
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands a reference")]
fn is_first(number: &u32) -> bool {
    *number == 0
}

details! {
    /// An open question, or an answer to it that a judge marks.
    OpenDetail, OpenLine {
        /// The task of the model: an answer, or a mark for an answer.
        step: Step,
        /// The walk of the question.
        episode: String,
        /// The category of the question.
        category: String,
        /// The name of the person who answered; not in the file if nobody is named.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        person: Option<String>,
        /// The answer that the judge was shown; `None` in records of answers.
        judged: Option<String>,
        /// The mark that the program of OpenEQA parses from the reply; `None` in records of answers, and if it finds no
        /// mark.
        upstream: Option<i64>,
        /// The mark that the tolerant protocol parses from the reply; `None` as for `upstream`.
        tolerant: Option<i64>,
        /// The frames that were sent.
        images: Option<WalkFacts>,
    }
}

/// The task of a model: an answer to a question, or a mark for an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Step {
    /// An answer to the question.
    Answer,
    /// A mark for an answer.
    Mark,
}

/// The frames of a walk that were sent in one request.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct WalkFacts {
    /// The number of images, repeated ones included.
    pub images: usize,
    /// The total size of the files, in bytes.
    pub bytes: usize,
    /// The digest of the digests of the files, in order.
    pub digest: Digest,
    /// The width of the first image, in pixels.
    pub width: usize,
    /// The height of the first image, in pixels.
    pub height: usize,
    /// The file format: `png` or `jpeg`.
    pub format: String,
    /// Camera settings that all frames share; absent in the file for kinds that do not state them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure: Option<ExposureFacts>,
}

/// The result of a trial in the strict parsing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TrialOutcome {
    /// The model named the true choice.
    Right,
    /// The model named a false choice.
    Wrong,
    /// The model named a choice, but nobody knows the true one: neither right nor wrong.
    Answered,
    /// A reply without a readable choice: scored as wrong, counted separately.
    Unparsed,
    /// No reply: not scored, asked again on resume.
    Failed,
}

/// The answer that the strict or the lenient parsing finds in a reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ParsedAnswer {
    /// The index of the choice; `None` if the parsing found none.
    pub chosen: Option<usize>,
    /// The reason why the parsing found no choice; `None` if it found one.
    pub why: Option<UnreadReason>,
}

impl From<Answer> for ParsedAnswer {
    fn from(answer: Answer) -> Self {
        match answer {
            Answer::Chosen(index) => Self { chosen: Some(index), why: None },
            Answer::Unparsed(why) => Self { chosen: None, why: Some(why) },
        }
    }
}

/// Size, format and digest of an image as it was sent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ImageFacts {
    /// The digest of the encoded file.
    pub digest: Digest,
    /// The size of the encoded file, in bytes.
    pub bytes: usize,
    /// The width in pixels.
    pub width: usize,
    /// The height in pixels.
    pub height: usize,
    /// The file format: `png` or `jpeg`.
    pub format: String,
    /// The EXIF orientation, 2 to 8, by which the frame was rotated or mirrored on loading; not in the file without
    /// one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation: Option<u8>,
    /// Camera settings for this image; absent in the file for kinds that do not state them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure: Option<ExposureFacts>,
    /// How dark the photograph of the frame is; in the file only for images of a pair, which are as dark as the
    /// photograph.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pair: Option<PairFacts>,
}

/// The digest of everything that decides a reply: question and choices as shown, the recipe of the image, prompt, model
/// and parameters. Trials with the same key are the same trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TrialKey([u8; 16]);

impl From<Digest> for TrialKey {
    fn from(digest: Digest) -> Self {
        let mut key = [0; 16];
        key.copy_from_slice(&digest.as_bytes()[..16]);
        Self(key)
    }
}

impl TrialKey {
    /// The key as four numbers.
    pub(super) fn to_words(self) -> [u32; 4] {
        let word = |start: usize| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|place| self.0[start + place]);
            u32::from_le_bytes([a, b, c, d])
        };
        [0, 4, 8, 12].map(word)
    }

    /// The key from [`to_words`](Self::to_words).
    pub(super) fn from_words(words: [u32; 4]) -> Self {
        let mut key = [0; 16];
        key.copy_from_slice(words.map(u32::to_le_bytes).as_flattened());
        Self(key)
    }

    /// The key as 16 bytes.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8; 16] {
        &self.0
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
        // `from_str_radix` would accept a sign.
        if text.len() == 32
            && text.bytes().all(|b| b.is_ascii_hexdigit())
            && let Ok(key) = u128::from_str_radix(text, 16)
        {
            return Ok(Self(key.to_be_bytes()));
        }
        let problem = format_args!("{text:?} is not a key of 32 hexadecimal digits");
        Err(Error::data("key", problem))
    }
}

as_text!(TrialKey);

/// One line of a run's `thumbnails.jsonl`: a small copy of an image as it was sent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Thumbnail {
    /// The name of the frame.
    pub frame: FrameId,
    /// The condition in which the frame was sent.
    pub condition: Condition,
    /// The digest of the file that was sent.
    pub image: Digest,
    /// The whole image in reduced size, as a `data:` URL.
    pub small: String,
    /// The middle of the image at full resolution and brightened, as a `data:` URL.
    pub crop: String,
    /// The gain that brightens the crop, in EV.
    pub stops: f32,
    /// The width and height of the frame in pixels, the unit of boxes in evidence; not in the file for several frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<[u32; 2]>,
    /// Crops of the objects that questions are about, at full resolution and brightened as `crop` is; not in the file
    /// if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub objects: Vec<ObjectCrop>,
}

/// An object that a question is about, cropped from an image as it was sent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ObjectCrop {
    /// The box of the object, in pixels of the frame.
    pub object: PixelBox,
    /// Crop of the object and its surroundings, as a `data:` URL.
    pub crop: String,
}

/// One line of a run's `fidelity.jsonl`: how similar an image is to its clean frame, both in the size sent, before any
/// JPEG.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageFidelity {
    /// The name of the frame.
    pub frame: Shared<FrameId>,
    /// The condition in which the frame was sent.
    pub condition: Shared<Condition>,
    /// The digest of the file that was sent.
    pub image: Digest,
    /// Peak signal-to-noise ratio in dB, peak 255, over all samples; `None` if the image equals the clean frame.
    pub psnr: Option<f64>,
    /// Structural similarity, at most 1; `None` if the image is smaller than the window of 11 × 11 pixels.
    pub ssim: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_read_back() {
        let key = TrialKey::from(Digest::from_bytes(b"a trial"));
        assert_eq!(key.to_string().parse::<TrialKey>().unwrap(), key);
        for wrong in ["", "12", &"g".repeat(32), &format!("+{}", "1".repeat(31))] {
            assert!(wrong.parse::<TrialKey>().is_err(), "{wrong}");
        }
    }
}
