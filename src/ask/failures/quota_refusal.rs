//! The refusal of a batch because of the tokens that wait: [`QuotaRefusal`].

use super::complaint::Complaint;
use crate::ask::secrets::Scrub;

/// The refusal of a batch because too many tokens already wait for batches.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct QuotaRefusal {
    /// The number of tokens that may wait; `None` if the server does not state it.
    pub limit: Option<u64>,
    /// The server's words, without secrets.
    pub message: String,
}

impl QuotaRefusal {
    /// The refusal in an error; `None` if the error is about something else.
    pub(in crate::ask) fn from_complaint(complaint: &Complaint, scrub: &Scrub) -> Option<Self> {
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
    let digits: String = behind
        .trim_start()
        .chars()
        .take_while(|c| c.is_ascii_digit() || matches!(c, ',' | '_'))
        .filter(char::is_ascii_digit)
        .collect();
    digits.parse().ok().filter(|limit| *limit > 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_of_waiting_tokens_is_read_from_words() {
        let of = |code: Option<&str>, message: &str| {
            let error = serde_json::json!({"code": code, "message": message});
            QuotaRefusal::from_complaint(&Complaint::from_error(&error), &Scrub::default())
        };
        let words = "Enqueued token limit reached for gpt-4o in organization o. Limit: 90,000 enqueued tokens. Please try again \
                     once some in_progress batches have been completed.";
        assert_eq!(of(None, words).unwrap().limit, Some(90_000));
        let azure = of(Some("token_limit_exceeded"), "The limit was exceeded");
        assert_eq!(azure.unwrap().limit, None);
        assert_eq!(of(None, "Rate limit reached. Limit: 30000"), None);
    }
}
