//! Why no reply came: [`AskError`] of a question, [`FailedTry`] of one of its requests.

use std::time::Duration;

use super::field::AdaptableField;
use crate::types::{Failure, FailureKind};

/// How far a failure reaches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// This one request failed; another may succeed.
    Trial,
    /// Every further request to this model would fail alike: key, credit, address, name, parameters.
    Endpoint,
    /// None: it was given up because the run ends, and may not even have been sent.
    Interrupted,
}

/// Why no reply came.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", failure.message)]
pub struct AskError {
    /// What went wrong in the last try.
    pub failure: Failure,
    /// How many requests were sent.
    pub attempts: u32,
    /// Whether it is worth asking anything else.
    pub reach: Reach,
    /// The field that the server does not take, where it is one that can be sent otherwise.
    pub refused: Option<AdaptableField>,
}

impl AskError {
    /// A failure without an HTTP status, which says nothing about other questions.
    pub(super) fn new(kind: FailureKind, message: String, attempts: u32) -> Self {
        FailedTry::new(kind, message).after(attempts)
    }
}

/// One try that brought no reply.
pub(super) struct FailedTry {
    pub(super) failure: Failure,
    pub(super) reach: Reach,
    /// Whether the same request may succeed later.
    pub(super) again: bool,
    /// The wait that the server asked for.
    pub(super) wait: Option<Duration>,
    /// The field that it refused.
    pub(super) refused: Option<AdaptableField>,
}

impl FailedTry {
    /// A try without an HTTP status, not to be repeated.
    pub(super) fn new(kind: FailureKind, message: String) -> Self {
        Self {
            failure: Failure {
                kind,
                status: None,
                message,
            },
            reach: Reach::Trial,
            again: false,
            wait: None,
            refused: None,
        }
    }

    /// The error of a question whose last try this was, the last of so many.
    pub(super) fn after(self, attempts: u32) -> AskError {
        AskError {
            failure: self.failure,
            attempts,
            reach: self.reach,
            refused: self.refused,
        }
    }
}
