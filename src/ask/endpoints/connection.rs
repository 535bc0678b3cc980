//! HTTP connections to one server: [`Connection`].

use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use reqwest::header::{CONTENT_TYPE, HeaderMap};
use reqwest::{Client, Method, RequestBuilder, Response, StatusCode};
use tokio::time::Instant;

use super::access::{Access, connect_timeout, with_causes};
use super::account_key::{AccountKey, KeyedHeaders};
use super::connection_fault::{UNKNOWN_HOST, is_unknown_host, lacks_open_files, permanent_cause};
use super::proxy::proxy_variable;
use super::time_limit::TimeLimit;
use super::url::BaseUrl;
use crate::ask::failures::{AskError, LONG_SILENCE, Reach, Retry, Unfinished};
use crate::ask::replies::bounded_json::parse;
use crate::ask::requests::{Parameters, RequestBody};
use crate::ask::secrets::Scrub;
use crate::error::Result;
use crate::files;
use crate::types::FailureKind;

/// Maximum size of a decompressed response, in bytes; chosen. A reply of a few tokens is far smaller, and a server must
/// not exhaust the memory.
const MAX_RESPONSE: usize = 16 << 20;

/// Maximum time of a stream, as a multiple of the timeout; chosen: a server that only sends comments to keep a
/// connection open must not block a run forever.
const STREAM_TIMEOUTS: u32 = 30;

/// Maximum time to download a file of replies; chosen.
const MAX_DOWNLOAD: Duration = Duration::from_hours(1);

/// Time limits of one attempt. Only time in which the process runs counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Deadline {
    /// Limit from the first byte sent to the last byte received.
    total: Duration,
    /// Limit between two chunks of the response; `None` for no such limit.
    idle: Option<Duration>,
}

impl Deadline {
    /// Limits for a response in one piece.
    pub(crate) fn total(timeout: Duration) -> Self {
        Self { total: timeout, idle: None }
    }

    /// Limits for a streamed response.
    pub(super) fn stream(timeout: Duration) -> Self {
        Self { total: timeout.saturating_mul(STREAM_TIMEOUTS), idle: Some(timeout) }
    }

    /// Limits for the download of a file.
    pub(super) fn download(timeout: Duration) -> Self {
        Self { total: MAX_DOWNLOAD, idle: Some(timeout) }
    }
}

/// Enforces the [`Deadline`] of one attempt.
#[derive(Debug)]
struct AttemptTimer {
    deadline: Deadline,
    total: TimeLimit,
}

impl AttemptTimer {
    fn new(deadline: Deadline) -> Self {
        Self { deadline, total: TimeLimit::new(deadline.total) }
    }

    /// Runs one step of the attempt.
    ///
    /// # Errors
    /// The limit that is reached before the step ends.
    async fn run<T>(&mut self, step: impl Future<Output = T>) -> Result<T, ReachedLimit> {
        let idle = self.deadline.idle;
        let step = async {
            match idle {
                None => Some(step.await),
                Some(idle) => TimeLimit::new(idle).run(step).await,
            }
        };
        match self.total.run(step).await {
            None => Err(ReachedLimit::Total(self.deadline.total)),
            Some(None) => Err(ReachedLimit::Idle(idle.unwrap_or_default())),
            Some(Some(output)) => Ok(output),
        }
    }
}

/// Time limit that an attempt reached.
#[derive(Debug, Clone, Copy)]
enum ReachedLimit {
    Total(Duration),
    Idle(Duration),
}

/// Pooled connections to a server, and its key.
#[derive(Debug, Clone)]
pub(crate) struct Connection {
    pub(crate) base: BaseUrl,
    /// The key, and the filter that removes it.
    key: Arc<AccountKey>,
    client: Client,
    timeout: Duration,
    /// Variable that sets the proxy; `None` without a proxy.
    proxy: Option<&'static str>,
    /// True after the first response: from then on an unknown host name is a DNS outage, not a mistyped address.
    has_answered: Arc<AtomicBool>,
}

/// Response to one request.
pub(crate) struct HttpResponse {
    pub(crate) status: StatusCode,
    pub(crate) headers: HeaderMap,
    pub(crate) body: Vec<u8>,
    /// Time from sending the request to the last byte of the response.
    pub(super) duration: Duration,
}

impl HttpResponse {
    /// Value of a header as text; empty if the header is missing or not text.
    pub(super) fn header(&self, name: &str) -> &str {
        self.headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default()
    }
}

/// The failure of a request without a response, after this time. A connection that is lost after a long silence was
/// closed by a gateway.
fn lost_after(error: AskError, time: Duration) -> AskError {
    let is_lost = error.failure.kind == FailureKind::Connection && error.may_have_effect;
    if is_lost && time >= LONG_SILENCE { error.with_unfinished(Unfinished::GatewayTimeout) } else { error }
}

impl Connection {
    /// Prepares connections to an endpoint; nothing is sent yet.
    pub(super) fn new(access: &Access, scrub: Scrub, timeout: Duration) -> Result<Self> {
        Ok(Self {
            proxy: proxy_variable(&access.base, |name| std::env::var_os(name))?,
            client: access.client(timeout, &scrub)?,
            base: access.base.clone(),
            key: Arc::new(AccountKey::new(access.clone(), scrub)),
            timeout,
            has_answered: Arc::default(),
        })
    }

    /// Filter that removes the keys and passwords of the endpoint from text of the server.
    pub(crate) fn scrub(&self) -> Arc<Scrub> {
        self.key.scrub()
    }

    /// Sends a JSON body to a path below the base URL, and again if the server refuses the key and its file has another
    /// one.
    pub(super) async fn post(
        &self,
        path: &str,
        headers: &HeaderMap,
        body: &RequestBody,
        deadline: Deadline,
    ) -> Result<HttpResponse, AskError> {
        let keyed = self.key.add_to(headers);
        let response = self.post_once(path, &keyed.headers, body, deadline).await?;
        if !self.has_new_key(response.status, &keyed) {
            return Ok(response);
        }
        let keyed = self.key.add_to(headers);
        self.post_once(path, &keyed.headers, body, deadline).await
    }

    /// True if a response with this status refuses the key of its request, and the file of the key has another one.
    fn has_new_key(&self, status: StatusCode, keyed: &KeyedHeaders) -> bool {
        status == StatusCode::UNAUTHORIZED && self.key.renew(keyed)
    }

    async fn post_once(
        &self,
        path: &str,
        headers: &HeaderMap,
        body: &RequestBody,
        deadline: Deadline,
    ) -> Result<HttpResponse, AskError> {
        loop {
            let request = self
                .client
                .post(self.base.join(path))
                .headers(headers.clone())
                .header(CONTENT_TYPE, "application/json")
                .body(reqwest::Body::wrap(body.clone()));
            let mut timer = AttemptTimer::new(deadline);
            match self.exchange_within(&mut timer, request).await {
                // The process was suspended while it connected: nothing was sent, so connect again.
                Err(error)
                    if error.failure.kind == FailureKind::Timeout
                        && !error.may_have_effect
                        && !timer.total.suspended().is_zero() => {}
                outcome => return outcome,
            }
        }
    }

    /// Builds a request to a path below the base URL, with these fields in its query string.
    pub(crate) fn request(&self, method: Method, path: &str, query: &[(&str, &str)]) -> RequestBuilder {
        let mut url = self.base.join(path);
        if !query.is_empty() {
            url.query_pairs_mut().extend_pairs(query);
        }
        self.client.request(method, url)
    }

    /// Sends a request without a streamed body, and again if the server refuses the key and its file has another one. A
    /// request with a streamed body is sent once.
    pub(crate) async fn exchange_keyed(
        &self,
        request: RequestBuilder,
        headers: &HeaderMap,
        deadline: Deadline,
    ) -> Result<HttpResponse, AskError> {
        let again = request.try_clone();
        let keyed = self.key.add_to(headers);
        let request = request.headers(keyed.headers.clone());
        let response = self.exchange(request, deadline).await?;
        match again {
            Some(again) if self.has_new_key(response.status, &keyed) => {
                let keyed = self.key.add_to(headers);
                self.exchange(again.headers(keyed.headers), deadline).await
            }
            _ => Ok(response),
        }
    }

    /// Sends a request once.
    pub(crate) async fn exchange(&self, request: RequestBuilder, deadline: Deadline) -> Result<HttpResponse, AskError> {
        self.exchange_within(&mut AttemptTimer::new(deadline), request).await
    }

    async fn exchange_within(
        &self,
        timer: &mut AttemptTimer,
        request: RequestBuilder,
    ) -> Result<HttpResponse, AskError> {
        let started = Instant::now();
        let response = self.run_step(timer, request.send()).await;
        let running_time = started.elapsed().saturating_sub(timer.total.suspended());
        let response = response.map_err(|error| lost_after(error, running_time))?;
        self.has_answered.store(true, Ordering::Relaxed);
        let status = response.status();
        let headers = response.headers().clone();
        let body = match self.receive(timer, response).await {
            // A stream is sent while the server works.
            Err(error) if status.is_success() && timer.deadline.idle.is_some() => {
                return Err(error.with_unfinished(Unfinished::BrokeOff));
            }
            Err(error) if status.is_success() => return Err(error),
            // The status of a refusal suffices without its body.
            body => body.unwrap_or_default(),
        };
        Ok(HttpResponse { status, headers, body, duration: started.elapsed().saturating_sub(timer.total.suspended()) })
    }

    /// Requests the context length and the path of a model, as text, from servers that report them (vLLM does); `None`
    /// if the request fails or does not list the model.
    pub(super) async fn model_facts(&self, headers: &HeaderMap, parameters: &Parameters) -> Option<String> {
        let request = self.client.get(self.base.join("models")).headers(headers.clone());
        let response = self.exchange(request, Deadline::total(self.timeout)).await.ok()?;
        if !response.status.is_success() {
            return None;
        }
        let list = parse(std::str::from_utf8(&response.body).ok()?).ok()?;
        let model = list.get("data")?.as_array()?.iter().find(|model| model["id"] == *parameters.model)?;
        let facts: Vec<String> = ["max_model_len", "root"]
            .into_iter()
            .filter_map(|name| Some(format!("{name} {}", model.get(name)?)))
            .collect();
        Some(self.scrub().line(&facts.join(", ")))
    }

    /// Sends a request once, and writes the body of a successful response to a file of at most `max_bytes` bytes; the
    /// body of the returned response is then empty. The download fails if no byte arrives for the timeout of a request.
    pub(crate) async fn download(
        &self,
        request: RequestBuilder,
        headers: &HeaderMap,
        to: &Path,
        max_bytes: u64,
    ) -> Result<HttpResponse, AskError> {
        let started = Instant::now();
        let mut timer = AttemptTimer::new(Deadline::download(self.timeout));
        let again = request.try_clone();
        let keyed = self.key.add_to(headers);
        let request = request.headers(keyed.headers.clone());
        let mut response = self.run_step(&mut timer, request.send()).await?;
        if let Some(again) = again
            && self.has_new_key(response.status(), &keyed)
        {
            let again = again.headers(self.key.add_to(headers).headers);
            response = self.run_step(&mut timer, again.send()).await?;
        }
        let (status, headers) = (response.status(), response.headers().clone());
        let body = if status.is_success() {
            let write_error = |error| {
                let message = format!("{}: cannot write: {error}", to.display());
                AskError::new(FailureKind::Response, message)
            };
            let mut file = files::create_new(to).map_err(write_error)?;
            let mut written = 0;
            while let Some(chunk) = self.run_step(&mut timer, response.chunk()).await? {
                written += chunk.len() as u64;
                if written > max_bytes {
                    let message = format!("{} sent a file of more than {max_bytes} bytes", self.base);
                    return Err(AskError::new(FailureKind::Response, message));
                }
                file.write_all(&chunk).map_err(write_error)?;
            }
            file.sync_all().map_err(write_error)?;
            Vec::new()
        } else {
            self.receive(&mut timer, response).await.unwrap_or_default()
        };
        Ok(HttpResponse { status, headers, body, duration: started.elapsed() })
    }

    /// Reads the decompressed body of a response, up to [`MAX_RESPONSE`].
    async fn receive(&self, timer: &mut AttemptTimer, mut response: Response) -> Result<Vec<u8>, AskError> {
        let mut body = Vec::new();
        while let Some(chunk) = self.run_step(timer, response.chunk()).await? {
            if body.len() + chunk.len() > MAX_RESPONSE {
                let message = format!("{} answered with more than 16 MiB", self.base);
                return Err(AskError::new(FailureKind::Response, message));
            }
            body.extend_from_slice(&chunk);
        }
        Ok(body)
    }

    /// Runs one step of an attempt, and describes its failure.
    async fn run_step<T>(
        &self,
        timer: &mut AttemptTimer,
        step: impl Future<Output = reqwest::Result<T>>,
    ) -> Result<T, AskError> {
        let message = match timer.run(step).await {
            Ok(result) => return result.map_err(|error| self.request_error(error)),
            Err(ReachedLimit::Total(limit)) => self.timeout_message(limit),
            Err(ReachedLimit::Idle(limit)) => {
                format!("{} sent nothing for {} s; allow more with --timeout", self.base, limit.as_secs_f64())
            }
        };
        Err(AskError { retry: Retry::AfterDelay, ..AskError::new(FailureKind::Timeout, message) })
    }

    /// Message about a request without a response within a time limit.
    fn timeout_message(&self, limit: Duration) -> String {
        let limit = limit.as_secs_f64();
        format!("{} did not answer within {limit} s; allow more with --timeout", self.base)
    }

    /// Error of a request without a complete response.
    fn request_error(&self, error: reqwest::Error) -> AskError {
        // Without a connection the request was not sent.
        let may_have_effect = !error.is_connect();
        if error.is_timeout() {
            let message = self.timeout_message(connect_timeout(self.timeout));
            return AskError {
                retry: Retry::AfterDelay,
                may_have_effect,
                ..AskError::new(FailureKind::Timeout, message)
            };
        }
        let lacks_files = lacks_open_files(&error);
        let text = self.scrub().line(&with_causes(&error.without_url()));
        if lacks_files {
            let message = format!(
                "{}: {text}; this process may open no more files: less --concurrency, or more with ulimit -n",
                self.base
            );
            return AskError {
                retry: Retry::WhenAccepted,
                may_have_effect,
                ..AskError::new(FailureKind::Connection, message)
            };
        }
        let server = match self.proxy {
            Some(variable) => format!("{}, through the proxy of {variable}", self.base),
            None => self.base.to_string(),
        };
        let is_mistyped = !self.has_answered.load(Ordering::Relaxed) && is_unknown_host(&text);
        let remedy = is_mistyped.then_some(UNKNOWN_HOST).or_else(|| permanent_cause(&text, self.base.is_plain()));
        let Some(remedy) = remedy else {
            return AskError {
                retry: Retry::AfterDelay,
                may_have_effect,
                ..AskError::new(FailureKind::Connection, format!("{server}: {text}"))
            };
        };
        let message = format!("{server}: {remedy} ({text})");
        AskError { reach: Reach::Endpoint, ..AskError::new(FailureKind::Connection, message) }
    }
}
