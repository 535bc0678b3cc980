//! One server and how it is talked to: [`Endpoint`].

use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, SystemTime};

use backon::{ExponentialBuilder, Retryable as _};
use reqwest::header::{CONTENT_TYPE, HeaderMap, LOCATION};
use tokio::sync::watch;
use tokio::time::{Instant, sleep};
use tracing::debug;

use super::access::Access;
use super::body::Parts;
use super::complaint::{Complaint, UnreadableReply};
use super::connection::{Connection, HttpReply};
use super::failure::{AskError, FailedTry, Reach};
use super::failure_class::FailureClass;
use super::field::SentFields;
use super::pace::{Allowance, Gate, Window, asked_wait};
use super::sending::Sending;
use super::url::BaseUrl;
use super::wire::Wire;
use crate::error::Result;
use crate::types::{Failure, FailureKind, Reply};

/// The longest wait of our own making; a server may ask for longer ones.
const LONGEST_DELAY: Duration = Duration::from_secs(30);

/// One server: its address, key, pooled connections, and the pauses it asked for.
#[derive(Debug)]
pub struct Endpoint {
    access: Access,
    connection: Connection,
    sending: Sending,
    gate: Gate,
    window: Window,
    closing: watch::Sender<bool>,
}

/// One request, as often as it is sent.
pub(super) struct Request<'a> {
    pub(super) wire: Wire,
    pub(super) headers: &'a HeaderMap,
    pub(super) body: Parts,
    pub(super) sent: SentFields<'a>,
}

impl Endpoint {
    /// Makes ready to talk to an endpoint; nothing is sent yet.
    ///
    /// # Errors
    /// Where a key would be sent unencrypted to another machine, or is given twice.
    pub fn open(access: Access, sending: Sending) -> Result<Self> {
        let scrub = access.scrub();
        access.check(&scrub)?;
        Ok(Self {
            connection: Connection::new(&access, scrub, sending.timeout)?,
            access,
            sending,
            gate: Gate::new(sending.quota),
            window: Window::new(sending.concurrency),
            closing: watch::Sender::new(false),
        })
    }

    /// How many requests may be on the wire now, within [`Sending::concurrency`].
    #[must_use]
    pub fn width(&self) -> usize {
        self.window.width()
    }

    /// The base URL; shown without user, password and query string.
    #[must_use]
    pub fn base(&self) -> &BaseUrl {
        &self.access.base
    }

    pub(super) fn host(&self) -> &str {
        self.base().host()
    }

    pub(super) fn has_key(&self) -> bool {
        self.access.key.is_some() || self.base().has_credentials()
    }

    /// The headers of every request on a wire.
    pub(super) fn headers(&self, wire: Wire) -> Result<HeaderMap> {
        self.access.headers(wire)
    }

    /// Lets no further request go out: those on the wire are finished, those that wait give up at once.
    pub fn close(&self) {
        self.closing.send_replace(true);
    }

    /// Ends once the endpoint is closed.
    async fn closed(&self) {
        // The sender lives as long as the endpoint, so this only ends by a change.
        let _ = self.closing.subscribe().wait_for(|closing| *closing).await;
    }

    /// Waits for one's turn; an error where the endpoint is closed first.
    async fn turn(&self) -> Result<(), FailedTry> {
        let ended = "the run ended before it was asked";
        tokio::select! {
            biased;
            () = self.closed() => Err(FailedTry {
                reach: Reach::Interrupted,
                ..FailedTry::new(FailureKind::Connection, ended.to_owned())
            }),
            () = self.gate.pass() => Ok(()),
        }
    }

    /// Sends a request, again where that may help. Nothing is left behind where the future is dropped.
    pub(super) async fn ask(&self, request: &Request<'_>) -> Result<Reply, AskError> {
        let attempts = AtomicU32::new(0);
        let backoff = ExponentialBuilder::new()
            .with_jitter()
            .with_min_delay(self.sending.first_delay)
            .with_max_delay(LONGEST_DELAY)
            .with_max_times(self.sending.retries as usize);
        let closing = self.closing.subscribe();
        let outcome = (|| async {
            self.turn().await?;
            attempts.fetch_add(1, Ordering::Relaxed);
            self.send(request).await
        })
        .retry(backoff)
        .sleep(move |wait| {
            let mut closing = closing.clone();
            async move {
                tokio::select! {
                    _ = closing.wait_for(|closing| *closing) => (),
                    () = sleep(wait) => (),
                }
            }
        })
        .when(|tried: &FailedTry| tried.again)
        // `None` where the retries are used up.
        .adjust(|tried, own| own.map(|own| tried.wait.unwrap_or(own)))
        .notify(|tried, wait| {
            debug!(endpoint = %self.base(), ?wait, problem = tried.failure.message, "trying again");
        })
        .await;
        let attempts = attempts.into_inner();
        match outcome {
            Ok(reply) => Ok(Reply { attempts, ..reply }),
            Err(tried) => Err(tried.after(attempts)),
        }
    }

    /// One try.
    async fn send(&self, request: &Request<'_>) -> Result<Reply, FailedTry> {
        let Request { wire, headers, .. } = *request;
        let started = Instant::now();
        let body = request.body.clone();
        let posted = self.connection.post(wire.path(), headers, body).await;
        let answer = posted.inspect_err(|tried| {
            if tried.failure.kind == FailureKind::Timeout {
                self.window.overloaded(started);
            }
        })?;
        let status = answer.status.as_u16();
        let (request_id, took) = (self.request_id(&answer), answer.took);
        debug!(endpoint = %self.base(), status, ?took, request_id, "answered");
        if !answer.status.is_success() {
            if asks_for_pause(status) {
                self.window.overloaded(started);
            }
            let mut complaint = wire.complaint(&answer.body);
            if answer.status.is_redirection() {
                complaint.message = format!("moved to {}", answer.header(LOCATION.as_str()));
            }
            return Err(self.refused(status, &complaint, &answer, request));
        }
        let unreadable = match wire.reply(&answer.body, answer.header(CONTENT_TYPE.as_str())) {
            Ok(reply) => return Ok(self.succeeded(reply, &answer)),
            Err(unreadable) => unreadable,
        };
        let mut tried = match unreadable {
            // Without a code of its own it is the server's failure, and may pass.
            UnreadableReply::Complaint(complaint) => {
                let code = complaint.status().unwrap_or(500);
                self.refused(code, &complaint, &answer, request)
            }
            UnreadableReply::Other(what) => {
                let what = self.connection.scrub.line(&what);
                let message = format!("{} answered with {what}", self.base());
                FailedTry {
                    again: true,
                    ..FailedTry::new(FailureKind::Response, message)
                }
            }
        };
        tried.failure.status = Some(status);
        Err(tried)
    }

    /// The reply without keys, once its cost and what the server says is left are noted.
    fn succeeded(&self, reply: Reply, answer: &HttpReply) -> Reply {
        self.window.succeeded(answer.took);
        let left = Allowance::read(&answer.headers, SystemTime::now());
        let tokens = reply.usage.and_then(|usage| usage.total());
        self.gate.ease(tokens, left, self.sending.max_wait);
        let clean = |text: String| self.connection.scrub.reply(text);
        Reply {
            text: clean(reply.text),
            refusal: reply.refusal.map(clean),
            served_model: reply.served_model.map(clean),
            latency_ms: answer.took.as_millis() as u64,
            ..reply
        }
    }

    /// A try that the server says failed, with this status.
    fn refused(
        &self,
        status: u16,
        complaint: &Complaint,
        answer: &HttpReply,
        request: &Request<'_>,
    ) -> FailedTry {
        let mut class = FailureClass::of(status, complaint, request.wire, request.sent);
        match answer.header("x-should-retry") {
            "true" => class.again = true,
            "false" => class.again = false,
            _ => {}
        }
        let hint = class.hint.as_deref();
        let message = self.message(status, complaint, hint, &self.request_id(answer));
        let wait = asked_wait(&answer.headers, SystemTime::now()).filter(|_| class.again);
        let mut tried = FailedTry {
            failure: Failure {
                kind: class.kind,
                status: Some(status),
                message,
            },
            reach: class.reach,
            again: class.again,
            wait,
            refused: class.refused,
        };
        self.pause(status, &mut tried);
        tried
    }

    /// What is said about a refused request.
    fn message(
        &self,
        status: u16,
        complaint: &Complaint,
        hint: Option<&str>,
        request_id: &str,
    ) -> String {
        let mut message = format!("{} answered {status}", self.base());
        let said = self.connection.scrub.line(&complaint.message);
        if !said.is_empty() {
            message = format!("{message}: {said}");
        }
        if let Some(hint) = hint {
            message = format!("{message} ({hint})");
        }
        if !request_id.is_empty() {
            message = format!("{message} [request {request_id}]");
        }
        message
    }

    /// Lets all requests wait as long as the server asked one to; one that would wait too long is given up.
    fn pause(&self, status: u16, tried: &mut FailedTry) {
        let longest = self.sending.max_wait;
        match tried.wait {
            Some(wait) if wait > longest => {
                tried.again = false;
                if asks_for_pause(status) {
                    tried.reach = Reach::Endpoint;
                }
                tried.failure.message = format!(
                    "{} (it asks to wait {:.0} s, beyond --max-wait of {:.0} s)",
                    tried.failure.message,
                    wait.as_secs_f64(),
                    longest.as_secs_f64()
                );
            }
            Some(wait) if status == 429 => self.gate.shut(wait),
            Some(wait) if asks_for_pause(status) => self.gate.hold(wait),
            // It does not say how long: all wait as long as the one that was turned away does first.
            None if asks_for_pause(status) && tried.again => {
                self.gate.hold(self.sending.first_delay);
            }
            _ => {}
        }
    }

    /// The server's name for a request, fit to be shown.
    fn request_id(&self, answer: &HttpReply) -> String {
        self.connection.scrub.line(answer.header("x-request-id"))
    }
}

/// Whether a status means that there is no room for any request now.
fn asks_for_pause(status: u16) -> bool {
    matches!(status, 429 | 503 | 529)
}
