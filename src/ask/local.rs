//! A model that a function makes in process: [`Local`].

use std::fmt;

use super::{AskError, Call, Random, Reach, failure};
use crate::types::question::letter;
use crate::types::{Digest, FailureKind, Question, Reply};

/// What a function says to a question: the index of a choice, or `None` where it does not know.
pub type Opinion = dyn Fn(&Question, &Call<'_>) -> Result<Option<usize>, String> + Send + Sync;

/// A model whose answers a function gives. Where it does not know, any choice is as likely as another, and the same one for
/// the same seed, question, condition and turn.
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
    /// A model of a name; `digest` is that of all that decides what the function says.
    #[must_use]
    pub fn new(name: String, digest: Digest, prior: Random, opinion: Box<Opinion>) -> Self {
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

    pub(super) fn digest(&self) -> Digest {
        let prior = self.prior.digest();
        Digest::of_parts([
            self.name.as_bytes(),
            self.digest.as_bytes(),
            prior.as_bytes(),
        ])
    }

    pub(super) fn answer(&self, question: &Question, call: Call<'_>) -> Result<Reply, AskError> {
        match (self.opinion)(question, &call) {
            Ok(Some(choice)) => Ok(Reply::local(letter(choice).to_string())),
            Ok(None) => Ok(Reply::local(self.prior.answer(question, call))),
            Err(message) => Err(AskError {
                failure: failure(FailureKind::Request, message),
                attempts: 1,
                reach: Reach::Trial,
                refused: None,
            }),
        }
    }
}
