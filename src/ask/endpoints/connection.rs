//! The connections to one server: [`Connection::post`] sends one request.

use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use reqwest::header::{CONTENT_TYPE, HeaderMap};
use reqwest::{Client, Method, RequestBuilder, Response, StatusCode};
use tokio::time::Instant;

use super::access::{Access, connect_limit, with_causes};
use super::connection_fault::{UNKNOWN_HOST, is_unknown_host, lacks_open_files, permanent_cause};
use super::time_limit::TimeLimit;
use super::url::BaseUrl;
use crate::ask::failures::{Again, AskError, Reach};
use crate::ask::replies::bounded_json::parse;
use crate::ask::requests::{Parameters, Parts};
use crate::ask::secrets::Scrub;
use crate::error::Result;
use crate::files;
use crate::types::FailureKind;

/// The maximum size of a decompressed reply, in bytes; chosen. A reply of a few tokens is far smaller, and a server must not
/// fill the memory.
const MAX_REPLY: usize = 16 << 20;

/// The maximum time of a stream, as a multiple of the timeout; chosen: a server that keeps a connection open by comments alone must
/// not hold a run for ever.
const STREAM_TIMEOUTS: u32 = 30;

/// The longest time that a file of replies may take; chosen.
const LONGEST_DOWNLOAD: Duration = Duration::from_hours(1);

/// The time limits of one try, each of the time in which the process runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::ask) struct Deadline {
    /// From the first byte sent to the last byte received.
    whole: Duration,
    /// Between two pieces of the response; `None` if only the whole try is limited.
    silence: Option<Duration>,
}

impl Deadline {
    /// The deadline of a try whose response is one piece.
    pub(in crate::ask) fn whole(timeout: Duration) -> Self {
        Self {
            whole: timeout,
            silence: None,
        }
    }

    /// The deadline of a try whose response is a stream.
    pub(super) fn stream(timeout: Duration) -> Self {
        Self {
            whole: timeout.saturating_mul(STREAM_TIMEOUTS),
            silence: Some(timeout),
        }
    }

    /// The deadline of a download.
    pub(super) fn download(timeout: Duration) -> Self {
        Self {
            whole: LONGEST_DOWNLOAD,
            silence: Some(timeout),
        }
    }
}

/// The time that a try has left.
#[derive(Debug)]
struct TryTime {
    deadline: Deadline,
    whole: TimeLimit,
}

impl TryTime {
    fn new(deadline: Deadline) -> Self {
        Self {
            deadline,
            whole: TimeLimit::new(deadline.whole),
        }
    }

    /// The output of one step of the try, or the limit that is reached first.
    async fn step<T>(&mut self, step: impl Future<Output = T>) -> Result<T, TimeOut> {
        let silence = self.deadline.silence;
        let step = async {
            match silence {
                None => Some(step.await),
                Some(silence) => TimeLimit::new(silence).run(step).await,
            }
        };
        match self.whole.run(step).await {
            None => Err(TimeOut::Whole(self.deadline.whole)),
            Some(None) => Err(TimeOut::Silence(silence.unwrap_or_default())),
            Some(Some(output)) => Ok(output),
        }
    }
}

/// The limit that a try reached.
#[derive(Debug, Clone, Copy)]
enum TimeOut {
    Whole(Duration),
    Silence(Duration),
}

/// Pooled connections to a server, and the filter for secrets in its texts.
#[derive(Debug, Clone)]
pub(in crate::ask) struct Connection {
    pub(in crate::ask) base: BaseUrl,
    pub(in crate::ask) scrub: Scrub,
    client: Client,
    timeout: Duration,
    /// True after the first response: an unknown host name is then an outage of the name server and no mistyped address.
    has_answered: Arc<AtomicBool>,
}

/// The response to one request.
pub(in crate::ask) struct HttpReply {
    pub(in crate::ask) status: StatusCode,
    pub(in crate::ask) headers: HeaderMap,
    pub(in crate::ask) body: Vec<u8>,
    /// The time from sending the request to the last byte of the response.
    pub(super) took: Duration,
}

impl HttpReply {
    /// A header as text, empty if there is none.
    pub(super) fn header(&self, name: &str) -> &str {
        let value = self.headers.get(name).and_then(|value| value.to_str().ok());
        value.unwrap_or_default()
    }
}

impl Connection {
    /// The connections to an endpoint; nothing is sent yet.
    pub(super) fn new(access: &Access, scrub: Scrub, timeout: Duration) -> Result<Self> {
        Ok(Self {
            client: access.client(timeout, &scrub)?,
            base: access.base.clone(),
            scrub,
            timeout,
            has_answered: Arc::default(),
        })
    }

    /// Sends a body to a path below the base URL.
    pub(super) async fn post(
        &self,
        path: &str,
        headers: &HeaderMap,
        body: &Parts,
        deadline: Deadline,
    ) -> Result<HttpReply, AskError> {
        loop {
            let request = self
                .client
                .post(self.base.join(path))
                .headers(headers.clone())
                .header(CONTENT_TYPE, "application/json")
                .body(reqwest::Body::wrap(body.clone()));
            let mut time = TryTime::new(deadline);
            match self.exchange_in(request, &mut time).await {
                // The process was stopped while it connected: nothing was sent.
                Err(failed)
                    if failed.failure.kind == FailureKind::Timeout
                        && !failed.may_have_effect
                        && !time.whole.paused().is_zero() => {}
                sent => return sent,
            }
        }
    }

    /// A request to a path below the base URL, with these fields in its query string.
    pub(in crate::ask) fn request(
        &self,
        method: Method,
        path: &str,
        query: &[(&str, &str)],
    ) -> RequestBuilder {
        let mut url = self.base.join(path);
        if !query.is_empty() {
            url.query_pairs_mut().extend_pairs(query);
        }
        self.client.request(method, url)
    }

    /// Sends a request once.
    pub(in crate::ask) async fn exchange(
        &self,
        request: RequestBuilder,
        deadline: Deadline,
    ) -> Result<HttpReply, AskError> {
        self.exchange_in(request, &mut TryTime::new(deadline)).await
    }

    async fn exchange_in(
        &self,
        request: RequestBuilder,
        time: &mut TryTime,
    ) -> Result<HttpReply, AskError> {
        let started = Instant::now();
        let response = self.in_time(time, request.send()).await?;
        self.has_answered.store(true, Ordering::Relaxed);
        let status = response.status();
        let headers = response.headers().clone();
        let body = match self.receive(response, time).await {
            Err(failed) if status.is_success() => return Err(failed),
            // The status alone states that the request was refused.
            body => body.unwrap_or_default(),
        };
        Ok(HttpReply {
            status,
            headers,
            body,
            took: started.elapsed().saturating_sub(time.whole.paused()),
        })
    }

    /// The model's longest context and the files that it was loaded from, where the server reports them (vLLM does);
    /// `None` if it cannot be asked.
    pub(super) async fn model_facts(
        &self,
        headers: &HeaderMap,
        parameters: &Parameters,
    ) -> Option<String> {
        let request = self.client.get(self.base.join("models"));
        let request = request.headers(headers.clone());
        let exchange = self.exchange(request, Deadline::whole(self.timeout));
        let answer = exchange.await.ok()?;
        if !answer.status.is_success() {
            return None;
        }
        let list = parse(std::str::from_utf8(&answer.body).ok()?).ok()?;
        let models = list.get("data")?.as_array()?;
        let own = models
            .iter()
            .find(|model| model["id"] == *parameters.model)?;
        let facts = ["max_model_len", "root"]
            .map(|name| own.get(name).map(|value| format!("{name} {value}")));
        let facts: Vec<String> = facts.into_iter().flatten().collect();
        Some(self.scrub.line(&facts.join(", ")))
    }

    /// Sends a request once, and writes the body of a successful response to a file, of at most `most` bytes. The body of the returned
    /// response is empty then. No byte for the time of a request ends it.
    pub(in crate::ask) async fn save(
        &self,
        request: RequestBuilder,
        to: &Path,
        most: u64,
    ) -> Result<HttpReply, AskError> {
        let started = Instant::now();
        let mut time = TryTime::new(Deadline::download(self.timeout));
        let mut response = self.in_time(&mut time, request.send()).await?;
        let (status, headers) = (response.status(), response.headers().clone());
        let body = if status.is_success() {
            let failed = |what: String| AskError::new(FailureKind::Response, what);
            let unwritten = |e| failed(format!("{}: cannot write: {e}", to.display()));
            let mut file = files::create_new(to).map_err(unwritten)?;
            let mut written = 0;
            while let Some(chunk) = self.in_time(&mut time, response.chunk()).await? {
                written += chunk.len() as u64;
                if written > most {
                    let what = format!("{} sent a file of more than {most} bytes", self.base);
                    return Err(failed(what));
                }
                file.write_all(&chunk).map_err(unwritten)?;
            }
            file.sync_all().map_err(unwritten)?;
            Vec::new()
        } else {
            self.receive(response, &mut time).await.unwrap_or_default()
        };
        Ok(HttpReply {
            status,
            headers,
            body,
            took: started.elapsed(),
        })
    }

    /// The body of a response, decompressed, up to [`MAX_REPLY`].
    async fn receive(
        &self,
        mut response: Response,
        time: &mut TryTime,
    ) -> Result<Vec<u8>, AskError> {
        let mut body = Vec::new();
        while let Some(chunk) = self.in_time(time, response.chunk()).await? {
            if body.len() + chunk.len() > MAX_REPLY {
                let message = format!("{} answered with more than 16 MiB", self.base);
                return Err(AskError::new(FailureKind::Response, message));
            }
            body.extend_from_slice(&chunk);
        }
        Ok(body)
    }

    /// The result of one step of a request, or its failure.
    async fn in_time<T>(
        &self,
        time: &mut TryTime,
        step: impl Future<Output = reqwest::Result<T>>,
    ) -> Result<T, AskError> {
        let message = match time.step(step).await {
            Ok(done) => return done.map_err(|error| self.failed_try(error)),
            Err(TimeOut::Whole(limit)) => self.no_answer_within(limit),
            Err(TimeOut::Silence(limit)) => format!(
                "{} sent nothing for {} s; allow more with --timeout",
                self.base,
                limit.as_secs_f64()
            ),
        };
        Err(AskError {
            again: Again::Later,
            ..AskError::new(FailureKind::Timeout, message)
        })
    }

    /// The message about a request without an answer in time.
    fn no_answer_within(&self, limit: Duration) -> String {
        let limit = limit.as_secs_f64();
        format!(
            "{} did not answer within {limit} s; allow more with --timeout",
            self.base
        )
    }

    /// The failure of a request without a complete response.
    fn failed_try(&self, error: reqwest::Error) -> AskError {
        // A request whose connection was not made was not sent.
        let may_have_effect = !error.is_connect();
        if error.is_timeout() {
            let message = self.no_answer_within(connect_limit(self.timeout));
            return AskError {
                again: Again::Later,
                may_have_effect,
                ..AskError::new(FailureKind::Timeout, message)
            };
        }
        let lacks_files = lacks_open_files(&error);
        let text = self.scrub.line(&with_causes(&error.without_url()));
        if lacks_files {
            let message = format!(
                "{}: {text}; this process may open no more files: less --concurrency, or more with ulimit -n",
                self.base
            );
            return AskError {
                again: Again::WhenTaken,
                may_have_effect,
                ..AskError::new(FailureKind::Connection, message)
            };
        }
        let is_mistyped = !self.has_answered.load(Ordering::Relaxed) && is_unknown_host(&text);
        let unknown = is_mistyped.then_some(UNKNOWN_HOST);
        let Some(remedy) = unknown.or_else(|| permanent_cause(&text, self.base.is_plain())) else {
            return AskError {
                again: Again::Later,
                may_have_effect,
                ..AskError::new(FailureKind::Connection, format!("{}: {text}", self.base))
            };
        };
        let message = format!("{}: {remedy} ({text})", self.base);
        AskError {
            reach: Reach::Endpoint,
            ..AskError::new(FailureKind::Connection, message)
        }
    }
}
