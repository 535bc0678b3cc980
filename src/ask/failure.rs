//! The reason why no reply came: [`AskError`] for a question, [`FailedTry`] for one of its requests.

use std::time::Duration;

use super::field::AdaptableField;
use super::spending::Charge;
use crate::types::{Failure, FailureKind, LostAttempts, Usage};

/// The requests that a failure affects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// Only this request; another may succeed.
    Trial,
    /// Every request of this size: without a reply so far, it is every further one to this model.
    Alike,
    /// Every further request to this model: the cause is the key, credit, address, name or parameters.
    Endpoint,
    /// None: the run ended before the reply, and the request may not have been sent.
    Interrupted,
}

/// The reason why a question has no reply.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", failure.message)]
pub struct AskError {
    /// The failure of the last try.
    pub failure: Failure,
    /// The number of requests that were sent.
    pub attempts: u32,
    /// The requests that the failure affects.
    pub reach: Reach,
    /// The field that the server refused, if the program can change how it is sent.
    pub refused_field: Option<AdaptableField>,
    /// The attempts that were charged.
    pub lost: Box<LostAttempts>,
    /// The word for the reason why the model stopped, if that is why there is no reply.
    pub finish: Option<String>,
}

impl AskError {
    /// A question whose request was given up while it was in flight. It may be paid for, and the same command asks it again.
    pub(crate) fn given_up() -> Self {
        let message = "given up while in flight, because the run was interrupted".to_owned();
        Self {
            reach: Reach::Interrupted,
            ..Self::new(FailureKind::Timeout, message, 1)
        }
    }

    /// A failure without an HTTP status, which does not affect other questions.
    pub(super) fn new(kind: FailureKind, message: String, attempts: u32) -> Self {
        FailedTry::new(kind, message).after(attempts, LostAttempts::default())
    }
}

/// Whether a request without a reply is sent again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Again {
    /// The same request would fail again.
    Never,
    /// The same request may succeed later; this spends one of `--retries`.
    Later,
    /// The endpoint takes no more at the moment. This is a wait and no try: only `--retries patience` ends it.
    WhenTaken,
}

/// One request without a reply.
pub(super) struct FailedTry {
    pub(super) failure: Failure,
    pub(super) reach: Reach,
    pub(super) again: Again,
    /// The wait that the server asked for; `None` if it asked for none.
    pub(super) wait: Option<Duration>,
    /// The field that the server refused, if the program can change how it is sent.
    pub(super) refused_field: Option<AdaptableField>,
    /// The tokens that it was charged; `None` if the server stated none.
    pub(super) usage: Option<Usage>,
    /// Whether it may have been charged although the server stated no tokens: the server may have worked on it.
    pub(super) may_be_charged: bool,
    /// The word for the reason why the model stopped, if that is why there is no reply.
    pub(super) finish: Option<String>,
}

impl FailedTry {
    /// A failed request without an HTTP status, which is not retried. It may have been charged if it timed out or has a reply.
    pub(super) fn new(kind: FailureKind, message: String) -> Self {
        Self {
            may_be_charged: matches!(kind, FailureKind::Timeout | FailureKind::Response),
            failure: Failure {
                kind,
                status: None,
                message,
            },
            reach: Reach::Trial,
            again: Again::Never,
            wait: None,
            refused_field: None,
            usage: None,
            finish: None,
        }
    }

    /// The charge for the request.
    pub(super) fn charge(&self) -> Charge {
        let stated = self.usage.filter(|usage| usage.total() > Some(0));
        match stated {
            Some(usage) => Charge::Stated(usage),
            None if self.may_be_charged => Charge::Unknown,
            None => Charge::Nothing,
        }
    }

    /// The error of the question if this was the last of its `attempts` requests, some of which were charged.
    pub(super) fn after(self, attempts: u32, lost: LostAttempts) -> AskError {
        AskError {
            failure: self.failure,
            attempts,
            reach: self.reach,
            refused_field: self.refused_field,
            lost: Box::new(lost),
            finish: self.finish,
        }
    }
}
