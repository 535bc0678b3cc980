//! Failures: the errors of servers, their wordings, and whether a request is retried.

mod complaint;
mod failure;
mod failure_class;
mod quota_refusal;
mod wording;

pub(super) use complaint::{Complaint, Unreadable, UnreadableReply, page_title};
pub(super) use failure::Again;
pub use failure::{AskError, Reach};
pub(crate) use quota_refusal::QuotaRefusal;
pub(super) use wording::Wording;
