//! Parsing of the choice in a model's reply: [`read`] and [`readings`].
//!
//! Two parsings are always reported together. [`ParsingMode::Strict`] accepts a reply that is an answer and nothing
//! else. [`ParsingMode::Lenient`] also finds an answer inside a reply; if two choices are possible, it accepts neither.
//! No choice is ever guessed. If the strict parsing finds a choice, the lenient parsing finds the same.
//!
//! A reply passes through `reasoning` (which removes thoughts and leaked tokens of templates), then `strict`, then the
//! levels of `lenient`. Answers to open questions ([`open_answer`]) and marks of judges ([`llm_match`]) pass through
//! `reasoning`, too.

mod choice_views;
mod letters;
pub mod llm_match;
mod markers;
mod name_index;
mod names;
pub mod option_probabilities;
mod rules;
mod states;
#[cfg(test)]
mod tests;
mod text;
mod view;

use serde::Serialize;

use darkqa_base::types::questions::{Answer, Choices, UnreadReason};
use darkqa_base::types::replies::{Finish, Reply};
use rules::{lenient, strict};
use text::reasoning::{Asked, separate_sections};

pub use text::reasoning::{has_thoughts, open_answer};

/// The version of the lenient parsing, raised whenever the result of any reply may change. `report --rescore` parses
/// the replies of records of another version again. The strict parsing changed only with `lenient/4` (marks of
/// reasoning, and full-width signs around letters) and `lenient/5` (marks of reasoning and tokens of templates by their
/// form).
pub const LENIENT_VERSION: &str = "lenient/5";

/// The parsing of a reply: how much text may surround the answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ParsingMode {
    /// No other text: the reply is a choice's text, its letter, or its letter with its text. Headline numbers use this
    /// parsing.
    Strict,
    /// Sentences, markup, JSON or LaTeX around exactly one choice.
    Lenient,
}

impl ParsingMode {
    /// Both parsings, the one of headline numbers first.
    pub const ALL: [Self; 2] = [Self::Strict, Self::Lenient];

    /// The word in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Strict => "strict",
            Self::Lenient => "lenient",
        }
    }

    /// Selects the value of this parsing from those of both, in the order of [`Self::ALL`].
    #[must_use]
    pub fn of<T>(self, [strict, lenient]: [T; 2]) -> T {
        match self {
            Self::Strict => strict,
            Self::Lenient => lenient,
        }
    }
}

/// The choice in a reply, as an index in the order shown, or the reason why none could be read.
///
/// Text in a closed reasoning block is ignored, whatever the names of its marks. If a block is not closed, the result
/// is [`UnreadReason::Truncated`].
///
/// ```
/// use darkqa_score::choice::{ParsingMode, read};
/// use darkqa_base::types::{Answer, Choices, UnreadReason};
///
/// let choices = Choices::new(vec!["kitchen".into(), "bedroom".into()], 0)?;
/// assert_eq!(read("(B) bedroom", &choices, ParsingMode::Strict), Answer::Chosen(1));
/// assert_eq!(read("Answer: **B**", &choices, ParsingMode::Strict), Answer::Unparsed(UnreadReason::NoChoice));
/// assert_eq!(read("Answer: **B**", &choices, ParsingMode::Lenient), Answer::Chosen(1));
/// # Ok::<(), darkqa_base::Error>(())
/// ```
#[must_use]
pub fn read(reply: &str, choices: &Choices, mode: ParsingMode) -> Answer {
    let texts = choices.texts();
    let is_choice = |text: &str| strict::read(text, texts).is_some();
    let answer = match separate_sections(reply, Asked::Choice(&is_choice)) {
        Ok(answer) => answer,
        Err(reason) => return Answer::Unparsed(reason),
    };
    if let Some(answer) = strict::read(answer.text, texts) {
        return answer;
    }
    if answer.is_open {
        return Answer::Unparsed(UnreadReason::Truncated);
    }
    match (mode, lenient::read(answer.text, choices)) {
        (ParsingMode::Strict, Answer::Chosen(_)) => Answer::Unparsed(UnreadReason::NoChoice),
        (_, answer) => answer,
    }
}

/// The strict and the lenient parsing of a reply, in this order. Unlike [`read`], it considers how the reply ended.
///
/// A choice that the strict parsing finds always counts. Otherwise a content filter, a separate refusal and the token
/// limit decide, in this order. A truncated explanation is not parsed leniently, because it could still have ended in
/// another choice; nor is a text that the server ended early for another reason.
#[must_use]
pub fn readings(reply: &Reply, choices: &Choices) -> (Answer, Answer) {
    let strict = read(&reply.text, choices, ParsingMode::Strict);
    if let Answer::Chosen(_) = strict {
        return (strict, strict);
    }
    let reason = match &reply.finish {
        Finish::Filter => UnreadReason::Filtered,
        _ if reply.refusal.is_some() => UnreadReason::Refused,
        Finish::Length => UnreadReason::Truncated,
        finish if finish.is_whole() => {
            return (strict, read(&reply.text, choices, ParsingMode::Lenient));
        }
        _ => return (strict, strict),
    };
    (Answer::Unparsed(reason), Answer::Unparsed(reason))
}
