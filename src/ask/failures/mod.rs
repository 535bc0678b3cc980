//! Failures: parsing of server errors, their causes, and the decision whether to retry a request.

mod api_error;
mod ask_error;
mod refused;
mod vocabulary;

pub(super) use api_error::{ApiError, ReplyError, Unreadable, find_error, page_title};
pub(super) use ask_error::{LONG_SILENCE, Refusal, Retry, Unfinished};
pub(super) use refused::implied_status;
pub(super) use vocabulary::{Wording, is_moderated, is_out_of_tokens};

pub use ask_error::{AskError, QuotaRefusal, Reach};
