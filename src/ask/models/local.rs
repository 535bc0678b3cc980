//! A model whose answers a function of this process gives: [`Local`].

use std::fmt;

use serde_json::{Value, json};

use super::random::Random;
use crate::ask::failures::AskError;
use crate::ask::requests::Call;
use crate::types::questions::letter;
use crate::types::{Digest, FailureKind, Finish, Observed, Question, Reply};

/// Reason for the end of a reply that is a guess.
const GUESS: &str = "guess";

/// The answer of a function.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct LocalAnswer {
    /// Index of the choice; `None` if the function does not know.
    pub(crate) choice: Option<usize>,
    /// The observation, for the record; `None` without an image.
    pub(crate) observed: Option<Observed>,
    /// Whether the record calls the answer a guess.
    pub(crate) guessed: bool,
}

/// A function that answers a question.
pub(crate) type Opinion = dyn Fn(&Question, &Call<'_>) -> Result<LocalAnswer, String> + Send + Sync;

/// A model whose answers a function gives. If the function does not know, a choice is guessed as [`Random`] does: the same
/// seed, question, condition and turn give the same guess.
pub struct Local {
    name: String,
    digest: Digest,
    prior: Random,
    opinion: Box<Opinion>,
}

impl fmt::Debug for Local {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Local({})", self.name)
    }
}

impl Local {
    /// A model with a name; `digest` is the digest of everything that decides the function's answers.
    #[must_use]
    pub(crate) fn new(name: String, digest: Digest, prior: Random, opinion: Box<Opinion>) -> Self {
        Self {
            name,
            digest,
            prior,
            opinion,
        }
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn content(&self) -> Value {
        json!({"local": self.name, "digest": self.digest, "prior": self.prior.content()})
    }

    pub(super) fn answer(&self, question: &Question, call: Call<'_>) -> Result<Reply, AskError> {
        let answer = (self.opinion)(question, &call);
        let answer = answer.map_err(|message| AskError::new(FailureKind::Request, message))?;
        let text = match answer.choice {
            Some(choice) => letter(choice).to_string(),
            None => self.prior.answer(question, call),
        };
        let reply = Reply::local(text);
        Ok(Reply {
            finish: if answer.guessed {
                Finish::Other(GUESS.to_owned())
            } else {
                reply.finish
            },
            observed: answer.observed,
            chances: None,
            ..reply
        })
    }
}
