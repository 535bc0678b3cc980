//! Error of a request or a question without a reply: [`AskError`].
//!
//! Refusal of a batch because of the limit on enqueued tokens: [`QuotaRefusal`].
//!
//! Work of a server that ended without a reply, although it may be charged: [`Unfinished`].

use std::time::Duration;

use super::api_error::ApiError;
use crate::bounded_json::parse;
use crate::costs::Charge;
use crate::requests::AdaptableField;
use crate::secrets::Scrub;
use darkqa_base::types::{Failure, FailureKind, Finish, LostAttempts, Reply, Usage};

/// Requests that a failure affects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// Only this request; another may succeed.
    Trial,
    /// Every request of this size. Before the first reply of the model: every further request to it.
    Alike,
    /// Every further request to this model by the meaning of the status alone (403, 404, 410): the server's words name
    /// no such cause, so that it may be this request. The run stops once several were refused in a row.
    ByStatus,
    /// Every further request to this model: the cause is the key, the credit, the address, the name or the parameters.
    Endpoint,
    /// No other request: the run ended before the reply, and the request may not have been sent.
    Interrupted,
}

/// Whether and when to retry a request without a reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Retry {
    /// Do not retry: the same request would fail again.
    Never,
    /// Retry after a delay; this uses one of `--retries`.
    AfterDelay,
    /// Retry as soon as the endpoint accepts requests again. This does not use a retry; only `--retries patience` ends
    /// it.
    WhenAccepted,
}

/// A refusal that may concern the content of one request alone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// HTTP status; of an error sent with a success status, the status that its words imply.
    pub status: u16,
    /// The server's code or else the beginning of its words, without numbers: equal in refusals for the same cause.
    pub cause: String,
    /// The server's words, without secrets.
    pub words: String,
}

impl Refusal {
    /// Number of words that identify a cause; chosen: ids and sizes follow later.
    const CAUSE_WORDS: usize = 6;

    /// The refusal with this status, code and words.
    pub fn new(status: u16, code: Option<&str>, words: String) -> Self {
        // Some servers repeat the status as the code.
        let code = code.filter(|code| *code != status.to_string());
        let cause = code.map_or_else(
            || {
                words
                    .split_whitespace()
                    .filter(|word| !word.contains(|c: char| c.is_ascii_digit()))
                    .take(Self::CAUSE_WORDS)
                    .collect::<Vec<&str>>()
                    .join(" ")
                    .to_lowercase()
            },
            str::to_owned,
        );
        Self { status, cause, words }
    }

    /// The reply that the model did not give, after this number of requests: without text, ended by a filter, with the
    /// server's words as the refusal. It is scored as the same filter is if the server sends it as a finish reason.
    #[must_use]
    pub fn into_reply(self, attempts: u32, lost: LostAttempts) -> Reply {
        Reply {
            refusal: Some(format!("{}: {}", self.status, self.words)),
            finish: Finish::Filter,
            attempts,
            lost,
            ..Reply::local(String::new())
        }
    }
}

/// Error of a request, or of a question after all its requests.
///
/// The run stores only its [`Failure`]; the other fields decide how the run continues.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", failure.message)]
pub struct AskError {
    /// Failure to store; for a question, the failure of its last request.
    pub failure: Failure,
    /// Number of requests that were sent.
    pub attempts: u32,
    /// Requests that the failure affects.
    pub reach: Reach,
    /// Field that the server refused, if the program can send it in another way.
    pub refused_field: Option<AdaptableField>,
    /// Flags of the settings that the server refused: they may change within the run.
    pub forced: &'static [&'static str],
    /// Attempts that were charged.
    pub lost: Box<LostAttempts>,
    /// Finish reason of the server, if it is the reason for the missing reply.
    pub finish: Option<Box<str>>,
    /// The refusal, if it may concern the content of this request alone.
    pub refusal: Option<Box<Refusal>>,
    pub retry: Retry,
    /// Wait that the server asked for.
    pub wait: Option<Duration>,
    /// True if the request may have had an effect that the server did not report: a charge, a file or a batch.
    pub may_have_effect: bool,
    /// Work that the server may have done, and charged, without a statement of tokens.
    pub unfinished: Unfinished,
    /// Refusal of a batch because too many tokens are enqueued; `None` for other reasons.
    pub quota: Option<Box<QuotaRefusal>>,
}

impl AskError {
    /// Error of one request without an HTTP status, which is not retried and does not affect other requests. It may
    /// have had an effect if it timed out or has a response.
    pub fn new(kind: FailureKind, message: String) -> Self {
        Self {
            may_have_effect: matches!(kind, FailureKind::Timeout | FailureKind::Response),
            failure: Failure { kind, status: None, message },
            attempts: 1,
            reach: Reach::Trial,
            refused_field: None,
            forced: &[],
            lost: Box::default(),
            finish: None,
            refusal: None,
            retry: Retry::Never,
            wait: None,
            unfinished: Unfinished::None,
            quota: None,
        }
    }

    /// Error of a question that was abandoned while its request was in flight. The request may be charged; the same
    /// command asks it again.
    pub fn given_up() -> Self {
        let message = "given up while in flight, because the run was interrupted".to_owned();
        Self { reach: Reach::Interrupted, ..Self::new(FailureKind::Timeout, message) }
    }

    /// Adds a charged attempt with these tokens.
    #[must_use]
    pub fn with_charge(mut self, usage: Option<Usage>) -> Self {
        self.lost.add(usage);
        self
    }

    /// The same failure of a request on which the server may have worked.
    #[must_use]
    pub fn with_unfinished(mut self, unfinished: Unfinished) -> Self {
        if unfinished.is_timeout() {
            self.failure.kind = FailureKind::Timeout;
            self.may_have_effect = true;
        }
        self.unfinished = unfinished;
        self
    }

    /// Charge for the request.
    pub fn charge(&self) -> Charge {
        match *self.lost {
            lost if lost.attempts > 0 => Charge::Stated(lost.usage),
            _ if self.may_have_effect => Charge::Unknown,
            _ => Charge::Nothing,
        }
    }

    /// Turns the error of the last request into the error of the question, with all its attempts and charges.
    #[must_use]
    pub fn with_attempts(self, attempts: u32, lost: LostAttempts) -> Self {
        Self { attempts, lost: Box::new(lost), ..self }
    }

    /// True if a refusal with this status may concern the content of the request alone: moderation rejected it, or
    /// neither the server's words nor the size of the request explain it. The message must still be the remedy alone.
    pub fn may_be_content(&self, status: u16) -> bool {
        let is_unexplained = match self.reach {
            Reach::Trial => self.failure.message.is_empty(),
            Reach::ByStatus => true,
            _ => false,
        };
        let is_refused =
            self.failure.kind == FailureKind::Request && (400..500).contains(&status) && self.refused_field.is_none();
        self.failure.kind == FailureKind::Filtered || (is_refused && is_unexplained)
    }

    /// The reply that a filter withheld, of a refusal that concerns the content of the request.
    ///
    /// # Errors
    /// The error itself, if it is no such refusal.
    pub fn into_filtered(mut self) -> Result<Reply, Self> {
        match self.refusal.take() {
            Some(refusal) => Ok(refusal.into_reply(self.attempts, *self.lost)),
            None => Err(self),
        }
    }

    /// True if the same call of the Files or Batch API would fail again: the key, the address or the request is wrong.
    pub fn is_permanent(&self) -> bool {
        let is_temporary = matches!(self.failure.status, None | Some(408 | 409 | 425 | 429 | 500..));
        !is_temporary && self.quota.is_none()
    }

    /// True if no connection to the server could be made, so that the request was not sent.
    pub fn is_unconnected(&self) -> bool {
        self.failure.kind == FailureKind::Connection && !self.may_have_effect
    }

    /// True if the server does not have the called API.
    pub fn is_unsupported(&self) -> bool {
        matches!(self.failure.status, Some(404 | 405 | 501))
    }
}

/// Refusal of a batch because too many tokens are already enqueued in batches.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct QuotaRefusal {
    /// Maximum number of enqueued tokens; `None` if the server does not report it.
    pub limit: Option<u64>,
    /// The server's message, without secrets.
    pub message: String,
}

impl QuotaRefusal {
    /// Recognizes such a refusal; `None` for other errors.
    pub fn from_api_error(api_error: &ApiError, scrub: &Scrub) -> Option<Self> {
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

/// Minimum time after which a timeout stated by the server means that it worked on the request; chosen: the time limits
/// of gateways are 10 to 100 s, and a server that is down is noticed sooner.
const LONG_TIMEOUT: Duration = Duration::from_secs(10);

/// Minimum time after which a page of a gateway, or a lost connection, means that a time limit was reached; chosen: the
/// limits of gateways that state no timeout are 30 s and more.
pub(crate) const LONG_SILENCE: Duration = Duration::from_secs(25);

/// Phrases for a reached time limit, in lower case.
const TIMEOUT: [&str; 6] = ["timeout", "time-out", "timed out", "timing out", "time out", "deadline exceeded"];

/// Work that a server may have done, and charged, for a request without a reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Unfinished {
    /// None that is known of.
    #[default]
    None,
    /// The reply broke off after its first part.
    BrokeOff,
    /// A gateway answered without a wait that the server behind it is too slow: the server may also be down for a
    /// moment.
    QuickTimeout,
    /// The same for the second time, while the server answered other requests: this request takes too long.
    RepeatedTimeout,
    /// A gateway waited, and gave up. The server behind it may go on.
    GatewayTimeout,
}

impl Unfinished {
    /// The work on a request that was refused with this status and body after this time.
    pub fn of_refusal(status: u16, took: Duration, api_error: &ApiError, body: &[u8]) -> Self {
        let is_failure = status >= 499 || status == 408;
        let states_timeout =
            matches!(status, 408 | 504 | 524 | 598 | 599) || (is_failure && api_error.mentions_any(&TIMEOUT));
        let is_page = || std::str::from_utf8(body).map_or(true, |body| parse(body).is_err());
        match status {
            // Cloudflare sends it only after its time limit.
            524 => Self::GatewayTimeout,
            _ if states_timeout && took >= LONG_TIMEOUT => Self::GatewayTimeout,
            _ if is_failure && took >= LONG_SILENCE && is_page() => Self::GatewayTimeout,
            504 => Self::QuickTimeout,
            _ => Self::None,
        }
    }

    /// True if the request takes longer than a gateway waits.
    pub fn is_timeout(self) -> bool {
        matches!(self, Self::RepeatedTimeout | Self::GatewayTimeout)
    }

    /// True if the server has probably charged the request.
    pub fn is_probably_charged(self) -> bool {
        self == Self::BrokeOff || self.is_timeout()
    }
}

#[cfg(test)]
mod tests {
    use super::Unfinished::{GatewayTimeout, QuickTimeout};
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

    fn refused(status: u16, seconds: u64, body: &str) -> Unfinished {
        let took = Duration::from_secs(seconds);
        Unfinished::of_refusal(status, took, &ApiError::from_body(body), body.as_bytes())
    }

    #[test]
    fn gateways_that_gave_up_are_recognized() {
        let page = "<html><title>Application error</title>";
        for (status, seconds, body) in [
            (524, 0, page),
            (504, 60, page),
            (504, 29, r#"{"message":"Endpoint request timed out"}"#),
            (408, 30, r#"{"error":{"message":"litellm.Timeout"}}"#),
            (502, 55, page),
            (500, 60, ""),
            (503, 30, page),
            (500, 15, r#"{"error":{"message":"upstream request timeout"}}"#),
            (599, 100, ""),
        ] {
            assert_eq!(refused(status, seconds, body), GatewayTimeout, "{status} {body}");
        }
    }

    #[test]
    fn other_failures_are_not_gateway_timeouts() {
        let page = "<html><title>502 Bad Gateway</title>";
        assert_eq!(refused(504, 1, page), QuickTimeout);
        for (status, seconds, body) in [
            (502, 1, page),
            (500, 60, r#"{"error":{"message":"CUDA error"}}"#),
            (503, 0, r#"{"error":{"message":"Loading model"}}"#),
            (408, 1, ""),
            (429, 60, page),
            (400, 60, r#"{"error":{"message":"timeout must be a number"}}"#),
            (522, 3, page),
        ] {
            assert_eq!(refused(status, seconds, body), Unfinished::None, "{status} {body}");
        }
    }
}
