//! The model and condition of a trial ([`AskedModel`]), and how the trial ended ([`Ending`],
//! [`Stopped`]).

use serde::{Deserialize, Serialize};

use crate::types::records::record::{FailureKind, Via, View};
use crate::types::{Condition, Finish, LostAttempts};

/// A model, and the condition of the images that it was shown.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub(super) struct AskedModel {
    pub(super) model: String,
    pub(super) view: View,
    /// The condition of the images; `None` without images.
    pub(super) condition: Option<Condition>,
}

/// How a trial ended. Many trials share one value.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
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
    /// The reason why the model stopped, as far as it decides whether the trial is asked again.
    pub(super) stopped: Stopped,
    /// Number of requests that were sent.
    pub(super) attempts: u32,
    /// The attempts that were charged and gave no reply, or a reply that was replaced by asking again.
    pub(super) lost: LostAttempts,
    /// Token limit of the reply if it exceeds that of the run's first call.
    pub(super) max_tokens: Option<u32>,
}

/// The reason why a model stopped, as far as it decides whether its trial is asked again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stopped {
    /// No reason: no reply came.
    #[default]
    Unknown,
    /// The token limit.
    Length,
    /// Another reason.
    Other,
}

impl From<Option<&Finish>> for Stopped {
    fn from(finish: Option<&Finish>) -> Self {
        match finish {
            None => Self::Unknown,
            Some(Finish::Length) => Self::Length,
            Some(_) => Self::Other,
        }
    }
}
