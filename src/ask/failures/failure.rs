//! The reason why no reply came: [`AskError`].

use std::time::Duration;

use super::quota_refusal::QuotaRefusal;
use crate::ask::costs::Charge;
use crate::ask::requests::AdaptableField;
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

/// Whether a request without a reply is sent again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Again {
    /// The same request would fail again.
    Never,
    /// The same request may succeed later; this spends one of `--retries`.
    Later,
    /// The endpoint takes no more at the moment. This is a wait and no try: only `--retries patience` ends it.
    WhenTaken,
}

/// The reason why a request, or a question after all its requests, has no reply.
///
/// The run stores its [`Failure`] alone; the other fields decide what is done next.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", failure.message)]
pub struct AskError {
    /// The part that is stored: of a question, the failure of its last request.
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
    pub(crate) again: Again,
    /// The wait that the server asked for; `None` if it asked for none.
    pub(crate) wait: Option<Duration>,
    /// Whether the server may have worked on the request without saying so: charged it, or made a file or batch.
    pub(crate) may_have_effect: bool,
    /// The refusal of a batch because too many tokens wait; `None` if the reason is another one.
    pub(crate) quota: Option<Box<QuotaRefusal>>,
}

impl AskError {
    /// A failed request without an HTTP status, which is not retried and does not affect others. It may have had an effect if it timed
    /// out or has a response.
    pub(crate) fn new(kind: FailureKind, message: String) -> Self {
        Self {
            may_have_effect: matches!(kind, FailureKind::Timeout | FailureKind::Response),
            failure: Failure {
                kind,
                status: None,
                message,
            },
            attempts: 1,
            reach: Reach::Trial,
            refused_field: None,
            lost: Box::default(),
            finish: None,
            again: Again::Never,
            wait: None,
            quota: None,
        }
    }

    /// A question whose request was given up while it was in flight. It may be paid for, and the same command asks it again.
    pub(crate) fn given_up() -> Self {
        let message = "given up while in flight, because the run was interrupted".to_owned();
        Self {
            reach: Reach::Interrupted,
            ..Self::new(FailureKind::Timeout, message)
        }
    }

    /// The failure of a request that was charged these tokens.
    pub(in crate::ask) fn charged(mut self, usage: Option<Usage>) -> Self {
        self.lost.add(usage);
        self
    }

    /// The charge for the request.
    pub(in crate::ask) fn charge(&self) -> Charge {
        match *self.lost {
            lost if lost.attempts > 0 => Charge::Stated(lost.usage),
            _ if self.may_have_effect => Charge::Unknown,
            _ => Charge::Nothing,
        }
    }

    /// The error of the question if this was the last of its `attempts` requests, some of which were charged.
    pub(in crate::ask) fn after(self, attempts: u32, lost: LostAttempts) -> Self {
        Self {
            attempts,
            lost: Box::new(lost),
            ..self
        }
    }

    /// Whether the same call of the files or batches interface would fail again: the key, the address or the request is wrong.
    pub(crate) fn is_permanent(&self) -> bool {
        let status = self.failure.status;
        let passing = matches!(status, None | Some(408 | 409 | 425 | 429 | 500..));
        !passing && self.quota.is_none()
    }

    /// Whether the server has no such interface.
    pub(crate) fn is_unsupported(&self) -> bool {
        matches!(self.failure.status, Some(404 | 405 | 501))
    }
}
