//! The model and condition of a trial ([`AskedModel`]), and how the trial ended ([`Ending`]).

use crate::types::Condition;
use crate::types::LostAttempts;
use crate::types::records::record::{FailureKind, Via, View};

/// A model, and the condition of the images that it was shown.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct AskedModel {
    pub(super) model: String,
    pub(super) view: View,
    /// The condition of the images; `None` without images.
    pub(super) condition: Option<Condition>,
}

/// How a trial ended. Many trials share one value.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct Ending {
    /// The model's name in the server's reply.
    pub(super) served_model: Option<String>,
    /// The provider that a router passed the request on to.
    pub(super) provider: Option<String>,
    pub(super) via: Via,
    /// The reason why no reply came, with the HTTP status; `None` if a reply came.
    pub(super) failure: Option<(FailureKind, Option<u16>)>,
    /// The word for a reply that the server ended early, or for a generation that broke off; `None` for other failures
    /// and for whole replies.
    pub(super) ended_by: Option<String>,
    /// Number of requests that were sent.
    pub(super) attempts: u32,
    /// The attempts that were charged and gave no reply, or a reply that was replaced by asking again.
    pub(super) lost: LostAttempts,
    /// Token limit of the reply if it exceeds that of the run's first call.
    pub(super) max_tokens: Option<u32>,
}
