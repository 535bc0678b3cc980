//! [`AskedItem`]: a question as asked, independent of the model.

use std::borrow::Cow;
use std::hash::{Hash, Hasher};

use crate::types::{Family, FrameId, QuestionId, Shared};

/// One question in one order of its choices and one repeat.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AskedItem {
    /// The name of the question.
    pub question: Shared<QuestionId>,
    /// The frame of the question, or the walk of an open question.
    pub frame: Shared<FrameId>,
    /// The family of the question, or the category of an open question.
    pub family: Shared<Family>,
    /// The choices in the order shown; empty for an open question.
    pub choices: Shared<Vec<String>>,
    /// The index of the true choice; `None` if nobody knows it.
    pub truth: Option<usize>,
    /// How many times the same question was asked before.
    pub repeat: u32,
}

/// The fields of an [`AskedItem`] without the question, borrowed from a record.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct AskedParts<'r> {
    /// The name of the frame or walk.
    pub frame: &'r str,
    /// The family or category.
    pub family: Cow<'r, Family>,
    /// The choices in the order shown.
    pub choices: &'r [String],
    /// The index of the true choice; `None` if nobody knows it.
    pub truth: Option<usize>,
    /// How many times the same question was asked before.
    pub repeat: u32,
}

impl AskedItem {
    /// Identity of an item: the question, the order of its choices and the repeat.
    #[must_use]
    pub fn key(&self) -> (&QuestionId, &[String], u32) {
        (&self.question, &self.choices, self.repeat)
    }

    /// The item of a record.
    pub(super) fn new(question: &QuestionId, parts: &AskedParts<'_>) -> Self {
        Self {
            question: question.clone().into(),
            frame: FrameId(parts.frame.to_owned()).into(),
            family: parts.family.clone().into_owned().into(),
            choices: parts.choices.to_vec().into(),
            truth: parts.truth,
            repeat: parts.repeat,
        }
    }

    /// The question and the other fields, as a record contains them.
    pub(super) fn parts(&self) -> (&QuestionId, AskedParts<'_>) {
        let parts = AskedParts {
            frame: &self.frame.0,
            family: Cow::Borrowed(&self.family),
            choices: &self.choices,
            truth: self.truth,
            repeat: self.repeat,
        };
        (&self.question, parts)
    }
}

/// Equals the hash of its parts, so that an item is found without building another one.
impl Hash for AskedItem {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.parts().hash(state);
    }
}
