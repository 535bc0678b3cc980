//! The files and batches of a server, by OpenAI's interface: [`BatchServer`].
//!
//! Each call is sent once. Whether it is repeated is decided by the caller, who knows what may have happened at the server.

mod download;
mod objects;
mod upload;

use std::path::Path;
use std::time::{Duration, SystemTime};

use reqwest::header::{CONTENT_TYPE, HeaderMap};
use reqwest::{Method, RequestBuilder};
use serde_json::{Value, json};

use super::batch::BatchLine;
use super::endpoints::{Connection, Deadline, HttpReply};
use super::failures::{AskError, Complaint, QuotaRefusal};
use super::pace::asked_wait;
use super::replies::bounded_json::parse;
use crate::types::FailureKind;

use download::remove_secrets;
use objects::MARK;
pub(crate) use objects::{BatchState, Readiness, RemoteBatch, RemoteFile};
use upload::FileForm;

/// The slowest upload that is waited for, in bytes per second; chosen.
const SLOWEST: u64 = 50_000;

/// The most pages of a list that are read; chosen: 10,000 files or batches.
const MOST_PAGES: usize = 100;

/// The result of a call. Callers use the message, status, wait, effect and quota of its error alone.
pub(crate) type ApiResult<T> = Result<T, AskError>;

/// A server with files and batches.
#[derive(Debug)]
pub(crate) struct BatchServer {
    connection: Connection,
    headers: HeaderMap,
    timeout: Duration,
}

/// The parts of a new batch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NewBatch<'a> {
    /// The server's name of the input file.
    pub file: &'a str,
    /// The path of the requests, as `/v1/chat/completions`.
    pub url: &'a str,
    /// The time within which the batch is worked on, as `24h`.
    pub window: &'a str,
    /// The mark by which the batch is found again.
    pub mark: &'a str,
}

impl BatchServer {
    /// The server behind these connections; nothing is sent yet.
    pub(super) fn new(connection: Connection, headers: HeaderMap, timeout: Duration) -> Self {
        Self {
            connection,
            headers,
            timeout,
        }
    }

    /// Uploads a file under a name, for a purpose.
    pub(crate) async fn upload(
        &self,
        path: &Path,
        name: &str,
        purpose: &str,
    ) -> ApiResult<RemoteFile> {
        // No line of a file of requests has this text: a line is one JSON object, and the text follows no line end in it.
        let boundary = format!("darkqa-{name}").replace(|c: char| !c.is_ascii_alphanumeric(), "-");
        let boundary: String = boundary.chars().take(70).collect();
        let form = FileForm::open(path, name, purpose, &boundary).map_err(|e| AskError {
            may_have_effect: false,
            ..self.unreadable(&format!("{} could not be read: {e}", path.display()))
        })?;
        let bytes = path.metadata().map_or(0, |file| file.len());
        let kind = format!("multipart/form-data; boundary={boundary}");
        let request = self
            .request(Method::POST, "files", &[])
            .header(CONTENT_TYPE, kind)
            .body(reqwest::Body::wrap(form));
        let time = self.timeout + Duration::from_secs(bytes / SLOWEST);
        let answer = self.send_within(request, time).await?;
        let object = self.read_object(&answer)?;
        RemoteFile::read(&object).ok_or_else(|| self.unreadable("a file without an id"))
    }

    /// The file with this id.
    pub(crate) async fn file(&self, id: &str) -> ApiResult<RemoteFile> {
        let request = self.request(Method::GET, &format!("files/{}", segment(id)), &[]);
        let object = self.object(request).await?;
        RemoteFile::read(&object).ok_or_else(|| self.unreadable("a file without an id"))
    }

    /// All files of a purpose.
    pub(crate) async fn files(&self, purpose: &str) -> ApiResult<Vec<RemoteFile>> {
        let items = self.list("files", &[("purpose", purpose)]).await?;
        Ok(items.iter().filter_map(RemoteFile::read).collect())
    }

    /// Writes the content of a file to a path, at most this number of bytes, without keys that the server repeats in it.
    pub(crate) async fn download(&self, id: &str, to: &Path, most: u64) -> ApiResult<()> {
        let path = format!("files/{}/content", segment(id));
        let request = self.request(Method::GET, &path, &[]);
        let sent = self.connection.save(request, to, most).await;
        let answer = sent.map_err(not_answered)?;
        self.succeeded(answer)?;
        remove_secrets(to, &self.connection.scrub).map_err(|e| {
            let message = format!("{}: keys in it could not be removed: {e}", to.display());
            AskError::new(FailureKind::Request, message)
        })
    }

    /// Reads a line of a file that this server sent; `None` if the line is not one of a file of replies. Keys that are sent to the server
    /// are removed from it.
    #[must_use]
    pub(crate) fn line(&self, line: &str) -> Option<BatchLine> {
        BatchLine::without_secrets(line, &self.connection.scrub)
    }

    /// Deletes a file.
    pub(crate) async fn delete(&self, id: &str) -> ApiResult<()> {
        let request = self.request(Method::DELETE, &format!("files/{}", segment(id)), &[]);
        self.send(request).await.map(drop)
    }

    /// Makes a batch.
    pub(crate) async fn create(&self, new: NewBatch<'_>) -> ApiResult<RemoteBatch> {
        let body = json!({
            "input_file_id": new.file, "endpoint": new.url, "completion_window": new.window,
            "metadata": { MARK: new.mark },
        });
        let request = self
            .request(Method::POST, "batches", &[])
            .header(CONTENT_TYPE, "application/json")
            .body(body.to_string());
        self.read_batch(request).await
    }

    /// The batch with this id.
    pub(crate) async fn batch(&self, id: &str) -> ApiResult<RemoteBatch> {
        let path = format!("batches/{}", segment(id));
        self.read_batch(self.request(Method::GET, &path, &[])).await
    }

    /// All batches.
    pub(crate) async fn batches(&self) -> ApiResult<Vec<RemoteBatch>> {
        let items = self.list("batches", &[]).await?;
        let read = |item| RemoteBatch::read(item, &self.connection.scrub);
        Ok(items.iter().filter_map(read).collect())
    }

    /// Asks the server to cancel a batch.
    pub(crate) async fn cancel(&self, id: &str) -> ApiResult<()> {
        let path = format!("batches/{}/cancel", segment(id));
        self.send(self.request(Method::POST, &path, &[]))
            .await
            .map(drop)
    }

    async fn read_batch(&self, request: RequestBuilder) -> ApiResult<RemoteBatch> {
        let object = self.object(request).await?;
        RemoteBatch::read(&object, &self.connection.scrub)
            .ok_or_else(|| self.unreadable("a batch without id or status"))
    }

    /// All items of a list, page by page.
    async fn list(&self, path: &str, query: &[(&str, &str)]) -> ApiResult<Vec<Value>> {
        let mut items = Vec::new();
        let mut after: Option<String> = None;
        for _ in 0..MOST_PAGES {
            let mut query = query.to_vec();
            query.push(("limit", "100"));
            query.extend(after.as_deref().map(|after| ("after", after)));
            let page = self.object(self.request(Method::GET, path, &query)).await?;
            // Together sends the list alone.
            let data = page.get("data").unwrap_or(&page);
            let data = data.as_array().cloned().unwrap_or_default();
            let last = data.last().and_then(|item| item.get("id")?.as_str());
            let last = last.map(str::to_owned);
            items.extend(data);
            let has_more = page.get("has_more").and_then(Value::as_bool) == Some(true);
            match last {
                Some(last) if has_more && after.as_ref() != Some(&last) => after = Some(last),
                _ => break,
            }
        }
        Ok(items)
    }

    fn request(&self, method: Method, path: &str, query: &[(&str, &str)]) -> RequestBuilder {
        self.connection
            .request(method, path, query)
            .headers(self.headers.clone())
    }

    /// The JSON object in the response to a request.
    async fn object(&self, request: RequestBuilder) -> ApiResult<Value> {
        self.read_object(&self.send(request).await?)
    }

    fn read_object(&self, answer: &HttpReply) -> ApiResult<Value> {
        let text = String::from_utf8_lossy(&answer.body);
        parse(&text).map_err(|_| self.unreadable("no JSON"))
    }

    /// The response to a request that succeeded.
    async fn send(&self, request: RequestBuilder) -> ApiResult<HttpReply> {
        self.send_within(request, self.timeout).await
    }

    /// The response to a request that succeeded within a time.
    async fn send_within(&self, request: RequestBuilder, time: Duration) -> ApiResult<HttpReply> {
        let sent = self.connection.exchange(request, Deadline::whole(time));
        self.succeeded(sent.await.map_err(not_answered)?)
    }

    /// The response itself, if its status states that the call succeeded.
    fn succeeded(&self, answer: HttpReply) -> ApiResult<HttpReply> {
        if answer.status.is_success() {
            return Ok(answer);
        }
        let status = answer.status.as_u16();
        let complaint = Complaint::from_body(&String::from_utf8_lossy(&answer.body));
        let (base, scrub) = (&self.connection.base, &self.connection.scrub);
        let text = scrub.line(&complaint.message);
        let separator = if text.is_empty() { "" } else { ": " };
        let message = format!("{base} answered {status}{separator}{text}");
        let mut failed = AskError::new(FailureKind::Request, message);
        failed.failure.status = Some(status);
        failed.may_have_effect = status >= 500;
        failed.wait = asked_wait(&answer.headers, SystemTime::now()).max(complaint.wait);
        failed.quota = QuotaRefusal::from_complaint(&complaint, scrub).map(Box::new);
        Err(failed)
    }

    /// The failure of a call that the server answered with something else.
    fn unreadable(&self, what: &str) -> AskError {
        let message = format!("{} answered with {what}", self.connection.base);
        AskError::new(FailureKind::Response, message)
    }
}

/// The failure of a call without a complete response.
fn not_answered(failed: AskError) -> AskError {
    AskError {
        may_have_effect: true,
        ..failed
    }
}

/// An id as a segment of a path.
fn segment(id: &str) -> String {
    percent_encoding::utf8_percent_encode(id, percent_encoding::NON_ALPHANUMERIC).to_string()
}
