//! [`AskedItem`]: a question as asked, independent of the model.

use std::borrow::Cow;
use std::hash::{Hash, Hasher};

use serde::{Deserialize, Serialize};

use crate::types::{Family, FrameId, QuestionId, Shared};

/// One question in one wording, one order of its choices and one repeat.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
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
    /// The name of the prompts; `None` if the run asks with one set of prompts.
    pub wording: Option<Shared<String>>,
    /// The number of the order of the choices among those of the question, from 0.
    pub order: u32,
    /// How many times the same question was asked before in this wording and order.
    pub repeat: u32,
}

/// The identity of an item within a run, or across runs of the same data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ItemKey<'a> {
    /// The name of the question.
    pub question: &'a QuestionId,
    /// The number of earlier trials of the question in this wording and order.
    pub repeat: u32,
    /// The name of the prompts; `None` if the run asks with one set of prompts.
    pub wording: Option<&'a str>,
    /// The choices in the order shown.
    pub choices: &'a [String],
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
    /// The name of the prompts; `None` if the run asks with one set of prompts.
    pub wording: Option<&'r str>,
    /// The number of the order of the choices among those of the question, from 0.
    pub order: u32,
    /// How many times the same question was asked before in this wording and order.
    pub repeat: u32,
}

impl AskedItem {
    /// The identity of the item.
    #[must_use]
    pub fn key(&self) -> ItemKey<'_> {
        ItemKey {
            question: &self.question,
            repeat: self.repeat,
            wording: self.wording.as_ref().map(|wording| wording.as_str()),
            choices: &self.choices,
        }
    }

    /// The item of a record.
    pub(super) fn new(question: &QuestionId, parts: &AskedParts<'_>) -> Self {
        Self {
            question: question.clone().into(),
            frame: FrameId(parts.frame.to_owned()).into(),
            family: parts.family.clone().into_owned().into(),
            choices: parts.choices.to_vec().into(),
            truth: parts.truth,
            wording: parts.wording.map(|wording| wording.to_owned().into()),
            order: parts.order,
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
            wording: self.wording.as_ref().map(|wording| wording.as_str()),
            order: self.order,
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
