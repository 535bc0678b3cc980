//! One server and how it is talked to: [`Endpoint`].

use std::error::Error as _;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, SystemTime};

use backon::{ExponentialBuilder, Retryable as _};
use reqwest::header::{CONTENT_TYPE, HeaderMap, LOCATION};
use reqwest::{Client, Response, StatusCode, Url};
use tokio::sync::watch;
use tokio::time::{Instant, sleep};
use tracing::debug;

use super::access::Access;
use super::body::Parts;
use super::complaint::Complaint;
use super::field::Refused;
use super::pace::{Allowance, Bounds, Gate, Quota, Window, asked_wait};
use super::response::{self, Flaw};
use super::secret::Scrub;
use super::url::BaseUrl;
use super::verdict::{Sent, Verdict, judge};
use super::{AskError, Reach, failure};
use crate::error::Result;
use crate::types::{Failure, FailureKind, Reply};

/// The most of a reply that is read, unpacked: no completion of a few tokens comes near, and memory is not the server's to
/// fill.
const LONGEST_REPLY: usize = 16 << 20;

/// The longest wait of our own making; a server may ask for longer ones.
const LONGEST_DELAY: Duration = Duration::from_secs(30);

/// How requests are sent and sent again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sending {
    /// The time one try may take, from connecting to the last byte of the reply.
    pub timeout: Duration,
    /// How many times a request is sent again after it failed.
    pub retries: u32,
    /// The wait before the first retry where the server asks for none; each further one doubles, and each is drawn out at
    /// random by up to its length.
    pub first_delay: Duration,
    /// The longest wait that a server may ask for; beyond it the request is given up at once.
    pub max_wait: Duration,
    /// How many requests are on the wire at once.
    pub concurrency: Bounds,
    /// What may be sent in a minute.
    pub quota: Quota,
}

impl Default for Sending {
    fn default() -> Self {
        Self {
            timeout: Duration::from_mins(2),
            retries: 5,
            first_delay: Duration::from_millis(500),
            max_wait: Duration::from_mins(2),
            concurrency: Bounds::DEFAULT,
            quota: Quota::default(),
        }
    }
}

/// An OpenAI-compatible endpoint: its address, key, pooled connections, and the pauses it asked for.
#[derive(Debug)]
pub struct Endpoint {
    base: BaseUrl,
    url: Url,
    headers: HeaderMap,
    has_key: bool,
    client: Client,
    sending: Sending,
    scrub: Scrub,
    gate: Gate,
    window: Window,
    closing: watch::Sender<bool>,
}

/// One try that brought no reply.
struct Miss {
    failure: Failure,
    reach: Reach,
    again: bool,
    /// The wait that the server asked for.
    wait: Option<Duration>,
    /// The field that it refused.
    refused: Option<Refused>,
}

impl Miss {
    /// One that may pass.
    fn passing(failure: Failure) -> Self {
        Self {
            failure,
            reach: Reach::Trial,
            again: true,
            wait: None,
            refused: None,
        }
    }
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
            url: access.base.completions(),
            headers: access.headers()?,
            has_key: access.key.is_some() || access.base.has_credentials(),
            client: access.client(sending.timeout, &scrub)?,
            base: access.base,
            sending,
            scrub,
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
        &self.base
    }

    pub(super) fn host(&self) -> &str {
        self.base.host()
    }

    pub(super) fn has_key(&self) -> bool {
        self.has_key
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
    async fn turn(&self) -> Result<(), Miss> {
        tokio::select! {
            biased;
            () = self.closed() => Err(Miss {
                failure: failure(FailureKind::Connection, "the run ended before it was asked".to_owned()),
                reach: Reach::Interrupted,
                again: false,
                wait: None,
                refused: None,
            }),
            () = self.gate.pass() => Ok(()),
        }
    }

    /// Sends a request, again where that may help. Nothing is left behind where the future is dropped.
    pub(super) async fn ask(&self, body: &Parts, sent: Sent<'_>) -> Result<Reply, AskError> {
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
            self.send(body.clone(), sent).await
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
        .when(|miss: &Miss| miss.again)
        // `None` where the retries are used up.
        .adjust(|miss, own| own.map(|own| miss.wait.unwrap_or(own)))
        .notify(|miss, wait| {
            debug!(endpoint = %self.base, ?wait, problem = miss.failure.message, "trying again");
        })
        .await;
        let attempts = attempts.into_inner();
        match outcome {
            Ok(reply) => Ok(Reply { attempts, ..reply }),
            Err(miss) => Err(AskError {
                failure: miss.failure,
                attempts,
                reach: miss.reach,
                refused: miss.refused,
            }),
        }
    }

    /// One try.
    async fn send(&self, body: Parts, sent: Sent<'_>) -> Result<Reply, Miss> {
        let started = Instant::now();
        let request = self
            .client
            .post(self.url.clone())
            .headers(self.headers.clone())
            .header(CONTENT_TYPE, "application/json")
            .body(reqwest::Body::wrap(body));
        let response = request
            .send()
            .await
            .map_err(|error| self.broken(error, started))?;
        let status = response.status();
        let headers = response.headers().clone();
        let body = self.receive(response, started).await;
        let request_id = header(&headers, "x-request-id");
        let took = started.elapsed();
        let latency_ms = took.as_millis() as u64;
        debug!(endpoint = %self.base, %status, latency_ms, request_id = self.scrub.line(request_id), "answered");
        if !status.is_success() {
            // A refusal whose words were lost on the way is a refusal all the same.
            let words = body.unwrap_or_default();
            if matches!(status.as_u16(), 429 | 503 | 529) {
                self.window.overloaded(started);
            }
            return Err(self.refused(status, &headers, &words, sent));
        }
        match response::read(&body?, header(&headers, CONTENT_TYPE.as_str())) {
            Ok(reply) => {
                self.window.succeeded(took);
                let left = Allowance::read(&headers, SystemTime::now());
                let tokens = reply.usage.and_then(|usage| usage.total());
                self.gate.ease(tokens, left, self.sending.max_wait);
                let clean = |text: Option<String>| text.map(|text| self.scrub.reply(text));
                Ok(Reply {
                    text: self.scrub.reply(reply.text),
                    refusal: clean(reply.refusal),
                    served_model: clean(reply.served_model),
                    latency_ms,
                    ..reply
                })
            }
            Err(Flaw::Said(complaint)) => {
                // Without a code of its own it is the server's failure, and may pass.
                let code = complaint.status().unwrap_or(500);
                let mut miss = self.complained(code, &complaint, &headers, sent);
                miss.failure.status = Some(status.as_u16());
                Err(miss)
            }
            Err(Flaw::Unreadable(what)) => Err(Miss::passing(Failure {
                kind: FailureKind::Response,
                status: Some(status.as_u16()),
                message: format!("{} answered with {}", self.base, self.scrub.line(&what)),
            })),
        }
    }

    /// The body of a reply, unpacked where it is compressed, up to a length.
    async fn receive(&self, mut response: Response, started: Instant) -> Result<Vec<u8>, Miss> {
        let mut body = Vec::new();
        while let Some(chunk) = response
            .chunk()
            .await
            .map_err(|error| self.broken(error, started))?
        {
            if body.len() + chunk.len() > LONGEST_REPLY {
                let message = format!("{} answered with more than 16 MiB", self.base);
                return Err(Miss {
                    again: false,
                    ..Miss::passing(failure(FailureKind::Response, message))
                });
            }
            body.extend_from_slice(&chunk);
        }
        Ok(body)
    }

    /// A try without a whole reply.
    fn broken(&self, error: reqwest::Error, started: Instant) -> Miss {
        let (kind, message) = if error.is_timeout() {
            self.window.overloaded(started);
            let timeout = self.sending.timeout.as_secs_f64();
            (
                FailureKind::Timeout,
                format!(
                    "{} did not answer within {timeout} s; allow more by --timeout",
                    self.base
                ),
            )
        } else {
            let said = self.scrub.line(&chain(&error.without_url()));
            // An authority that nobody here knows signs with companies and in laboratories.
            let hint = if said.contains("UnknownIssuer") {
                "; name the authority that signed it by --ca-file"
            } else {
                ""
            };
            let message = format!("{}: {said}{hint}", self.base);
            (FailureKind::Connection, message)
        };
        Miss::passing(failure(kind, message))
    }

    /// A try that the status says failed.
    fn refused(
        &self,
        status: StatusCode,
        headers: &HeaderMap,
        body: &[u8],
        sent: Sent<'_>,
    ) -> Miss {
        let mut complaint = Complaint::of_body(&String::from_utf8_lossy(body));
        if status.is_redirection() {
            complaint.message = format!("moved to {}", header(headers, LOCATION.as_str()));
        }
        self.complained(status.as_u16(), &complaint, headers, sent)
    }

    fn complained(
        &self,
        status: u16,
        complaint: &Complaint,
        headers: &HeaderMap,
        sent: Sent<'_>,
    ) -> Miss {
        let Verdict {
            kind,
            mut reach,
            mut again,
            hint,
            refused,
        } = judge(status, complaint, sent);
        match header(headers, "x-should-retry") {
            "true" => again = true,
            "false" => again = false,
            _ => {}
        }
        let wait = asked_wait(headers, SystemTime::now()).filter(|_| again);
        let mut message = format!("{} answered {status}", self.base);
        let said = self.scrub.line(&complaint.message);
        if !said.is_empty() {
            message = format!("{message}: {said}");
        }
        if let Some(hint) = hint {
            message = format!("{message} ({hint})");
        }
        let request_id = self.scrub.line(header(headers, "x-request-id"));
        if !request_id.is_empty() {
            message = format!("{message} [request {request_id}]");
        }
        let is_pause = matches!(status, 429 | 503 | 529);
        match wait {
            Some(wait) if wait > self.sending.max_wait => {
                again = false;
                if is_pause {
                    reach = Reach::Endpoint;
                }
                message = format!(
                    "{message} (it asks to wait {:.0} s, beyond --max-wait of {:.0} s)",
                    wait.as_secs_f64(),
                    self.sending.max_wait.as_secs_f64()
                );
            }
            Some(wait) if status == 429 => self.gate.shut(wait),
            Some(wait) if is_pause => self.gate.hold(wait),
            // It does not say how long: all wait as long as the one that was turned away does first.
            None if is_pause && again => self.gate.hold(self.sending.first_delay),
            _ => {}
        }
        Miss {
            failure: Failure {
                kind,
                status: Some(status),
                message,
            },
            reach,
            again,
            wait,
            refused,
        }
    }
}

/// A header as text, empty where there is none.
fn header<'a>(headers: &'a HeaderMap, name: &str) -> &'a str {
    let value = headers.get(name).and_then(|value| value.to_str().ok());
    value.unwrap_or_default()
}

/// An error with all that caused it: reqwest's own words alone say only that something failed.
pub(super) fn chain(error: &reqwest::Error) -> String {
    let mut words = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        words = format!("{words}: {error}");
        cause = error.source();
    }
    words
}
