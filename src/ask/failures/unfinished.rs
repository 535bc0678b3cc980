//! Work of a server that ended without a reply, although it may be charged: [`Unfinished`].

use std::time::Duration;

use super::api_error::ApiError;
use crate::ask::replies::bounded_json::parse;

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
pub(crate) enum Unfinished {
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
    pub(crate) fn of_refusal(status: u16, took: Duration, api_error: &ApiError, body: &[u8]) -> Self {
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
    pub(crate) fn is_timeout(self) -> bool {
        matches!(self, Self::RepeatedTimeout | Self::GatewayTimeout)
    }

    /// True if the server has probably charged the request.
    pub(crate) fn is_probably_charged(self) -> bool {
        self == Self::BrokeOff || self.is_timeout()
    }
}

#[cfg(test)]
mod tests {
    use super::Unfinished::{GatewayTimeout, None, QuickTimeout};
    use super::*;

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
            assert_eq!(refused(status, seconds, body), None, "{status} {body}");
        }
    }
}
