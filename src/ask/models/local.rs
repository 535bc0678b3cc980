//! Model that a function in this process answers for: [`Local`].

use std::fmt;

use serde_json::{Value, json};

use super::random::Random;
use crate::ask::failures::AskError;
use crate::ask::requests::Call;
use crate::types::questions::letter;
use crate::types::{Digest, FailureKind, Finish, Observed, Question, Reply};

/// Finish reason of a reply that is a guess.
const GUESS: &str = "guess";

/// Answer of the function of a [`Local`] model.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct LocalAnswer {
    /// Index of the choice; `None` if the function does not know.
    pub(crate) choice: Option<usize>,
    /// Observation to record; `None` without an image.
    pub(crate) observed: Option<Observed>,
    /// True to record the answer as a guess.
    pub(crate) guessed: bool,
}

/// A function that answers a question.
pub(crate) type AnswerFn = dyn Fn(&Question, &Call<'_>) -> Result<LocalAnswer, String> + Send + Sync;

/// Model whose answers come from a function. If the function does not know the answer, [`Random`] guesses: the same
/// seed, question, condition and turn give the same guess.
pub struct Local {
    name: String,
    digest: Digest,
    fallback: Random,
    answer_fn: Box<AnswerFn>,
}

impl fmt::Debug for Local {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Local({})", self.name)
    }
}

impl Local {
    /// Creates a model; `digest` is the digest of everything that decides the function's answers.
    #[must_use]
    pub(crate) fn new(name: String, digest: Digest, fallback: Random, answer_fn: Box<AnswerFn>) -> Self {
        Self { name, digest, fallback, answer_fn }
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn content(&self) -> Value {
        json!({"local": self.name, "digest": self.digest, "prior": self.fallback.content()})
    }

    pub(super) fn answer(&self, question: &Question, call: Call<'_>) -> Result<Reply, AskError> {
        let answer =
            (self.answer_fn)(question, &call).map_err(|message| AskError::new(FailureKind::Request, message))?;
        let text = match answer.choice {
            Some(choice) => letter(choice).to_string(),
            None => self.fallback.answer(question, call),
        };
        let reply = Reply::local(text);
        Ok(Reply {
            finish: if answer.guessed { Finish::Other(GUESS.to_owned()) } else { reply.finish },
            observed: answer.observed,
            chances: None,
            ..reply
        })
    }
}
