//! One question to a model, [`Call`]: the question as a [`Query`] and as a [`Message`].

use std::sync::Arc;

use super::failure::{AskError, Reach};
use super::payload::Payload;
use crate::types::{Condition, FailureKind, Question, QuestionId};

/// A question to a model, with choices or open.
#[derive(Debug, Clone, Copy)]
pub enum Query<'a> {
    /// A question with choices.
    Choice(&'a Question),
    /// An open question, by its name.
    Open(&'a QuestionId),
}

impl<'a> Query<'a> {
    /// The name of the question.
    #[must_use]
    pub fn id(self) -> &'a QuestionId {
        match self {
            Self::Choice(question) => &question.id,
            Self::Open(id) => id,
        }
    }

    /// The number of choices; 0 if the question is open.
    #[must_use]
    pub fn choices(self) -> usize {
        match self {
            Self::Choice(question) => question.choices.len(),
            Self::Open(_) => 0,
        }
    }

    /// The question with choices; an error if it is open, for models that can only choose.
    pub(super) fn choice(self) -> Result<&'a Question, AskError> {
        match self {
            Self::Choice(question) => Ok(question),
            Self::Open(id) => {
                let message =
                    format!("question {id} has no choices, and this model can only choose");
                let error = AskError::new(FailureKind::Request, message, 0);
                Err(AskError {
                    reach: Reach::Endpoint,
                    ..error
                })
            }
        }
    }
}

/// The single message of a conversation: text, images, and the text after them.
#[derive(Debug, Clone, Copy)]
pub struct Message<'a> {
    /// The text before the images; the whole text if there are none.
    pub before: &'a str,
    /// The images; empty for a question without images.
    pub images: &'a [Arc<Payload>],
    /// The text after the images; may be empty.
    pub behind: &'a str,
}

impl<'a> Message<'a> {
    /// A message of text, without images.
    #[must_use]
    pub fn words(before: &'a str) -> Self {
        Self {
            before,
            images: &[],
            behind: "",
        }
    }
}

/// Everything a model needs to answer one question.
#[derive(Debug, Clone, Copy)]
pub struct Call<'a> {
    /// The question; models in this process read it, remote models read the message.
    pub query: Query<'a>,
    /// The condition of the images; `None` if there are no images.
    pub condition: Option<&'a Condition>,
    /// The text of the question, with its images.
    pub message: Message<'a>,
    /// The number of times the question was asked before, in any order of its choices.
    pub turn: u32,
}
