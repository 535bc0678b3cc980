//! Reading of the choice in a reply, by exact match: [`read`] and [`readings`].
//!
//! Two readings are always reported together. [`ReadingMode::Strict`] accepts a reply that is an answer and nothing else.
//! [`ReadingMode::Lenient`] also finds an answer inside a reply; if two choices are possible, it accepts neither. No choice
//! is ever guessed. If the strict parsing finds a choice, the lenient parsing finds the same.
//!
//! A reply passes through `clean` (which removes hidden reasoning, invisible characters and leaked tokens), then `strict`,
//! then the steps of `lenient`, in the order of its functions `steps` and `read_plain`.

#![allow(
    missing_docs,
    reason = "fields and variants of this workspace's own use, whose names say what they are"
)]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

mod choice_views;
mod letters;
pub mod llm_match;
mod markers;
mod named;
mod names;
pub mod option_probabilities;
mod rules;
mod states;
#[cfg(test)]
mod tests;
mod text;
mod texts;
mod view;

use serde::Serialize;

use darkqa_ground::types::questions::{Answer, Choices, UnreadReason};
use darkqa_ground::types::replies::{Finish, Reply};

use rules::{lenient, strict};
use text::clean;

/// The version of the lenient parsing, raised whenever any reply may read differently. Records of another version are read again by
/// `report --rescore`. The strict parsing changed with `lenient/4` alone: marks of reasoning, and full-width signs around letters.
pub const LENIENT_VERSION: &str = "lenient/4";

/// How much text a reply may have around the answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ReadingMode {
    /// None: the whole reply is a choice's text, its letter, or its letter with its text. Headline numbers use this reading.
    Strict,
    /// Sentences, markup, JSON or LaTeX, if exactly one choice is meant.
    Lenient,
}

impl ReadingMode {
    /// Both readings, the headline reading first.
    pub const ALL: [Self; 2] = [Self::Strict, Self::Lenient];

    /// The word in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Strict => "strict",
            Self::Lenient => "lenient",
        }
    }
}

/// The choice in a reply, as an index in the order shown, or the reason why none could be read.
///
/// Text in a closed reasoning block, by the marks of `reasoning.toml`, is ignored. A block that is opened and never closed leaves
/// nothing to read: the reason is then [`UnreadReason::Truncated`].
///
/// ```
/// use darkqa_choice::{ReadingMode, read};
/// use darkqa_ground::types::{Answer, Choices, UnreadReason};
///
/// let choices = Choices::new(vec!["kitchen".into(), "bedroom".into()], 0)?;
/// assert_eq!(read("(B) bedroom", &choices, ReadingMode::Strict), Answer::Chosen(1));
/// assert_eq!(read("Answer: **B**", &choices, ReadingMode::Strict), Answer::Unparsed(UnreadReason::NoChoice));
/// assert_eq!(read("Answer: **B**", &choices, ReadingMode::Lenient), Answer::Chosen(1));
/// # Ok::<(), darkqa_ground::Error>(())
/// ```
#[must_use]
pub fn read(reply: &str, choices: &Choices, mode: ReadingMode) -> Answer {
    let text = match clean::without_reasoning(reply) {
        Ok(text) => text,
        Err(reason) => return Answer::Unparsed(reason),
    };
    if let Some(answer) = strict::read(text, choices.texts()) {
        return answer;
    }
    if let Some(rest) = clean::behind_channel(text) {
        let unread = Answer::Unparsed(UnreadReason::Truncated);
        return strict::read(rest, choices.texts()).unwrap_or(unread);
    }
    match (mode, lenient::read(text, choices)) {
        (ReadingMode::Strict, Answer::Chosen(_)) => Answer::Unparsed(UnreadReason::NoChoice),
        (_, answer) => answer,
    }
}

/// The strict and the lenient parsing of a reply, in this order, considering how the reply ended.
///
/// The exact words of a choice count in any case. Otherwise a separate refusal, a content filter and the token limit
/// decide, in this order. A truncated explanation is not read leniently, because it could still have ended in another
/// choice.
#[must_use]
pub fn readings(reply: &Reply, choices: &Choices) -> (Answer, Answer) {
    let strict = read(&reply.text, choices, ReadingMode::Strict);
    if let Answer::Chosen(_) = strict {
        return (strict, strict);
    }
    let reason = match &reply.finish {
        _ if reply.refusal.is_some() => UnreadReason::Refused,
        Finish::Filter => UnreadReason::Filtered,
        Finish::Length => UnreadReason::Truncated,
        Finish::Stop | Finish::Other(_) | Finish::Unknown => {
            return (strict, read(&reply.text, choices, ReadingMode::Lenient));
        }
    };
    (Answer::Unparsed(reason), Answer::Unparsed(reason))
}
