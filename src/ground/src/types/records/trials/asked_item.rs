//! [`AskedItem`]: a question as asked, independent of the model.

use std::borrow::Cow;
use std::hash::{Hash, Hasher};

use crate::types::{Family, FrameId, QuestionId, Shared};

/// One question in one order of its choices and one repeat.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AskedItem {
    /// The name of the question.
    pub question: Shared<QuestionId>,
    /// The frame of the question; of an open question its walk.
    pub frame: Shared<FrameId>,
    /// The family of the question; of an open question its category.
    pub family: Shared<Family>,
    /// The choices in the order shown; none of an open question.
    pub choices: Shared<Vec<String>>,
    /// The index of the true choice; `None` if nobody knows it.
    pub truth: Option<usize>,
    /// How many times the same question was asked before.
    pub repeat: u32,
}

/// The fields of a record's item, without the question.
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

    /// The item's fields as a record holds them.
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

/// As its parts, so that an item is found by them.
impl Hash for AskedItem {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.parts().hash(state);
    }
}
