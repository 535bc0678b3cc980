//! Failures: parsing of server errors, their causes, and the decision whether to retry a request.

mod api_error;
mod ask_error;
mod implied_status;
mod moderation;
mod quota_refusal;
mod refused;
mod structured_error;
mod unfinished;
mod vocabulary;
mod wording;

pub(super) use api_error::{ApiError, ReplyError, Unreadable, page_title};
pub(super) use ask_error::Refusal;
pub(super) use ask_error::Retry;
pub use ask_error::{AskError, Reach};
pub(super) use implied_status::implied_status;
pub(super) use moderation::{is_moderated, is_out_of_tokens};
pub(crate) use quota_refusal::QuotaRefusal;
pub(super) use structured_error::find_error;
pub(super) use unfinished::{LONG_SILENCE, Unfinished};
pub(super) use wording::Wording;
