//! One address of an endpoint, and the way one request is sent to it: [`Replica`].

use std::time::SystemTime;

use reqwest::header::{CONTENT_TYPE, HeaderMap, LOCATION};
use tokio::time::Instant;
use tracing::debug;

use super::access::Access;
use super::connection::{Connection, Deadline, HttpReply};
use super::sending::Sending;
use super::url::BaseUrl;
use crate::ask::failures::{Again, AskError, Complaint, Reach, Unreadable, UnreadableReply};
use crate::ask::pace::{Gate, RateLimits, Window, asked_wait};
use crate::ask::requests::Request;
use crate::ask::secrets::without_secrets;
use crate::ask::vendors::Vendor;
use crate::ask::wire::body_usage;
use crate::ask::wire_kind::Wire;
use crate::error::Result;
use crate::types::{FailureKind, Finish, Reply};

/// One address of an endpoint: its key, pooled connections, and the pauses that it asked for.
#[derive(Debug)]
pub(super) struct Replica {
    access: Access,
    pub(super) connection: Connection,
    sending: Sending,
    pub(super) gate: Gate,
    window: Window,
}

impl Replica {
    /// A replica that is ready for requests; nothing is sent yet.
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

    /// The number of requests that may be in flight now, within [`Sending::concurrency`].
    pub(super) fn width(&self) -> usize {
        self.window.width()
    }

    /// The base URL; its text has no user, password and query string.
    pub(super) fn base(&self) -> &BaseUrl {
        &self.access.base
    }

    /// Facts about the vendor.
    pub(super) fn vendor(&self) -> Option<&'static Vendor> {
        self.access.vendor
    }

    pub(super) fn has_key(&self) -> bool {
        self.access.key.is_some() || self.base().has_credentials()
    }

    /// The headers of every request to an API.
    pub(super) fn headers(&self, wire: Wire) -> Result<HeaderMap> {
        self.access.headers(wire)
    }

    /// Sends the request once; `sent` is the time of its turn.
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
            Wire::Chat | Wire::Responses => Deadline::whole(timeout),
        };
        let posted = self
            .connection
            .post(wire.path(), headers, &request.body, deadline);
        let posted = posted.await;
        let answer = posted.inspect_err(|failed| {
            if failed.failure.kind == FailureKind::Timeout {
                self.window.overloaded(sent);
            }
            // This process may open no more files: fewer connections need fewer.
            if failed.again == Again::WhenTaken {
                self.window.overloaded(sent);
                self.gate.pause(self.sending.first_delay);
            }
        })?;
        let status = answer.status.as_u16();
        let (request_id, took) = (self.request_id(&answer), answer.took);
        debug!(endpoint = %self.base(), status, ?took, request_id, "answered");
        if !answer.status.is_success() {
            if asks_for_pause(status) {
                self.window.overloaded(sent);
            }
            let mut complaint = wire.complaint(&answer.body);
            if answer.status.is_redirection() {
                complaint.message = format!("moved to {}", answer.header(LOCATION.as_str()));
            }
            return Err(self.refused_try(status, &complaint, &answer, request, sent));
        }
        let unreadable = match wire.reply(&answer.body, answer.header(CONTENT_TYPE.as_str())) {
            Ok(reply) => return Ok(self.succeeded(reply, &answer, sent)),
            Err(unreadable) => unreadable,
        };
        let mut failed = match unreadable {
            // An error without a code is a failure of the server, which may pass.
            UnreadableReply::Complaint(complaint) => {
                let code = complaint.status().unwrap_or(500);
                self.refused_try(code, &complaint, &answer, request, sent)
            }
            UnreadableReply::Other(unreadable) => {
                let limit = request.sent.parameters.limit();
                if let Some(reply) = cut_reply(&unreadable, limit) {
                    return Ok(self.succeeded(reply, &answer, sent));
                }
                let Unreadable {
                    what,
                    usage,
                    finish,
                    is_final,
                } = *unreadable;
                let scrub = &self.connection.scrub;
                let message = format!("{} answered with {}", self.base(), scrub.line(&what));
                AskError {
                    again: if is_final { Again::Never } else { Again::Later },
                    finish: finish.map(|word| scrub.line(&word)),
                    ..AskError::new(FailureKind::Response, message).charged(usage)
                }
            }
        };
        failed.failure.status = Some(status);
        Err(failed)
    }

    /// The reply without keys; its tokens and the remaining limits are noted in the gate.
    fn succeeded(&self, reply: Reply, answer: &HttpReply, sent: Instant) -> Reply {
        self.window.succeeded(answer.took);
        let allowance = RateLimits::read(&answer.headers, SystemTime::now());
        let tokens = reply.usage.and_then(|usage| usage.total());
        self.gate
            .succeeded(sent, tokens, allowance, self.sending.max_wait);
        Reply {
            latency_ms: answer.took.as_millis() as u64,
            ..without_secrets(reply, &self.connection.scrub)
        }
    }

    /// The failure of a request that the server refused with this status.
    fn refused_try(
        &self,
        status: u16,
        complaint: &Complaint,
        answer: &HttpReply,
        request: &Request<'_>,
        sent: Instant,
    ) -> AskError {
        let mut failed = AskError::refused(status, complaint, request.wire, request.sent);
        let is_retryable = match answer.header("x-should-retry") {
            "true" => true,
            "false" => false,
            _ => failed.again != Again::Never,
        };
        let remedy = &failed.failure.message;
        let message = self.message(answer, complaint, remedy);
        failed.failure.message = message;
        failed.failure.status = Some(status);
        let now = SystemTime::now();
        let stated = asked_wait(&answer.headers, now).max(complaint.wait);
        let reset = || RateLimits::read(&answer.headers, now).pause();
        failed.wait = stated
            .or_else(|| reset().filter(|_| status == 429))
            .filter(|_| is_retryable);
        let is_full = status == 429 || (asks_for_pause(status) && failed.wait.is_some());
        failed.again = match is_retryable {
            false => Again::Never,
            true if is_full => Again::WhenTaken,
            true => Again::Later,
        };
        failed
            .lost
            .add(body_usage(&String::from_utf8_lossy(&answer.body)));
        failed.may_have_effect = status >= 500 && !refuses_work(status);
        self.pause(status, sent, &mut failed);
        failed
    }

    /// The error text for a refused request.
    fn message(&self, answer: &HttpReply, complaint: &Complaint, remedy: &str) -> String {
        let status = answer.status.as_u16();
        // Gateways send errors with the status of success.
        let error = match complaint.status().filter(|_| answer.status.is_success()) {
            Some(code) => format!(" with the error {code}"),
            None if answer.status.is_success() => " with an error".to_owned(),
            None => String::new(),
        };
        let mut message = format!("{} answered {status}{error}", self.base());
        let text = self.connection.scrub.line(&complaint.message);
        if !text.is_empty() {
            message = format!("{message}: {text}");
        }
        if !remedy.is_empty() {
            message = format!("{message} ({remedy})");
        }
        let request_id = self.request_id(answer);
        if !request_id.is_empty() {
            message = format!("{message} [request {request_id}]");
        }
        message
    }

    /// Makes all requests wait as long as the server asked; a request that would wait more than `--retries max-wait` is given up, and
    /// the time at which it could go on is said.
    fn pause(&self, status: u16, sent: Instant, failed: &mut AskError) {
        let max_wait = self.sending.max_wait;
        match failed.wait {
            Some(wait) if wait > max_wait => {
                failed.again = Again::Never;
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
            wait if status == 429 && failed.again != Again::Never => {
                self.gate.rate_limited(sent, wait);
            }
            Some(wait) if asks_for_pause(status) => self.gate.pause(wait),
            // The server states no time: all wait as long as the refused request does before its first retry.
            None if asks_for_pause(status) && failed.again != Again::Never => {
                self.gate.pause(self.sending.first_delay);
            }
            _ => {}
        }
    }

    /// The server's id of a request, without secrets; empty if it sent none.
    fn request_id(&self, answer: &HttpReply) -> String {
        self.connection.scrub.line(answer.header("x-request-id"))
    }
}

/// The reply that the token limit cut, if a body without a reply was charged as many tokens as that: another attempt would be cut,
/// too.
fn cut_reply(unreadable: &Unreadable, limit: Option<u32>) -> Option<Reply> {
    let tokens = unreadable.usage?.completion_tokens?;
    let is_cut = unreadable.finish.is_none() && tokens >= u64::from(limit?);
    is_cut.then(|| Reply {
        finish: Finish::Length,
        usage: unreadable.usage,
        ..Reply::local(String::new())
    })
}

/// Whether a server error means that the request was not worked on.
fn refuses_work(status: u16) -> bool {
    asks_for_pause(status) || matches!(status, 501 | 505)
}

/// Whether a status means that the server accepts no request at the moment.
fn asks_for_pause(status: u16) -> bool {
    matches!(status, 429 | 503 | 529)
}
