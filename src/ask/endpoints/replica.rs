//! One address of an endpoint: [`Replica`].
//!
//! The model that served a reply, from the headers of gateways: [`served_model`].

use std::time::SystemTime;

use reqwest::header::{CONTENT_TYPE, HeaderMap, LOCATION};
use tokio::time::Instant;
use tracing::debug;

use super::access::Access;
use super::connection::{Connection, Deadline, HttpResponse};
use super::load_balancer::Sending;
use super::url::BaseUrl;
use crate::failures::{
    ApiError, AskError, Reach, Refusal, ReplyError, Retry, Unfinished, Unreadable, implied_status, is_out_of_tokens,
};
use crate::pace::{Gate, RateLimits, Window, retry_after};
use crate::requests::Request;
use crate::secrets::without_secrets;
use crate::vendors::Vendor;
use crate::wire::{body_usage, cost_in_headers, with_cost};
use crate::wire_kind::Wire;
use darkqa_base::error::Result;
use darkqa_base::types::{FailureKind, Reply};

/// One address of an endpoint, with its key, pooled connections, rate limiter and concurrency window.
#[derive(Debug)]
pub(super) struct Replica {
    access: Access,
    pub(super) connection: Connection,
    sending: Sending,
    pub(super) gate: Gate,
    window: Window,
}

impl Replica {
    /// Prepares a replica for requests; nothing is sent yet.
    ///
    /// # Errors
    /// If a key would be sent unencrypted to another machine, or if two keys are set.
    pub(super) fn open(access: Access, sending: Sending) -> Result<Self> {
        let scrub = access.scrub();
        access.check(&scrub)?;
        Ok(Self {
            connection: Connection::new(&access, scrub, sending.timeout)?,
            access,
            sending,
            gate: Gate::new(sending.quota),
            window: Window::new(sending.concurrency),
        })
    }

    /// Maximum number of requests in flight at the moment, within [`Sending::concurrency`].
    pub(super) fn width(&self) -> usize {
        self.window.width()
    }

    /// The base URL; its `Display` form has no user name, password and query string.
    pub(super) fn base(&self) -> &BaseUrl {
        &self.access.base
    }

    /// Vendor of the host; `None` if no table lists it.
    pub(super) fn vendor(&self) -> Option<&'static Vendor> {
        self.access.vendor
    }

    pub(super) fn has_key(&self) -> bool {
        self.access.key.is_some() || self.base().has_credentials()
    }

    /// Headers of every request through this API.
    pub(super) fn headers(&self, wire: Wire) -> Result<HeaderMap> {
        self.access.headers(wire)
    }

    /// Sends the request once; `sent` is the time at which it passed the gate.
    pub(super) async fn send(
        &self,
        request: &Request<'_>,
        headers: &HeaderMap,
        sent: Instant,
    ) -> Result<Reply, AskError> {
        let wire = request.wire;
        let timeout = self.sending.timeout;
        let deadline = match wire {
            Wire::ChatStream => Deadline::stream(timeout),
            Wire::Chat | Wire::Responses => Deadline::total(timeout),
        };
        let response =
            self.connection.post(wire.path(), headers, &request.body, deadline).await.inspect_err(|error| {
                if error.failure.kind == FailureKind::Timeout {
                    self.window.record_overload(sent);
                }
                // This process cannot open more files: use fewer connections.
                if error.retry == Retry::WhenAccepted {
                    self.window.record_overload(sent);
                    self.gate.pause(self.sending.first_delay);
                }
            })?;
        let status = response.status.as_u16();
        let (request_id, took) = (self.request_id(&response), response.duration);
        debug!(endpoint = %self.base(), status, ?took, request_id, "answered");
        if !response.status.is_success() {
            if asks_for_pause(status) {
                self.window.record_overload(sent);
            }
            let mut api_error = wire.parse_error(&response.body);
            if response.status.is_redirection() {
                api_error.message = format!("moved to {}", response.header(LOCATION.as_str()));
            }
            return self.reply_or_refusal(status, &api_error, &response, request, sent);
        }
        let reply_error = match wire.reply(&response.body, response.header(CONTENT_TYPE.as_str())) {
            Ok(reply) => return Ok(self.finish_reply(reply, &response, request, sent)),
            Err(error) => error,
        };
        let cost = cost_in_headers(&response.headers);
        let mut failed = match reply_error {
            ReplyError::Api(api_error) => {
                let implied = implied_status(&api_error);
                let refused = self.reply_or_refusal(implied, &api_error, &response, request, sent);
                match refused {
                    Ok(reply) => return Ok(reply),
                    Err(failed) => failed,
                }
            }
            ReplyError::Unreadable(unreadable) => {
                let limit = request.sent.parameters.limit();
                if let Some(reply) = truncated_reply(&unreadable, limit) {
                    return Ok(self.finish_reply(reply, &response, request, sent));
                }
                let Unreadable { description, usage, finish, broke_off } = *unreadable;
                let scrub = self.connection.scrub();
                let message = format!("{} answered with {}", self.base(), scrub.line(&description));
                AskError {
                    retry: Retry::AfterDelay,
                    finish: finish.map(|word| scrub.line(&word).into_boxed_str()),
                    unfinished: if broke_off { Unfinished::BrokeOff } else { Unfinished::None },
                    ..AskError::new(FailureKind::Response, message).with_charge(with_cost(usage, cost))
                }
            }
        };
        failed.failure.status = Some(status);
        Err(failed)
    }

    /// Records the success in the window and the gate, and returns the reply without keys and with its latency.
    fn finish_reply(&self, reply: Reply, response: &HttpResponse, request: &Request<'_>, sent: Instant) -> Reply {
        self.window.record_success(response.duration);
        let limits = RateLimits::read(&response.headers, SystemTime::now());
        let tokens = reply.usage.and_then(|usage| usage.total());
        self.gate.record_success(sent, tokens, limits, self.sending.max_wait);
        let asked = &request.sent.parameters.model;
        let reply = Reply {
            latency_ms: response.duration.as_millis() as u64,
            usage: with_cost(reply.usage, cost_in_headers(&response.headers)),
            served_model: served_model(&response.headers, asked, reply.served_model),
            ..reply
        };
        without_secrets(reply, &self.connection.scrub())
    }

    /// Error of a request that the server refused with this status; or an empty truncated reply, if the server says
    /// that it generated up to the token limit.
    fn reply_or_refusal(
        &self,
        status: u16,
        api_error: &ApiError,
        response: &HttpResponse,
        request: &Request<'_>,
        sent: Instant,
    ) -> Result<Reply, AskError> {
        if is_out_of_tokens(status, api_error) {
            let usage = body_usage(&String::from_utf8_lossy(&response.body));
            return Ok(self.finish_reply(Reply::empty_truncated(usage), response, request, sent));
        }
        Err(self.refusal(status, api_error, response, request, sent))
    }

    /// Error of a request that the server refused with this status; pauses the gate if the server asks for it.
    fn refusal(
        &self,
        status: u16,
        api_error: &ApiError,
        response: &HttpResponse,
        request: &Request<'_>,
        sent: Instant,
    ) -> AskError {
        let now = SystemTime::now();
        let mut api_error = api_error.clone();
        api_error.wait = retry_after(&response.headers, now).max(api_error.wait);
        let api_error = &api_error;
        let mut failed = AskError::refused(status, api_error, request.wire, request.sent);
        // A limit of requests is one, whatever the status.
        let pace_status = match failed.failure.kind {
            FailureKind::RateLimit => 429,
            _ => status,
        };
        let may_be_content = failed.may_be_content(status);
        let is_retryable = match response.header("x-should-retry") {
            "true" => true,
            "false" => false,
            _ => failed.retry != Retry::Never,
        };
        failed.failure.message = self.refusal_message(response, api_error, &failed.failure.message);
        failed.failure.status = Some(status);
        if may_be_content {
            let scrub = self.connection.scrub();
            let code = api_error.code.as_deref().map(|code| scrub.line(code));
            let words = scrub.line(&api_error.message);
            failed.refusal = Some(Box::new(Refusal::new(status, code.as_deref(), words)));
        }
        let mut wait = api_error.wait;
        if wait.is_none() && pace_status == 429 {
            wait = RateLimits::read(&response.headers, now).pause();
        }
        failed.wait = wait.filter(|_| is_retryable);
        let is_full = pace_status == 429 || (asks_for_pause(pace_status) && failed.wait.is_some());
        failed.retry = if !is_retryable {
            Retry::Never
        } else if is_full {
            Retry::WhenAccepted
        } else {
            Retry::AfterDelay
        };
        failed
            .lost
            .add(with_cost(body_usage(&String::from_utf8_lossy(&response.body)), cost_in_headers(&response.headers)));
        failed.may_have_effect = status >= 500 && !is_rejected_unprocessed(status);
        self.pause(pace_status, sent, &mut failed);
        if failed.retry != Retry::AfterDelay {
            return failed;
        }
        let took = response.duration;
        failed.with_unfinished(Unfinished::of_refusal(status, took, api_error, &response.body))
    }

    /// Error message for a refused request.
    fn refusal_message(&self, response: &HttpResponse, api_error: &ApiError, remedy: &str) -> String {
        let status = response.status.as_u16();
        // Gateways send errors with a success status.
        let error = match api_error.status() {
            Some(code) if response.status.is_success() => format!(" with the error {code}"),
            None if response.status.is_success() => " with an error".to_owned(),
            _ => String::new(),
        };
        let mut message = format!("{} answered {status}{error}", self.base());
        let text = self.connection.scrub().line(&api_error.message);
        if !text.is_empty() {
            message = format!("{message}: {text}");
        }
        let remedy = self.connection.scrub().line(remedy);
        if !remedy.is_empty() {
            message = format!("{message} ({remedy})");
        }
        let request_id = self.request_id(response);
        if !request_id.is_empty() {
            message = format!("{message} [request {request_id}]");
        }
        message
    }

    /// Pauses all requests as long as the server asks. A request that would wait longer than `--retries max-wait` is
    /// given up; its message then includes the wait.
    fn pause(&self, status: u16, sent: Instant, failed: &mut AskError) {
        let max_wait = self.sending.max_wait;
        match failed.wait {
            Some(wait) if wait > max_wait => {
                failed.retry = Retry::Never;
                if asks_for_pause(status) {
                    failed.reach = Reach::Endpoint;
                }
                failed.failure.message = format!(
                    "{} (it asks to wait {:.0} s, beyond --retries max-wait of {:.0} s)",
                    failed.failure.message,
                    wait.as_secs_f64(),
                    max_wait.as_secs_f64()
                );
            }
            wait if status == 429 && failed.retry != Retry::Never => {
                self.gate.record_rate_limited(sent, wait);
            }
            Some(wait) if asks_for_pause(status) => self.gate.pause(wait),
            // The server states no wait: all requests wait as long as the refused one does before its first retry.
            None if asks_for_pause(status) && failed.retry != Retry::Never => {
                self.gate.pause(self.sending.first_delay);
            }
            _ => {}
        }
    }

    /// The server's id of the request, without secrets; empty if the response has none.
    fn request_id(&self, response: &HttpResponse) -> String {
        self.connection.scrub().line(response.header("x-request-id"))
    }
}

/// An empty truncated reply, if a body without a reply was charged at least the token limit: a retry would be truncated
/// too.
fn truncated_reply(unreadable: &Unreadable, limit: Option<u32>) -> Option<Reply> {
    let tokens = unreadable.usage?.completion_tokens?;
    let is_truncated = unreadable.finish.is_none() && tokens >= u64::from(limit?);
    is_truncated.then(|| Reply::empty_truncated(unreadable.usage))
}

/// True for a server error by which the request was rejected before any work on it.
fn is_rejected_unprocessed(status: u16) -> bool {
    asks_for_pause(status) || matches!(status, 501 | 505)
}

/// True if the status means that the server accepts no requests at the moment.
fn asks_for_pause(status: u16) -> bool {
    matches!(status, 429 | 503 | 529)
}

/// Headers of gateways with the number of fallbacks, or the index of the route taken; 0 is the first choice.
///
/// Sources: LiteLLM's and Cloudflare AI Gateway's documentation of response headers.
const STEP_HEADERS: [&str; 1] = ["cf-aig-step"];

/// Headers with the name of the model that a gateway fell back to, then those with the id of its deployment.
const NAME_HEADERS: [&str; 2] = ["x-litellm-model-group", "x-litellm-model-name"];
const ID_HEADERS: [&str; 1] = ["x-litellm-model-id"];

/// Name of the model that served a reply: `named`, the one in the body, unless the headers state that a gateway fell
/// back to another model and the body repeats the name `asked`.
pub(super) fn served_model(headers: &HeaderMap, asked: &str, named: Option<String>) -> Option<String> {
    let repeats_name = named.as_deref().is_none_or(|named| named == asked);
    if !repeats_name || !is_fallback(headers) {
        return named;
    }
    let first = |names: &[&str]| {
        names
            .iter()
            .filter_map(|name| headers.get(*name)?.to_str().ok())
            .map(str::trim)
            .find(|text| !text.is_empty() && *text != asked)
            .map(str::to_owned)
    };
    first(&NAME_HEADERS)
        .or_else(|| Some(format!("{asked} (fallback, deployment {})", first(&ID_HEADERS)?)))
        .or_else(|| Some(format!("{asked} (fallback)")))
}

/// True if a header states a fallback: its name contains the word, or it is in [`STEP_HEADERS`], and its value is a
/// number above 0 or `true`.
fn is_fallback(headers: &HeaderMap) -> bool {
    headers.iter().any(|(name, value)| {
        let name = name.as_str();
        let is_count = name.contains("fallback") || STEP_HEADERS.contains(&name);
        let value = value.to_str().unwrap_or_default().trim();
        let is_positive = value.parse::<u32>().is_ok_and(|count| count > 0);
        is_count && (is_positive || value.eq_ignore_ascii_case("true"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn served(pairs: &[(&'static str, &str)], named: &str) -> Option<String> {
        let headers = pairs.iter().map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap())).collect();
        served_model(&headers, "gpt-4o", Some(named.to_owned()))
    }

    #[test]
    fn fallbacks_of_gateways_are_named() {
        let attempted = ("x-litellm-attempted-fallbacks", "1");
        for (pairs, expected) in [
            (vec![attempted, ("x-litellm-model-group", "gpt-4o-mini")], "gpt-4o-mini"),
            (
                vec![attempted, ("x-litellm-model-group", "gpt-4o"), ("x-litellm-model-id", "3f2a")],
                "gpt-4o (fallback, deployment 3f2a)",
            ),
            (vec![("helicone-fallback-index", "2")], "gpt-4o (fallback)"),
            (vec![("cf-aig-step", "1")], "gpt-4o (fallback)"),
        ] {
            assert_eq!(served(&pairs, "gpt-4o").as_deref(), Some(expected));
        }
        let named = served(&[attempted], "gpt-4o-mini");
        assert_eq!(named.as_deref(), Some("gpt-4o-mini"), "the body names it");
    }

    #[test]
    fn first_choices_keep_their_name() {
        for pairs in [
            vec![
                ("x-litellm-attempted-fallbacks", "0"),
                ("x-litellm-attempted-retries", "2"),
                ("x-litellm-model-group", "gpt-4o"),
                ("x-litellm-model-id", "3f2a"),
            ],
            vec![("cf-aig-step", "0")],
            vec![("x-fallbacks", "none")],
            vec![],
        ] {
            assert_eq!(served(&pairs, "gpt-4o").as_deref(), Some("gpt-4o"));
        }
    }
}
