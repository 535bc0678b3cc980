//! Reading the choice out of a reply, by exact match: [`read`] and [`readings`].
//!
//! Two readings are always reported beside each other. [`ReadingMode::Strict`] takes a reply that is an answer and nothing
//! else; [`ReadingMode::Lenient`] also finds an answer inside a reply, and where two readings are possible it takes neither.
//! No choice is ever guessed, and where the strict reading finds one the lenient reading finds the same.
//!
//! A reply passes through `clean` (hidden reasoning, invisible characters, leaked tokens), `strict`, and then the
//! levels of `lenient`, in the order that its table shows.

mod clean;
mod lenient;
mod letters;
mod markers;
mod names;
mod plain;
mod refusal;
mod stated;
mod strict;
#[cfg(test)]
mod tests;
mod view;
mod written;

use serde::Serialize;

use crate::types::question::{Answer, Choices, UnreadReason};
use crate::types::reply::{Finish, Reply};

/// How much of a reply may stand around the answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ReadingMode {
    /// Nothing: the whole reply is a choice's text, its letter, or its letter with its text. The headline number.
    Strict,
    /// Sentences, markup, JSON, LaTeX; as long as one choice alone is meant.
    Lenient,
}

impl ReadingMode {
    /// Both, the headline first.
    pub const ALL: [Self; 2] = [Self::Strict, Self::Lenient];
}

/// The choice that a reply makes; its index is that of the order shown.
///
/// Whatever stands in a closed reasoning block is left out; a block that is opened and never closed leaves nothing to
/// read and is [`UnreadReason::Truncated`].
///
/// ```
/// use darkqa_eval::score::choice::{ReadingMode, read};
/// use darkqa_eval::types::{Answer, Choices, UnreadReason};
///
/// let choices = Choices::new(vec!["kitchen".into(), "bedroom".into()], 0)?;
/// assert_eq!(read("(B) bedroom", &choices, ReadingMode::Strict), Answer::Chosen(1));
/// assert_eq!(read("Answer: **B**", &choices, ReadingMode::Strict), Answer::Unparsed(UnreadReason::NoChoice));
/// assert_eq!(read("Answer: **B**", &choices, ReadingMode::Lenient), Answer::Chosen(1));
/// # Ok::<(), darkqa_eval::Error>(())
/// ```
#[must_use]
pub fn read(reply: &str, choices: &Choices, mode: ReadingMode) -> Answer {
    let text = match clean::spoken(reply) {
        Ok(text) => text,
        Err(why) => return Answer::Unparsed(why),
    };
    if let Some(answer) = strict::read(text, choices.texts()) {
        return answer;
    }
    match (mode, lenient::read(text, choices)) {
        (ReadingMode::Strict, Answer::Chosen(_)) => Answer::Unparsed(UnreadReason::NoChoice),
        (_, answer) => answer,
    }
}

/// The strict and the lenient reading of a reply, in this order, with regard to how it ended.
///
/// The exact words of a choice count however the reply ended. Otherwise a refusal beside the text, a content filter
/// and the token limit decide, in this order: an explanation that was cut may still have changed its mind, so it is
/// not read leniently.
#[must_use]
pub fn readings(reply: &Reply, choices: &Choices) -> (Answer, Answer) {
    let strict = read(&reply.text, choices, ReadingMode::Strict);
    if let Answer::Chosen(_) = strict {
        return (strict, strict);
    }
    let why = match &reply.finish {
        _ if reply.refusal.is_some() => UnreadReason::Refused,
        Finish::Filter => UnreadReason::Filtered,
        Finish::Length => UnreadReason::Truncated,
        Finish::Stop | Finish::Other(_) | Finish::Unknown => {
            return (strict, read(&reply.text, choices, ReadingMode::Lenient));
        }
    };
    (Answer::Unparsed(why), Answer::Unparsed(why))
}
