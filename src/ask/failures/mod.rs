//! Failures: parsing of server errors, their causes, and the decision whether to retry a request.

mod api_error;
mod ask_error;
mod quota_refusal;
mod refused;
mod unfinished;
mod vocabulary;
mod wording;

pub(super) use api_error::{ApiError, ReplyError, Unreadable, page_title};
pub(super) use ask_error::Retry;
pub use ask_error::{AskError, Reach};
pub(crate) use quota_refusal::QuotaRefusal;
pub(super) use unfinished::{LONG_SILENCE, Unfinished};
pub(super) use wording::Wording;
