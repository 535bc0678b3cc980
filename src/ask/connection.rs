//! The connections to one server: [`Connection::post`] sends one request.

use std::io::Write as _;
use std::path::Path;
use std::time::Duration;

use reqwest::header::{CONTENT_TYPE, HeaderMap};
use reqwest::{Client, Method, RequestBuilder, Response, StatusCode};
use tokio::time::Instant;

use super::access::{Access, with_causes};
use super::body::Parts;
use super::bounded_json::parse;
use super::connection_fault::permanent_cause;
use super::failure::{Again, FailedTry, Reach};
use super::parameters::Parameters;
use super::secret::Scrub;
use super::url::BaseUrl;
use crate::error::Result;
use crate::files;
use crate::types::FailureKind;

/// The maximum size of a decompressed reply, in bytes; chosen. A reply of a few tokens is far smaller, and a server must not
/// fill the memory.
const MAX_REPLY: usize = 16 << 20;

/// The maximum time of a stream, as a multiple of the timeout; chosen: a server that keeps a connection open by comments alone must
/// not hold a run for ever.
const STREAM_TIMEOUTS: u32 = 30;

/// What the timeout of a request limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Deadline {
    /// The whole try, from the first byte sent to the last byte received.
    Whole,
    /// The silence between two pieces of a stream, which may take longer as a whole.
    Silence,
}

/// Pooled connections to a server, and the filter for secrets in its texts.
#[derive(Debug, Clone)]
pub(super) struct Connection {
    pub(super) base: BaseUrl,
    pub(super) scrub: Scrub,
    client: Client,
    timeout: Duration,
}

/// The response to one request.
pub(super) struct HttpReply {
    pub(super) status: StatusCode,
    pub(super) headers: HeaderMap,
    pub(super) body: Vec<u8>,
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
        })
    }

    /// Sends a body to a path below the base URL.
    pub(super) async fn post(
        &self,
        path: &str,
        headers: &HeaderMap,
        body: Parts,
        deadline: Deadline,
    ) -> Result<HttpReply, FailedTry> {
        let request = self
            .client
            .post(self.base.join(path))
            .headers(headers.clone())
            .header(CONTENT_TYPE, "application/json")
            .body(reqwest::Body::wrap(body));
        let request = match deadline {
            Deadline::Whole => request,
            Deadline::Silence => request.timeout(self.timeout * STREAM_TIMEOUTS),
        };
        self.exchange(request, deadline).await
    }

    /// A request to a path below the base URL, with these fields in its query string.
    pub(super) fn request(
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
    pub(super) async fn exchange(
        &self,
        request: RequestBuilder,
        deadline: Deadline,
    ) -> Result<HttpReply, FailedTry> {
        let started = Instant::now();
        let response = self.in_time(deadline, request.send()).await?;
        let status = response.status();
        let headers = response.headers().clone();
        let body = match self.receive(response, deadline).await {
            Err(failed) if status.is_success() => return Err(failed),
            // The status alone says that the request was refused.
            body => body.unwrap_or_default(),
        };
        Ok(HttpReply {
            status,
            headers,
            body,
            took: started.elapsed(),
        })
    }

    /// What the server says of a model: its longest context and the files that it was loaded from, where it says so (vLLM does);
    /// `None` if it cannot be asked.
    pub(super) async fn model_facts(
        &self,
        headers: &HeaderMap,
        parameters: &Parameters,
    ) -> Option<String> {
        let request = self.client.get(self.base.join("models"));
        let request = request.headers(headers.clone());
        let response = request.send().await.ok()?;
        if !response.status().is_success() {
            return None;
        }
        let body = self.receive(response, Deadline::Whole).await.ok()?;
        let list = parse(std::str::from_utf8(&body).ok()?).ok()?;
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
    pub(super) async fn save(
        &self,
        request: RequestBuilder,
        to: &Path,
        most: u64,
    ) -> Result<HttpReply, FailedTry> {
        let started = Instant::now();
        let sent = request.send().await;
        let mut response = sent.map_err(|error| self.failed_try(error))?;
        let (status, headers) = (response.status(), response.headers().clone());
        let body = if status.is_success() {
            let failed = |what: String| FailedTry::new(FailureKind::Response, what);
            let unwritten = |e| failed(format!("{}: cannot write: {e}", to.display()));
            let mut file = files::create_new(to).map_err(unwritten)?;
            let mut written = 0;
            loop {
                let chunk = tokio::time::timeout(self.timeout, response.chunk());
                let chunk = chunk
                    .await
                    .map_err(|_| failed(format!("{} sent no more bytes of a file", self.base)))?;
                let Some(chunk) = chunk.map_err(|error| self.failed_try(error))? else {
                    break;
                };
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
            self.receive(response, Deadline::Whole)
                .await
                .unwrap_or_default()
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
        deadline: Deadline,
    ) -> Result<Vec<u8>, FailedTry> {
        let mut body = Vec::new();
        while let Some(chunk) = self.in_time(deadline, response.chunk()).await? {
            if body.len() + chunk.len() > MAX_REPLY {
                let message = format!("{} answered with more than 16 MiB", self.base);
                return Err(FailedTry::new(FailureKind::Response, message));
            }
            body.extend_from_slice(&chunk);
        }
        Ok(body)
    }

    /// The result of one step of a request, or its failure.
    async fn in_time<T>(
        &self,
        deadline: Deadline,
        step: impl Future<Output = reqwest::Result<T>>,
    ) -> Result<T, FailedTry> {
        let done = match deadline {
            Deadline::Whole => Ok(step.await),
            Deadline::Silence => tokio::time::timeout(self.timeout, step).await,
        };
        if let Ok(done) = done {
            return done.map_err(|error| self.failed_try(error));
        }
        let timeout = self.timeout.as_secs_f64();
        let message = format!(
            "{} sent nothing for {timeout} s; allow more with --timeout",
            self.base
        );
        Err(FailedTry {
            again: Again::Later,
            ..FailedTry::new(FailureKind::Timeout, message)
        })
    }

    /// The failure of a request without a complete response.
    fn failed_try(&self, error: reqwest::Error) -> FailedTry {
        // A request whose connection was not made was not sent.
        let may_be_charged = !error.is_connect();
        if error.is_timeout() {
            let timeout = self.timeout.as_secs_f64();
            let message = format!(
                "{} did not answer within {timeout} s; allow more with --timeout",
                self.base
            );
            return FailedTry {
                again: Again::Later,
                may_be_charged,
                ..FailedTry::new(FailureKind::Timeout, message)
            };
        }
        let text = self.scrub.line(&with_causes(&error.without_url()));
        let Some(remedy) = permanent_cause(&text, self.base.is_plain()) else {
            return FailedTry {
                again: Again::Later,
                may_be_charged,
                ..FailedTry::new(FailureKind::Connection, format!("{}: {text}", self.base))
            };
        };
        let message = format!("{}: {remedy} ({text})", self.base);
        FailedTry {
            reach: Reach::Endpoint,
            ..FailedTry::new(FailureKind::Connection, message)
        }
    }
}
