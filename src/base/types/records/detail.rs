//! The fields that an experiment adds to the record of a trial: [`ChoiceDetail`], [`OpenDetail`].

use serde::{Deserialize, Serialize};

use super::record::{Failure, Record, Via, View};
use super::trial_key::TrialKey;
use crate::types::degradations::{Condition, ExposureFacts, PairFacts};
use crate::types::images::FrameId;
use crate::types::questions::{Answer, Family, QuestionId, UnreadReason};
use crate::types::replies::{Finish, LostAttempts, Observed, OptionProbabilities, Usage};
use crate::types::values::Digest;

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
fn is_first(repeat: &u32) -> bool {
    *repeat == 0
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
