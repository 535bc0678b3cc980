//! What is put to a model: [`Call`], a question as a [`Query`] and as a [`Message`].

use std::sync::Arc;

use super::failure::{AskError, Reach};
use super::payload::Payload;
use crate::types::{Condition, FailureKind, Question, QuestionId};

/// What is put to a model.
#[derive(Debug, Clone, Copy)]
pub enum Query<'a> {
    /// A question with choices.
    Choice(&'a Question),
    /// A question that is answered in words of one's own, by its name.
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

    /// How many choices there are; 0 where the answer is open.
    #[must_use]
    pub fn choices(self) -> usize {
        match self {
            Self::Choice(question) => question.choices.len(),
            Self::Open(_) => 0,
        }
    }

    /// The question with choices, for models that know no other.
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

/// The one message of a conversation: words, images, and the words behind them.
#[derive(Debug, Clone, Copy)]
pub struct Message<'a> {
    /// The words before the images; all of them where there are no images.
    pub before: &'a str,
    /// The images; none for a question put in words alone.
    pub images: &'a [Arc<Payload>],
    /// The words behind the images; empty for none.
    pub behind: &'a str,
}

impl<'a> Message<'a> {
    /// Words alone.
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
    /// The question; models made in process look at it, the others at the message.
    pub query: Query<'a>,
    /// What the images show; `None` where none are shown.
    pub condition: Option<&'a Condition>,
    /// The question in words, with its images.
    pub message: Message<'a>,
    /// How many times the question was put before, in whatever order of its choices.
    pub turn: u32,
}
