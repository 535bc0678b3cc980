//! A server and the way requests are sent to it: [`Endpoint`].

use std::time::{Duration, SystemTime};

use backon::{BackoffBuilder as _, ExponentialBuilder};
use reqwest::header::{CONTENT_TYPE, HeaderMap, LOCATION};
use tokio::sync::watch;
use tokio::time::{Instant, sleep};
use tracing::debug;

use super::access::Access;
use super::batch_api::BatchServer;
use super::body::Parts;
use super::complaint::{Complaint, UnreadableReply};
use super::connection::{Connection, HttpReply};
use super::failure::{Again, AskError, FailedTry, Reach};
use super::failure_class::FailureClass;
use super::field::SentFields;
use super::pace::{Allowance, Gate, Window, asked_wait};
use super::sending::Sending;
use super::url::BaseUrl;
use super::wire::Wire;
use crate::error::Result;
use crate::types::{Failure, FailureKind, Reply};

/// The maximum wait between retries if the server asks for none; chosen. A server may ask for longer waits.
const MAX_DELAY: Duration = Duration::from_secs(30);

/// A server: its address, key, pooled connections, and the pauses that it asked for.
#[derive(Debug)]
pub struct Endpoint {
    access: Access,
    connection: Connection,
    sending: Sending,
    gate: Gate,
    window: Window,
    closing: watch::Sender<bool>,
}

/// One request, which may be sent several times.
pub(super) struct Request<'a> {
    pub(super) wire: Wire,
    pub(super) headers: &'a HeaderMap,
    pub(super) body: Parts,
    pub(super) sent: SentFields<'a>,
}

impl Endpoint {
    /// An endpoint that is ready for requests; nothing is sent yet.
    ///
    /// # Errors
    /// If a key would be sent unencrypted to another machine, or if two keys are set.
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

    /// The number of requests that may be in flight now, within [`Sending::concurrency`].
    #[must_use]
    pub fn width(&self) -> usize {
        self.window.width()
    }

    /// The base URL; its text has no user, password and query string.
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

    /// The headers of every request to an API.
    pub(super) fn headers(&self, wire: Wire) -> Result<HeaderMap> {
        self.access.headers(wire)
    }

    /// The files and batches of the server.
    ///
    /// # Errors
    /// If a header value has characters that HTTP does not allow.
    pub(crate) fn batch_server(&self) -> Result<BatchServer> {
        let headers = self.headers(Wire::Chat)?;
        let connection = self.connection.clone();
        Ok(BatchServer::new(connection, headers, self.sending.timeout))
    }

    /// Stops further requests: those in flight are finished, those that wait fail at once.
    pub fn close(&self) {
        self.closing.send_replace(true);
    }

    /// Waits until the endpoint is closed.
    async fn closed(&self) {
        // The sender lives as long as the endpoint, so only a change can end this wait.
        let _ = self.closing.subscribe().wait_for(|closing| *closing).await;
    }

    /// Waits until the request may be sent, and tells when that is; an error if the endpoint is closed before.
    async fn wait_turn(&self) -> Result<Instant, FailedTry> {
        let message = "the run ended before it was asked";
        tokio::select! {
            biased;
            () = self.closed() => Err(FailedTry {
                reach: Reach::Interrupted,
                ..FailedTry::new(FailureKind::Connection, message.to_owned())
            }),
            turn = self.gate.pass() => Ok(turn),
        }
    }

    /// Sends a request, with retries after failures that may pass. While the endpoint takes no more, the request waits without spending
    /// a retry, for at most [`Sending::patience`]. The future may be dropped at any time.
    pub(super) async fn ask(&self, request: &Request<'_>) -> Result<Reply, AskError> {
        let mut tries = ExponentialBuilder::new()
            .with_jitter()
            .with_min_delay(self.sending.first_delay)
            .with_max_delay(MAX_DELAY)
            .with_max_times(self.sending.retries as usize)
            .build();
        let mut attempts = 0;
        loop {
            let sent = self.wait_turn().await.map_err(|e| e.after(attempts))?;
            attempts += 1;
            let mut failed = match self.send(request, sent).await {
                Ok(reply) => return Ok(Reply { attempts, ..reply }),
                Err(failed) => failed,
            };
            let delay = match failed.again {
                Again::Never => None,
                Again::Later => tries.next().map(|delay| failed.wait.unwrap_or(delay)),
                Again::WhenTaken if self.gate.refused_for() > self.sending.patience => {
                    failed = self.out_of_patience(failed);
                    None
                }
                // The gate holds all requests for as long as the server asked.
                Again::WhenTaken if failed.wait.is_some() => Some(Duration::ZERO),
                Again::WhenTaken => Some(self.sending.first_delay),
            };
            let Some(delay) = delay else {
                return Err(failed.after(attempts));
            };
            debug!(endpoint = %self.base(), ?delay, problem = failed.failure.message, "trying again");
            self.rest(delay).await;
        }
    }

    /// Sleeps, or until the endpoint is closed.
    async fn rest(&self, delay: Duration) {
        tokio::select! {
            () = self.closed() => {}
            () = sleep(delay) => {}
        }
    }

    /// The failure of a request that was turned away for too long: every other one is, too.
    fn out_of_patience(&self, mut failed: FailedTry) -> FailedTry {
        failed.reach = Reach::Endpoint;
        failed.failure.message = format!(
            "{} (nothing was taken for {:.0} s, beyond --patience; go on later with --resume)",
            failed.failure.message,
            self.gate.refused_for().as_secs_f64()
        );
        failed
    }

    /// Sends the request once; `sent` is the time of its turn.
    async fn send(&self, request: &Request<'_>, sent: Instant) -> Result<Reply, FailedTry> {
        let Request { wire, headers, .. } = *request;
        let body = request.body.clone();
        let posted = self.connection.post(wire.path(), headers, body).await;
        let answer = posted.inspect_err(|failed| {
            if failed.failure.kind == FailureKind::Timeout {
                self.window.overloaded(sent);
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
            UnreadableReply::Other(what) => {
                let what = self.connection.scrub.line(&what);
                let message = format!("{} answered with {what}", self.base());
                FailedTry {
                    again: Again::Later,
                    ..FailedTry::new(FailureKind::Response, message)
                }
            }
        };
        failed.failure.status = Some(status);
        Err(failed)
    }

    /// The reply without keys; its tokens and the remaining limits are noted in the gate.
    fn succeeded(&self, reply: Reply, answer: &HttpReply, sent: Instant) -> Reply {
        self.window.succeeded(answer.took);
        let allowance = Allowance::read(&answer.headers, SystemTime::now());
        let tokens = reply.usage.and_then(|usage| usage.total());
        self.gate
            .succeeded(sent, tokens, allowance, self.sending.max_wait);
        let scrubbed = |text: String| self.connection.scrub.reply(text);
        Reply {
            text: scrubbed(reply.text),
            refusal: reply.refusal.map(scrubbed),
            served_model: reply.served_model.map(scrubbed),
            latency_ms: answer.took.as_millis() as u64,
            ..reply
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
    ) -> FailedTry {
        let mut class = FailureClass::of(status, complaint, request.wire, request.sent);
        match answer.header("x-should-retry") {
            "true" => class.retryable = true,
            "false" => class.retryable = false,
            _ => {}
        }
        let hint = class.hint.as_deref();
        let message = self.message(status, complaint, hint, &self.request_id(answer));
        let now = SystemTime::now();
        let stated = asked_wait(&answer.headers, now).max(complaint.wait);
        let reset = || Allowance::read(&answer.headers, now).pause();
        let wait = stated
            .or_else(|| reset().filter(|_| status == 429))
            .filter(|_| class.retryable);
        let again = match class.retryable {
            false => Again::Never,
            true if status == 429 || (asks_for_pause(status) && wait.is_some()) => Again::WhenTaken,
            true => Again::Later,
        };
        let mut failed = FailedTry {
            failure: Failure {
                kind: class.kind,
                status: Some(status),
                message,
            },
            reach: class.reach,
            again,
            wait,
            refused_field: class.refused_field,
        };
        self.pause(status, sent, &mut failed);
        failed
    }

    /// The error text for a refused request.
    fn message(
        &self,
        status: u16,
        complaint: &Complaint,
        hint: Option<&str>,
        request_id: &str,
    ) -> String {
        let mut message = format!("{} answered {status}", self.base());
        let text = self.connection.scrub.line(&complaint.message);
        if !text.is_empty() {
            message = format!("{message}: {text}");
        }
        if let Some(hint) = hint {
            message = format!("{message} ({hint})");
        }
        if !request_id.is_empty() {
            message = format!("{message} [request {request_id}]");
        }
        message
    }

    /// Makes all requests wait as long as the server asked; a request that would wait more than `--max-wait` is given up, and
    /// the time at which it could go on is said.
    fn pause(&self, status: u16, sent: Instant, failed: &mut FailedTry) {
        let max_wait = self.sending.max_wait;
        match failed.wait {
            Some(wait) if wait > max_wait => {
                failed.again = Again::Never;
                if asks_for_pause(status) {
                    failed.reach = Reach::Endpoint;
                }
                failed.failure.message = format!(
                    "{} (it asks to wait {:.0} s, beyond --max-wait of {:.0} s)",
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

/// Whether a status means that the server accepts no request at the moment.
fn asks_for_pause(status: u16) -> bool {
    matches!(status, 429 | 503 | 529)
}
