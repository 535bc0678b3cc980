//! HTTP connections to one server: [`Connection`].
//!
//! Causes of failed connections: [`permanent_cause`] and [`is_unknown_host`] search the error text of the HTTP client,
//! [`lacks_open_files`] inspects the error itself.
//!
//! Time limit that excludes suspensions of the process: [`RunningLimit`].
//!
//! A suspended process (Ctrl-Z, `scontrol suspend`, a closed laptop) reads nothing, but the clock runs on. Replies that
//! arrive during the suspension are paid for, so they must be read before a timeout is declared.

use std::error::Error;
use std::io::{self, Write as _};
use std::path::Path;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use reqwest::header::{CONTENT_TYPE, HeaderMap};
use reqwest::{Client, Method, RequestBuilder, Response, StatusCode};
use tokio::time::{Instant, timeout};

use super::access::{Access, AccountKey, KeyedHeaders, connect_timeout, with_causes};
use super::url::{BaseUrl, proxy_variable};
use crate::bounded_json::parse;
use crate::failures::{AskError, LONG_SILENCE, Reach, Retry, Unfinished};
use crate::requests::{Parameters, RequestBody};
use crate::secrets::Scrub;
use darkqa_base::error::Result;
use darkqa_base::files;
use darkqa_base::types::FailureKind;

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
    total: RunningLimit,
}

impl AttemptTimer {
    fn new(deadline: Deadline) -> Self {
        Self { deadline, total: RunningLimit::new(deadline.total) }
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
                Some(idle) => RunningLimit::new(idle).run(step).await,
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
    pub base: BaseUrl,
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
    pub status: StatusCode,
    pub headers: HeaderMap,
    pub body: Vec<u8>,
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

/// Phrases in errors that a retry does not solve, with the remedy.
const PERMANENT_CAUSES: [(&[&str], &str); 8] = [
    (
        &["UnknownIssuer", "self-signed", "self signed"],
        "its certificate is signed by an authority that is not trusted; name that authority, or the certificate itself, with --ca-file",
    ),
    (
        &["CaUsedAsEndEntity"],
        "its certificate is that of an authority (CA:TRUE) and is not trusted; name it with --ca-file, or make one with \
         basicConstraints=CA:FALSE",
    ),
    (
        &["certificate expired", "certificate not valid yet", "NotValidYet", "Expired"],
        "its certificate is not valid at the time of this machine; renew it, or set the clock",
    ),
    (
        &["NotValidForName", "certificate not valid for name"],
        "its certificate is for another host name; use the name in the certificate as --base-url",
    ),
    (
        &["invalid peer certificate"],
        "its certificate is rejected; make another one, or name the authority with --ca-file",
    ),
    (
        &["proxy authorization required", "proxy authentication required"],
        "the proxy asks for a user and password: set them in HTTPS_PROXY, or name the host in NO_PROXY",
    ),
    (
        &["failed to create underlying connection: received corrupt message"],
        "the proxy speaks plain http at this port; give it as http:// in that variable",
    ),
    (
        &["InvalidContentType", "corrupt message"],
        "the server speaks plain http at this port; use http:// in --base-url",
    ),
];

/// Phrases in errors of plain HTTP requests to a TLS port.
const TLS_PORT: [&str; 2] = ["invalid HTTP version parsed", "received invalid HTTP"];

/// Remedy for a connection error that a retry does not solve; `None` for other errors. `is_plain` is true for http://
/// addresses.
fn permanent_cause(text: &str, is_plain: bool) -> Option<&'static str> {
    if is_plain {
        let is_tls = TLS_PORT.iter().any(|phrase| text.contains(phrase));
        return is_tls.then_some(
            "the server does not answer in plain http at this port; if it speaks TLS, use https:// in --base-url",
        );
    }
    PERMANENT_CAUSES
        .iter()
        .find(|(phrases, _)| phrases.iter().any(|phrase| text.contains(phrase)))
        .map(|(_, remedy)| *remedy)
}

/// Remedy for a host name that DNS does not know.
const UNKNOWN_HOST: &str = "no name server knows this host; check --base-url and the proxy settings, and that the server is started and this machine is online";

/// Phrases of glibc, musl, macOS and Windows for a host name that does not exist. A DNS outage has other phrases.
const UNKNOWN_HOST_PHRASES: [&str; 5] = [
    "Name or service not known",
    "No address associated with hostname",
    "Name does not resolve",
    "nodename nor servname provided",
    "No such host is known",
];

/// True if the error text reports that the host name does not exist.
fn is_unknown_host(text: &str) -> bool {
    UNKNOWN_HOST_PHRASES.iter().any(|phrase| text.contains(phrase))
}

/// Error codes for too many open files, in this process or in the system: EMFILE and ENFILE; on Windows WSAEMFILE.
const TOO_MANY_FILES: &[i32] = if cfg!(windows) { &[10_024] } else { &[24, 23] };

/// True if a request failed because the system allows no further open file or connection.
fn lacks_open_files(error: &(dyn Error + 'static)) -> bool {
    error
        .downcast_ref::<io::Error>()
        .and_then(io::Error::raw_os_error)
        .is_some_and(|code| TOO_MANY_FILES.contains(&code))
        || error.source().is_some_and(lacks_open_files)
}

/// Number of steps into which a limit is divided (chosen). A suspension uses up at most one step of the limit.
const STEPS: u32 = 20;

/// Shortest step (chosen).
const MIN_STEP: Duration = Duration::from_millis(10);

/// Longest step (chosen).
const MAX_STEP: Duration = Duration::from_secs(1);

/// Minimum timer delay of a suspension (chosen): a busy machine delays a timer less. The delay must also exceed one
/// step.
const MIN_SUSPENSION: Duration = Duration::from_millis(100);

/// Limit on the running time of one future, or of several futures one after another. Suspensions of the process do not
/// count.
#[derive(Debug)]
pub(super) struct RunningLimit {
    step: Duration,
    /// Running time left.
    left: Duration,
    /// Total time of the detected suspensions.
    suspended: Duration,
}

impl RunningLimit {
    pub(super) fn new(limit: Duration) -> Self {
        Self { step: (limit / STEPS).clamp(MIN_STEP, MAX_STEP), left: limit, suspended: Duration::ZERO }
    }

    /// Runs a future; `None` if the limit is reached before the future is ready.
    pub(super) async fn run<T>(&mut self, future: impl Future<Output = T>) -> Option<T> {
        let mut future = pin!(future);
        loop {
            // With no time left, a step of zero still reads data that has arrived.
            let step = self.step.min(self.left);
            let started = Instant::now();
            let output = timeout(step, future.as_mut()).await;
            let elapsed = started.elapsed();
            self.left = self.left.saturating_sub(elapsed.min(step));
            let delay = elapsed.saturating_sub(step);
            if delay > self.step.max(MIN_SUSPENSION) {
                self.suspended += delay;
                // One more step reads data that arrived during the suspension.
                self.left = self.left.max(self.step);
            }
            match output {
                Ok(output) => return Some(output),
                Err(_) if self.left.is_zero() => return None,
                Err(_) => {}
            }
        }
    }

    /// Total time of the detected suspensions of the process.
    pub(super) fn suspended(&self) -> Duration {
        self.suspended
    }
}

/// Sleeps for a running time; suspensions of the process do not count.
pub async fn sleep_running(time: Duration) {
    let _ = RunningLimit::new(time).run(std::future::pending::<()>()).await;
}

#[cfg(test)]
mod tests {
    use std::future::pending;
    use std::thread;

    use tokio::time::sleep;

    use super::*;

    #[test]
    fn permanent_causes_have_a_remedy() {
        for (text, is_plain, remedy) in [
            ("invalid peer certificate: UnknownIssuer", false, "--ca-file"),
            ("invalid peer certificate: Other(OtherError(CaUsedAsEndEntity))", false, "CA:FALSE"),
            ("invalid peer certificate: certificate expired: x", false, "clock"),
            ("client error (Connect): proxy authorization required", false, "HTTPS_PROXY"),
            ("received corrupt message of type InvalidContentType", false, "http:// in --base-url"),
            (
                "tunnel error: failed to create underlying connection: received corrupt message of type InvalidContentType",
                false,
                "the proxy speaks plain http",
            ),
            ("client error: invalid HTTP version parsed", true, "https://"),
        ] {
            let cause = permanent_cause(text, is_plain).unwrap();
            assert!(cause.contains(remedy), "{text}: {cause}");
        }
        for text in ["tcp connect error: Connection refused", "connection reset by peer"] {
            assert_eq!(permanent_cause(text, false), None);
            assert_eq!(permanent_cause(text, true), None);
        }
    }

    #[test]
    fn a_dns_outage_is_not_an_unknown_host() {
        let lookup = "dns error: failed to lookup address information: ";
        assert!(is_unknown_host(&format!("{lookup}Name or service not known")));
        assert!(!is_unknown_host(&format!("{lookup}Temporary failure in name resolution")));
    }

    #[cfg(unix)]
    #[test]
    fn too_many_open_files_are_found_among_causes() {
        #[derive(Debug, thiserror::Error)]
        #[error("outer")]
        struct Outer(#[source] io::Error);
        assert!(lacks_open_files(&Outer(io::Error::from_raw_os_error(24))));
        assert!(!lacks_open_files(&Outer(io::Error::from_raw_os_error(111))));
        assert!(!lacks_open_files(&Outer(io::Error::other("Too many open files"))));
    }

    const LIMIT: Duration = Duration::from_millis(400);

    /// Length of a simulated suspension: the only thread of the test runtime sleeps.
    const SUSPENSION: Duration = Duration::from_millis(900);

    #[tokio::test(start_paused = true)]
    async fn limit_is_exact_without_suspension() {
        for limit in [1, 7, 400, 120_000].map(Duration::from_millis) {
            let started = Instant::now();
            assert!(RunningLimit::new(limit).run(pending::<()>()).await.is_none());
            let took = started.elapsed();
            assert!(took >= limit && took < limit + MIN_STEP, "{took:?}");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn futures_share_the_limit() {
        let mut limit = RunningLimit::new(LIMIT);
        assert!(limit.run(sleep(LIMIT * 3 / 4)).await.is_some());
        assert!(limit.run(sleep(LIMIT / 2)).await.is_none());
        assert_eq!(limit.suspended(), Duration::ZERO);
    }

    /// Each future represents one chunk of a streamed reply.
    #[tokio::test(start_paused = true)]
    async fn short_futures_do_not_outlast_the_limit() {
        let mut limit = RunningLimit::new(LIMIT);
        let interval = Duration::from_millis(5);
        let mut chunks = 0;
        while limit.run(sleep(interval)).await.is_some() {
            chunks += 1;
            assert!(chunks <= LIMIT.as_millis() / interval.as_millis(), "{chunks}");
        }
        assert!(limit.run(async {}).await.is_some(), "data that has arrived is read");
    }

    #[tokio::test]
    async fn suspension_does_not_count() {
        let mut limit = RunningLimit::new(LIMIT);
        let done = limit.run(async {
            sleep(LIMIT / 4).await;
            thread::sleep(SUSPENSION);
            sleep(LIMIT / 4).await;
        });
        assert!(done.await.is_some());
        assert!(limit.suspended() > SUSPENSION / 2, "{:?}", limit.suspended());
    }

    #[tokio::test]
    async fn late_output_is_read_after_suspension() {
        // The suspension is in the last step. The future is ready some polls later, like a socket that another task
        // reads.
        let mut limit = RunningLimit::new(LIMIT);
        limit.left = MIN_STEP;
        let suspension = tokio::spawn(async { thread::sleep(SUSPENSION) });
        let ready = async {
            suspension.await.unwrap();
            for _ in 0..5 {
                tokio::task::yield_now().await;
            }
        };
        assert!(limit.run(ready).await.is_some());
    }
}
