//! Client of OpenAI's Files and Batch APIs: [`BatchServer`].
//!
//! Each call is sent once. The caller decides whether to repeat it, because a failed call may have had an effect at the
//! server.

mod download;
mod objects;
mod upload;

use std::path::Path;
use std::time::{Duration, SystemTime};

use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use reqwest::header::{CONTENT_TYPE, HeaderMap};
use reqwest::{Method, RequestBuilder};
use serde_json::{Value, json};

use super::batch::BatchLine;
use super::endpoints::{Connection, Deadline, HttpResponse};
use super::failures::{ApiError, AskError, QuotaRefusal};
use super::pace::retry_after;
use super::replies::bounded_json::parse;
use crate::types::FailureKind;

use download::remove_secrets;
use objects::MARK;
pub(crate) use objects::{BatchState, Readiness, RemoteBatch, RemoteFile};
use upload::FileForm;

/// Minimum speed of an upload, in bytes per second, for its time limit; chosen.
const MIN_UPLOAD_SPEED: u64 = 50_000;

/// Maximum number of pages of a list to request; chosen: 10,000 files or batches.
const MAX_PAGES: usize = 100;

/// Result of a call. Callers use only the message, status, wait, effect and quota of the error.
pub(crate) type ApiResult<T> = Result<T, AskError>;

/// Client of the Files and Batch APIs of a server.
#[derive(Debug)]
pub(crate) struct BatchServer {
    connection: Connection,
    headers: HeaderMap,
    timeout: Duration,
}

/// Parameters of a new batch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NewBatch<'a> {
    /// Id of the input file.
    pub file: &'a str,
    /// Path of the requests, such as `/v1/chat/completions`.
    pub url: &'a str,
    /// Completion window, such as `24h`.
    pub window: &'a str,
    /// Mark in the metadata, by which the program finds the batch again.
    pub mark: &'a str,
}

impl BatchServer {
    /// Creates a client that uses these connections; nothing is sent yet.
    pub(super) fn new(connection: Connection, headers: HeaderMap, timeout: Duration) -> Self {
        Self { connection, headers, timeout }
    }

    /// Uploads a file under a name, for a purpose.
    pub(crate) async fn upload(&self, path: &Path, name: &str, purpose: &str) -> ApiResult<RemoteFile> {
        // The boundary cannot occur in a file of requests: every line is one JSON object.
        let boundary = format!("darkqa-{name}").replace(|c: char| !c.is_ascii_alphanumeric(), "-");
        let boundary: String = boundary.chars().take(70).collect();
        let form = FileForm::open(path, name, purpose, &boundary).map_err(|e| AskError {
            may_have_effect: false,
            ..self.unreadable(&format!("{} could not be read: {e}", path.display()))
        })?;
        let bytes = path.metadata().map_or(0, |file| file.len());
        let content_type = format!("multipart/form-data; boundary={boundary}");
        let request =
            self.request(Method::POST, "files", &[]).header(CONTENT_TYPE, content_type).body(reqwest::Body::wrap(form));
        let timeout = self.timeout + Duration::from_secs(bytes / MIN_UPLOAD_SPEED);
        let response = self.send_within(timeout, request).await?;
        let object = self.parse_json(&response)?;
        RemoteFile::from_json(&object).ok_or_else(|| self.unreadable("a file without an id"))
    }

    /// Requests the file object with this id.
    pub(crate) async fn file(&self, id: &str) -> ApiResult<RemoteFile> {
        let request = self.request(Method::GET, &format!("files/{}", path_segment(id)), &[]);
        let object = self.request_json(request).await?;
        RemoteFile::from_json(&object).ok_or_else(|| self.unreadable("a file without an id"))
    }

    /// Lists all files of a purpose.
    pub(crate) async fn files(&self, purpose: &str) -> ApiResult<Vec<RemoteFile>> {
        let items = self.list("files", &[("purpose", purpose)]).await?;
        Ok(items.iter().filter_map(RemoteFile::from_json).collect())
    }

    /// Downloads a file of at most `max_bytes` bytes to a path, and removes keys that the server repeats in it.
    pub(crate) async fn download(&self, id: &str, to: &Path, max_bytes: u64) -> ApiResult<()> {
        let path = format!("files/{}/content", path_segment(id));
        let request = self.request(Method::GET, &path, &[]);
        let response =
            self.connection.download(request, &self.headers, to, max_bytes).await.map_err(with_possible_effect)?;
        self.check_status(response)?;
        remove_secrets(to, &self.connection.scrub()).map_err(|e| {
            let message = format!("{}: keys in it could not be removed: {e}", to.display());
            AskError::new(FailureKind::Request, message)
        })
    }

    /// Parses a line of an output or error file of this server, and removes the keys sent to the server. `None` if the
    /// line has another form.
    #[must_use]
    pub(crate) fn line(&self, line: &str) -> Option<BatchLine> {
        BatchLine::read_without_secrets(line, &self.connection.scrub())
    }

    /// Deletes a file.
    pub(crate) async fn delete(&self, id: &str) -> ApiResult<()> {
        let request = self.request(Method::DELETE, &format!("files/{}", path_segment(id)), &[]);
        self.send(request).await.map(drop)
    }

    /// Creates a batch.
    pub(crate) async fn create(&self, new: NewBatch<'_>) -> ApiResult<RemoteBatch> {
        let body = json!({
            "input_file_id": new.file, "endpoint": new.url, "completion_window": new.window,
            "metadata": { MARK: new.mark },
        });
        let request =
            self.request(Method::POST, "batches", &[]).header(CONTENT_TYPE, "application/json").body(body.to_string());
        self.request_batch(request).await
    }

    /// Requests the batch with this id.
    pub(crate) async fn batch(&self, id: &str) -> ApiResult<RemoteBatch> {
        let path = format!("batches/{}", path_segment(id));
        self.request_batch(self.request(Method::GET, &path, &[])).await
    }

    /// Lists all batches.
    pub(crate) async fn batches(&self) -> ApiResult<Vec<RemoteBatch>> {
        let items = self.list("batches", &[]).await?;
        let scrub = self.connection.scrub();
        Ok(items.iter().filter_map(|item| RemoteBatch::from_json(item, &scrub)).collect())
    }

    /// Asks the server to cancel a batch.
    pub(crate) async fn cancel(&self, id: &str) -> ApiResult<()> {
        let path = format!("batches/{}/cancel", path_segment(id));
        self.send(self.request(Method::POST, &path, &[])).await.map(drop)
    }

    /// Sends a request whose response is a batch.
    async fn request_batch(&self, request: RequestBuilder) -> ApiResult<RemoteBatch> {
        let object = self.request_json(request).await?;
        RemoteBatch::from_json(&object, &self.connection.scrub())
            .ok_or_else(|| self.unreadable("a batch without id or status"))
    }

    /// Requests all items of a list, page by page.
    async fn list(&self, path: &str, query: &[(&str, &str)]) -> ApiResult<Vec<Value>> {
        let mut items = Vec::new();
        let mut after: Option<String> = None;
        for _ in 0..MAX_PAGES {
            let mut query = query.to_vec();
            query.push(("limit", "100"));
            query.extend(after.as_deref().map(|after| ("after", after)));
            let page = self.request_json(self.request(Method::GET, path, &query)).await?;
            // Together sends the list without an object around it.
            let data = page.get("data").unwrap_or(&page);
            let data = data.as_array().cloned().unwrap_or_default();
            let last = data.last().and_then(|item| item.get("id")?.as_str()).map(str::to_owned);
            items.extend(data);
            let has_more = page.get("has_more").and_then(Value::as_bool) == Some(true);
            match last {
                Some(last) if has_more && after.as_ref() != Some(&last) => after = Some(last),
                _ => break,
            }
        }
        Ok(items)
    }

    /// Builds a request without the headers of the account.
    fn request(&self, method: Method, path: &str, query: &[(&str, &str)]) -> RequestBuilder {
        self.connection.request(method, path, query)
    }

    /// Sends a request whose response is JSON.
    async fn request_json(&self, request: RequestBuilder) -> ApiResult<Value> {
        self.parse_json(&self.send(request).await?)
    }

    fn parse_json(&self, response: &HttpResponse) -> ApiResult<Value> {
        let text = String::from_utf8_lossy(&response.body);
        parse(&text).map_err(|_| self.unreadable("no JSON"))
    }

    /// Sends a request, and checks the status of the response.
    async fn send(&self, request: RequestBuilder) -> ApiResult<HttpResponse> {
        self.send_within(self.timeout, request).await
    }

    /// Sends a request with this timeout, and checks the status of the response.
    async fn send_within(&self, timeout: Duration, request: RequestBuilder) -> ApiResult<HttpResponse> {
        let response = self
            .connection
            .exchange_keyed(request, &self.headers, Deadline::total(timeout))
            .await
            .map_err(with_possible_effect)?;
        self.check_status(response)
    }

    /// Returns the response if it has a success status, otherwise the error in it.
    fn check_status(&self, response: HttpResponse) -> ApiResult<HttpResponse> {
        if response.status.is_success() {
            return Ok(response);
        }
        let status = response.status.as_u16();
        let api_error = ApiError::from_body(&String::from_utf8_lossy(&response.body));
        let (base, scrub) = (&self.connection.base, self.connection.scrub());
        let text = scrub.line(&api_error.message);
        let separator = if text.is_empty() { "" } else { ": " };
        let message = format!("{base} answered {status}{separator}{text}");
        let mut failed = AskError::new(FailureKind::Request, message);
        failed.failure.status = Some(status);
        failed.may_have_effect = status >= 500;
        failed.wait = retry_after(&response.headers, SystemTime::now()).max(api_error.wait);
        failed.quota = QuotaRefusal::from_api_error(&api_error, &scrub).map(Box::new);
        Err(failed)
    }

    /// Error of a call whose response has another form than expected.
    fn unreadable(&self, what: &str) -> AskError {
        let message = format!("{} answered with {what}", self.connection.base);
        AskError::new(FailureKind::Response, message)
    }
}

/// Marks the error of a call without a complete response: the call may have had an effect.
fn with_possible_effect(error: AskError) -> AskError {
    AskError { may_have_effect: true, ..error }
}

/// Characters of an id that a segment of a path cannot carry. Ids such as `batch_1` and `file-1` stay as they are (RFC
/// 3986, section 2.3): some servers compare paths without decoding them.
const ENCODED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'_').remove(b'~');

/// An id, percent-encoded as a segment of a path.
fn path_segment(id: &str) -> String {
    utf8_percent_encode(id, ENCODED).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn common_ids_are_not_encoded() {
        for (id, segment) in [("batch_6f-0a", "batch_6f-0a"), ("../a?b", "%2E%2E%2Fa%3Fb")] {
            assert_eq!(path_segment(id), segment);
        }
    }
}
