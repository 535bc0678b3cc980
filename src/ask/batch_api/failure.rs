//! The reason why a call of the files or batches interface did not succeed: [`ApiFailure`].

use std::time::Duration;

use crate::ask::complaint::Complaint;
use crate::ask::secret::Scrub;

/// Whether a call that did not succeed may have changed something at the server.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Effect {
    /// The server refused the call, so nothing was changed.
    None,
    /// The connection broke, or the server failed: the file or batch may exist.
    Unknown,
}

/// The refusal of a batch because too many tokens already wait for batches.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct QuotaRefusal {
    /// The number of tokens that may wait; `None` if the server does not say.
    pub limit: Option<u64>,
    /// The server's words, without secrets.
    pub message: String,
}

impl QuotaRefusal {
    /// The refusal in an error; `None` if the error is about something else.
    pub(super) fn of(complaint: &Complaint, scrub: &Scrub) -> Option<Self> {
        let is_quota = complaint.has_code(&["token_limit_exceeded"])
            || complaint.mentions_any(&["enqueued token"]);
        is_quota.then(|| Self {
            limit: stated_limit(&complaint.message),
            message: scrub.line(&complaint.message),
        })
    }
}

/// The number behind "Limit:", with or without commas.
fn stated_limit(message: &str) -> Option<u64> {
    let lower = message.to_lowercase();
    let (_, behind) = lower.split_once("limit:")?;
    let number = behind.trim_start().chars();
    let digits = number.take_while(|c| c.is_ascii_digit() || matches!(c, ',' | '_'));
    let digits: String = digits.filter(char::is_ascii_digit).collect();
    digits.parse().ok().filter(|limit| *limit > 0)
}

/// The reason why a call did not succeed; secrets are removed from its text.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub(crate) struct ApiFailure {
    /// The HTTP status; `None` without a response.
    pub status: Option<u16>,
    /// The server's words with its address.
    pub message: String,
    /// Whether the call may have changed something.
    pub effect: Effect,
    /// The wait that the server asked for; `None` if it asked for none.
    pub wait: Option<Duration>,
    /// The refusal because too many tokens wait; `None` if the reason is another one.
    pub quota: Option<QuotaRefusal>,
}

impl ApiFailure {
    /// Whether the same call would fail again: the key, the address or the request is wrong.
    pub(crate) fn is_permanent(&self) -> bool {
        let passing = matches!(self.status, None | Some(408 | 409 | 425 | 429 | 500..));
        !passing && self.quota.is_none()
    }

    /// Whether the server has no such interface.
    pub(crate) fn is_unsupported(&self) -> bool {
        matches!(self.status, Some(404 | 405 | 501))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_of_waiting_tokens_is_read_from_words() {
        let of = |code: Option<&str>, message: &str| {
            let error = serde_json::json!({"code": code, "message": message});
            QuotaRefusal::of(&Complaint::of_error(&error), &Scrub::default())
        };
        let words = "Enqueued token limit reached for gpt-4o in organization o. Limit: 90,000 enqueued tokens. Please try again \
                     once some in_progress batches have been completed.";
        assert_eq!(of(None, words).unwrap().limit, Some(90_000));
        let azure = of(Some("token_limit_exceeded"), "The limit was exceeded");
        assert_eq!(azure.unwrap().limit, None);
        assert_eq!(of(None, "Rate limit reached. Limit: 30000"), None);
    }
}
