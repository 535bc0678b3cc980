//! A [`Question`] with its [`Choices`], and the [`Answer`] that is read from a reply.

use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::strict_group::StrictGroup;
use crate::error::Error;
use crate::types::images::FrameId;
use crate::types::text::counted;

/// The name of a question, unique in its data set.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct QuestionId(pub String);

impl fmt::Display for QuestionId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

/// The kind of a question: one of the paper's five families, or a category of a ready-made set.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Family {
    /// "What type of room is this?"
    RoomType,
    /// "I want to sleep, is this room suitable for this?"
    Affordance,
    /// "Is there a cushion in the image?"
    Presence,
    /// "What color is the sofa in the image?"
    Color,
    /// "Which object is closest to the camera?"
    Closest,
    /// A category of a ready-made set, by its name there.
    Other(String),
}

impl Family {
    /// The name of all families together in tables and files; no family may have this name.
    pub const TOTAL: &str = "all";

    /// The paper's five families.
    pub const PAPER: [Self; 5] = [Self::RoomType, Self::Affordance, Self::Presence, Self::Color, Self::Closest];

    /// The name in files and tables: `room_type`, `affordance`, `presence`, `color`, `closest`, or a ready-made set's
    /// name.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::RoomType => "room_type",
            Self::Affordance => "affordance",
            Self::Presence => "presence",
            Self::Color => "color",
            Self::Closest => "closest",
            Self::Other(name) => name,
        }
    }
}

impl From<&str> for Family {
    fn from(name: &str) -> Self {
        Self::PAPER.into_iter().find(|family| family.name() == name).unwrap_or_else(|| Self::Other(name.to_owned()))
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl Serialize for Family {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Family {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Self::from(String::deserialize(deserializer)?.as_str()))
    }
}

/// The answers that a question offers, in the order shown, and the index of the true one if it is known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Choices {
    texts: Arc<[String]>,
    truth: Option<usize>,
}

impl Choices {
    /// The maximum number of choices: one letter each.
    pub const MOST: usize = 26;

    /// Checks a list of choices: there are 2 to 26, none is empty, no two are equal (without regard to letter case and
    /// outer spaces), and `truth` is the index of one of them.
    ///
    /// # Errors
    /// [`Error::Data`] at the place `choices`.
    pub fn new(texts: Vec<String>, truth: usize) -> Result<Self, Error> {
        Self::with_truth(texts.into(), Some(truth))
    }

    /// Checks a list of choices without a known true one, as [`new`](Self::new) does.
    ///
    /// # Errors
    /// [`Error::Data`] at the place `choices`.
    pub fn without_truth(texts: Vec<String>) -> Result<Self, Error> {
        Self::with_truth(texts.into(), None)
    }

    /// Checks a list of choices with the index of the true one, or `None` if nobody knows it.
    ///
    /// # Errors
    /// [`Error::Data`] at the place `choices`.
    pub fn with_truth(texts: Arc<[String]>, truth: Option<usize>) -> Result<Self, Error> {
        if !(2..=Self::MOST).contains(&texts.len()) {
            return choices_error(format!("{}: a question needs 2 to {}", counted(texts.len(), "choice"), Self::MOST));
        }
        if let Some(truth) = truth.filter(|truth| *truth >= texts.len()) {
            return choices_error(format!("the answer is choice {} of {}", truth + 1, texts.len()));
        }
        let folded: Vec<String> = texts.iter().map(|text| text.trim().to_lowercase()).collect();
        for (i, text) in folded.iter().enumerate() {
            if text.is_empty() {
                return choices_error(format!("choice {} is empty", letter(i)));
            }
            if let Some(j) = folded[..i].iter().position(|earlier| earlier == text) {
                return choices_error(format!("choices {} and {} are both {:?}", letter(j), letter(i), texts[i]));
            }
        }
        Ok(Self { texts, truth })
    }

    /// The choices in the order shown.
    #[must_use]
    pub fn texts(&self) -> &[String] {
        &self.texts
    }

    /// The index of the true choice; `None` if nobody knows it, so that a reply is neither right nor wrong.
    #[must_use]
    pub fn truth(&self) -> Option<usize> {
        self.truth
    }

    /// The number of choices, at least 2.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "there are always two")]
    pub fn len(&self) -> usize {
        self.texts.len()
    }
}

/// The text of the choice "not enough is visible". A choice with these words, in any letter case, is not a wrong answer
/// but an abstention.
pub const CANNOT_TELL: &str = "cannot tell";

/// Whether the true answers to the questions of a run are known: of all of its questions, or of none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Truths {
    /// Every question has a true answer: replies are right or wrong.
    Known,
    /// No true answer is known: a model is compared with its own answers at L0.
    Unknown,
}

fn choices_error(problem: String) -> Result<Choices, Error> {
    Err(Error::data("choices", problem))
}

/// The letter of the choice at an index: 0 is `A`.
#[must_use]
pub fn letter(index: usize) -> char {
    char::from(b'A' + (index % Choices::MOST) as u8)
}

/// One multiple-choice question about one frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Question {
    /// The name of the question, unique in its data set.
    pub id: QuestionId,
    /// The frame that the question is about.
    pub frame: FrameId,
    /// The family of the question.
    pub family: Family,
    /// The text of the question, without the choices.
    pub text: String,
    /// The answers that the model may choose from.
    pub choices: Choices,
    /// The group of questions that are scored together; `None` if the data set has no groups.
    pub group: Option<StrictGroup>,
    /// The facts from which the generator derived the answer; `Null` if the data set states none.
    pub evidence: serde_json::Value,
}

/// The answer that is read from a reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// A choice, by its index.
    Chosen(usize),
    /// No readable choice; a choice is never guessed.
    Unparsed(UnreadReason),
}

/// The reason why no choice could be read from a reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UnreadReason {
    /// The reply was empty.
    Empty,
    /// The model refused to answer.
    Refused,
    /// The reply was cut at the token limit before an answer.
    Truncated,
    /// A content filter withheld the reply.
    Filtered,
    /// More than one choice was named.
    Ambiguous,
    /// The reply named a letter that no choice has.
    OutOfRange,
    /// The reply named the letter of one choice with the text of another.
    Contradiction,
    /// The reply named one choice only to deny it.
    Negated,
    /// No choice was named in a form that the parsing accepts.
    NoChoice,
    /// A person said that they cannot tell.
    CannotTell,
}

impl UnreadReason {
    /// All reasons, in the order of tables.
    pub const ALL: [Self; 10] = [
        Self::Empty,
        Self::Refused,
        Self::Truncated,
        Self::Filtered,
        Self::Ambiguous,
        Self::OutOfRange,
        Self::Contradiction,
        Self::Negated,
        Self::NoChoice,
        Self::CannotTell,
    ];
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(texts: &[&str]) -> Vec<String> {
        texts.iter().map(|&text| text.to_owned()).collect()
    }

    #[test]
    fn choices_are_checked() {
        assert!(Choices::new(texts(&["yes", "no"]), 1).is_ok());
        let unknown = Choices::without_truth(texts(&["yes", "no"])).unwrap();
        assert_eq!(unknown.truth(), None);
        assert!(Choices::without_truth(texts(&["yes", " Yes "])).is_err());
        for (list, truth) in [
            (vec!["yes"], 0),
            (vec!["yes", "no"], 2),
            (vec!["yes", " Yes "], 0),
            (vec!["yes", ""], 0),
            (vec!["x"; 27], 0),
        ] {
            assert!(Choices::new(texts(&list), truth).is_err(), "{list:?} {truth}");
        }
    }

    #[test]
    fn families_read_back() {
        for family in Family::PAPER.into_iter().chain([Family::Other("OCR".into())]) {
            assert_eq!(Family::from(family.name()), family);
        }
    }
}
