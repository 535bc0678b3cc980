//! Refusal of a batch because of the limit on enqueued tokens: [`QuotaRefusal`].

use super::api_error::ApiError;
use crate::ask::secrets::Scrub;

/// Refusal of a batch because too many tokens are already enqueued in batches.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct QuotaRefusal {
    /// Maximum number of enqueued tokens; `None` if the server does not report it.
    pub limit: Option<u64>,
    /// The server's message, without secrets.
    pub message: String,
}

impl QuotaRefusal {
    /// Recognizes such a refusal; `None` for other errors.
    pub(crate) fn from_api_error(api_error: &ApiError, scrub: &Scrub) -> Option<Self> {
        let is_quota = api_error.has_code(&["token_limit_exceeded"]) || api_error.mentions_any(&["enqueued token"]);
        is_quota.then(|| Self { limit: stated_limit(&api_error.message), message: scrub.line(&api_error.message) })
    }
}

/// Parses the number after "Limit:", with or without thousands separators.
fn stated_limit(message: &str) -> Option<u64> {
    let lower = message.to_lowercase();
    let (_, after) = lower.split_once("limit:")?;
    let digits: String = after
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

    fn parse(code: Option<&str>, message: &str) -> Option<QuotaRefusal> {
        let error = serde_json::json!({"code": code, "message": message});
        QuotaRefusal::from_api_error(&ApiError::from_error(&error), &Scrub::default())
    }

    #[test]
    fn the_limit_is_parsed_from_the_message() {
        let message = "Enqueued token limit reached for gpt-4o in organization o. Limit: 90,000 enqueued tokens. Please try again \
                     once some in_progress batches have been completed.";
        assert_eq!(parse(None, message).unwrap().limit, Some(90_000));
        let azure = parse(Some("token_limit_exceeded"), "The limit was exceeded");
        assert_eq!(azure.unwrap().limit, None);
        assert_eq!(parse(None, "Rate limit reached. Limit: 30000"), None);
    }
}
