//! Client of OpenAI's Files and Batch APIs: [`BatchServer`].
//!
//! Each call is sent once. The caller decides whether to repeat it, because a failed call may have had an effect at the
//! server.
//!
//! Files and batches as a server describes them: [`RemoteFile`], [`RemoteBatch`].
//!
//! Body of an upload: [`FileForm`], a multipart form with a file that is read while it is sent.
//!
//! Removal of keys from a downloaded file: [`remove_secrets`].

use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, BufWriter, Read as _, Write as _};
use std::path::Path;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::{Duration, SystemTime};

use bytes::Bytes;
use hyper::body::{Body, Frame, SizeHint};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use reqwest::header::{CONTENT_TYPE, HeaderMap};
use reqwest::{Method, RequestBuilder};
use serde_json::{Value, json};

use super::batch::BatchLine;
use super::bounded_json::parse;
use super::endpoints::{Connection, Deadline, HttpResponse};
use super::failures::{ApiError, AskError, QuotaRefusal};
use super::pace::retry_after;
use super::secrets::Scrub;
use darkqa_base::files::{self, create_new};
use darkqa_base::types::FailureKind;

/// Minimum speed of an upload, in bytes per second, for its time limit; chosen.
const MIN_UPLOAD_SPEED: u64 = 50_000;

/// Maximum number of pages of a list to request; chosen: 10,000 files or batches.
const MAX_PAGES: usize = 100;

/// Result of a call. Callers use only the message, status, wait, effect and quota of the error.
pub type ApiResult<T> = Result<T, AskError>;

/// Client of the Files and Batch APIs of a server.
#[derive(Debug)]
pub struct BatchServer {
    connection: Connection,
    headers: HeaderMap,
    timeout: Duration,
}

/// Parameters of a new batch.
#[derive(Debug, Clone, Copy)]
pub struct NewBatch<'a> {
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
    pub async fn upload(&self, path: &Path, name: &str, purpose: &str) -> ApiResult<RemoteFile> {
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
    pub async fn file(&self, id: &str) -> ApiResult<RemoteFile> {
        let request = self.request(Method::GET, &format!("files/{}", path_segment(id)), &[]);
        let object = self.request_json(request).await?;
        RemoteFile::from_json(&object).ok_or_else(|| self.unreadable("a file without an id"))
    }

    /// Lists all files of a purpose.
    pub async fn files(&self, purpose: &str) -> ApiResult<Vec<RemoteFile>> {
        let items = self.list("files", &[("purpose", purpose)]).await?;
        Ok(items.iter().filter_map(RemoteFile::from_json).collect())
    }

    /// Downloads a file of at most `max_bytes` bytes to a path, and removes keys that the server repeats in it.
    pub async fn download(&self, id: &str, to: &Path, max_bytes: u64) -> ApiResult<()> {
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
    pub fn line(&self, line: &str) -> Option<BatchLine> {
        BatchLine::read_without_secrets(line, &self.connection.scrub())
    }

    /// Deletes a file.
    pub async fn delete(&self, id: &str) -> ApiResult<()> {
        let request = self.request(Method::DELETE, &format!("files/{}", path_segment(id)), &[]);
        self.send(request).await.map(drop)
    }

    /// Creates a batch.
    pub async fn create(&self, new: NewBatch<'_>) -> ApiResult<RemoteBatch> {
        let body = json!({
            "input_file_id": new.file, "endpoint": new.url, "completion_window": new.window,
            "metadata": { MARK: new.mark },
        });
        let request =
            self.request(Method::POST, "batches", &[]).header(CONTENT_TYPE, "application/json").body(body.to_string());
        self.request_batch(request).await
    }

    /// Requests the batch with this id.
    pub async fn batch(&self, id: &str) -> ApiResult<RemoteBatch> {
        let path = format!("batches/{}", path_segment(id));
        self.request_batch(self.request(Method::GET, &path, &[])).await
    }

    /// Lists all batches.
    pub async fn batches(&self) -> ApiResult<Vec<RemoteBatch>> {
        let items = self.list("batches", &[]).await?;
        let scrub = self.connection.scrub();
        Ok(items.iter().filter_map(|item| RemoteBatch::from_json(item, &scrub)).collect())
    }

    /// Asks the server to cancel a batch.
    pub async fn cancel(&self, id: &str) -> ApiResult<()> {
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

/// A file at a server.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RemoteFile {
    /// Id of the file at the server.
    pub id: String,
    /// Name under which it was uploaded; empty if the server does not report it.
    pub name: String,
    /// Size in bytes; `None` if the server does not report it.
    pub bytes: Option<u64>,
    /// Whether a batch can be created from it.
    pub readiness: Readiness,
}

/// Whether a batch can be created from a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Readiness {
    /// A batch can be created.
    Ready,
    /// The server is still processing the file, as Azure does after an upload.
    Pending,
    /// The server could not read the file.
    Refused,
}

impl RemoteFile {
    /// Parses a file object; `None` if it has no id.
    fn from_json(object: &Value) -> Option<Self> {
        let status = object.get("status").and_then(Value::as_str);
        let readiness = match status.unwrap_or_default().to_lowercase().as_str() {
            "pending" | "running" | "uploading" | "processing" => Readiness::Pending,
            "error" | "failed" => Readiness::Refused,
            _ => Readiness::Ready,
        };
        Some(Self {
            id: object.get("id")?.as_str()?.to_owned(),
            name: text(object, "filename").unwrap_or_default(),
            bytes: object.get("bytes").and_then(Value::as_u64),
            readiness,
        })
    }
}

/// State of a batch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BatchState {
    /// The server is working on it; with the server's name of the state.
    Working(String),
    /// Completed, with replies to all or some requests.
    Completed,
    /// The server could not start it.
    Failed,
    /// Its completion window has ended; some requests may have replies.
    Expired,
    /// Cancelled; some requests may have replies.
    Cancelled,
    /// An unknown state; the server may still be working on it.
    Unknown(String),
}

impl BatchState {
    /// Parses the name of a state, of OpenAI or of another server, ignoring case.
    fn from_name(word: &str) -> Self {
        match word.to_lowercase().as_str() {
            working @ ("validating" | "queued" | "pending" | "running" | "in_progress" | "finalizing"
            | "cancelling" | "canceling") => Self::Working(working.to_owned()),
            "completed" | "succeeded" => Self::Completed,
            "failed" => Self::Failed,
            "expired" => Self::Expired,
            "cancelled" | "canceled" => Self::Cancelled,
            other => Self::Unknown(Scrub::default().line(other)),
        }
    }

    /// Name of the state.
    pub fn word(&self) -> &str {
        match self {
            Self::Working(word) | Self::Unknown(word) => word,
            Self::Completed => "completed",
            Self::Failed => "failed",
            Self::Expired => "expired",
            Self::Cancelled => "cancelled",
        }
    }
}

/// Numbers of requests in a batch.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RequestCounts {
    /// Requests with a reply.
    pub answered: u64,
    /// Requests with a reply or a failure.
    pub done: u64,
    /// All requests; 0 until the server has counted them.
    pub total: u64,
}

impl RequestCounts {
    /// True if the server reports counts.
    pub fn is_known(self) -> bool {
        self.total > 0 || self.done > 0
    }
}

/// A batch at a server.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RemoteBatch {
    /// Id of the batch at the server.
    pub id: String,
    /// State of the batch.
    pub state: BatchState,
    /// Id of the file of replies; `None` if it does not exist.
    pub output_file: Option<String>,
    /// Id of the file of failed requests; `None` if it does not exist.
    pub error_file: Option<String>,
    /// Numbers of requests.
    pub counts: RequestCounts,
    /// First error of a failed batch, with its line; empty without one.
    pub problem: String,
    /// Refusal because too many tokens are enqueued; `None` if the batch did not fail or failed for another reason.
    pub quota: Option<QuotaRefusal>,
    /// Mark of the program in the metadata; empty if it has none.
    pub mark: String,
}

impl RemoteBatch {
    /// Parses a batch object; `None` if it has no id or no state.
    fn from_json(object: &Value, scrub: &Scrub) -> Option<Self> {
        let errors = object
            .get("errors")
            .and_then(|errors| errors.get("data").unwrap_or(errors).as_array())
            .map_or(&[][..], Vec::as_slice);
        let counts = object.get("request_counts");
        let mark = object.get("metadata").and_then(|data| text(data, MARK));
        Some(Self {
            id: text(object, "id")?,
            state: BatchState::from_name(&scrub.line(&text(object, "status")?)),
            output_file: text(object, "output_file_id"),
            error_file: text(object, "error_file_id"),
            counts: RequestCounts {
                answered: count(counts, "completed"),
                done: count(counts, "completed").saturating_add(count(counts, "failed")),
                total: count(counts, "total"),
            },
            problem: errors.first().map_or_else(String::new, |e| problem(e, scrub)),
            quota: errors.iter().find_map(|error| {
                let api_error = ApiError::from_error(error);
                QuotaRefusal::from_api_error(&api_error, scrub)
            }),
            mark: mark.unwrap_or_default(),
        })
    }
}

/// Number of requests by its name in `request_counts`; 0 if absent.
fn count(counts: Option<&Value>, name: &str) -> u64 {
    counts.and_then(|counts| counts.get(name)?.as_u64()).unwrap_or(0)
}

/// Field of a batch's metadata with the mark of the program.
const MARK: &str = "darkqa";

/// Message of a batch error, with the line number in the input file.
fn problem(error: &Value, scrub: &Scrub) -> String {
    let api_error = ApiError::from_error(error);
    let text = scrub.line(&api_error.message);
    let text = match &api_error.code {
        Some(code) => format!("{text} ({})", scrub.line(code)),
        None => text,
    };
    match error.get("line").and_then(Value::as_u64) {
        Some(line) => format!("line {line}: {text}"),
        None => text,
    }
}

/// A non-empty string in a field of an object.
fn text(object: &Value, field: &str) -> Option<String> {
    let text = object.get(field)?.as_str()?;
    (!text.is_empty()).then(|| text.to_owned())
}

/// Number of bytes to read at once; chosen.
const CHUNK: usize = 256 * 1024;

/// A `multipart/form-data` body (RFC 7578) with one text field and one file, which is never in memory as a whole.
pub(super) struct FileForm {
    head: Bytes,
    file: File,
    /// Number of bytes of the file that are not yet sent.
    left: u64,
    tail: Bytes,
}

impl FileForm {
    /// Creates a form with the field `purpose` and the file `file` under this name.
    ///
    /// # Errors
    /// If the file cannot be opened.
    fn open(path: &Path, name: &str, purpose: &str, boundary: &str) -> io::Result<Self> {
        let file = files::open(path)?;
        let field = |name: &str| format!("--{boundary}\r\nContent-Disposition: form-data; name=\"{name}\"");
        let head = format!(
            "{}\r\n\r\n{purpose}\r\n{}; filename=\"{name}\"\r\nContent-Type: application/jsonl\r\n\r\n",
            field("purpose"),
            field("file")
        );
        Ok(Self {
            head: head.into(),
            left: file.metadata()?.len(),
            file,
            tail: format!("\r\n--{boundary}--\r\n").into(),
        })
    }

    /// Reads the next chunk; `None` at the end.
    fn next_chunk(&mut self) -> io::Result<Option<Bytes>> {
        if !self.head.is_empty() {
            return Ok(Some(std::mem::take(&mut self.head)));
        }
        if self.left > 0 {
            let mut chunk = vec![0; CHUNK.min(usize::try_from(self.left).unwrap_or(CHUNK))];
            self.file.read_exact(&mut chunk)?;
            self.left -= chunk.len() as u64;
            return Ok(Some(chunk.into()));
        }
        let tail = std::mem::take(&mut self.tail);
        Ok((!tail.is_empty()).then_some(tail))
    }
}

impl Body for FileForm {
    type Data = Bytes;
    type Error = io::Error;

    fn poll_frame(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, io::Error>>> {
        Poll::Ready(self.next_chunk().map(|chunk| chunk.map(Frame::data)).transpose())
    }

    fn is_end_stream(&self) -> bool {
        self.tail.is_empty()
    }

    /// The exact size, so that the request has a `Content-Length`.
    fn size_hint(&self) -> SizeHint {
        let head_and_tail = self.head.len() + self.tail.len();
        SizeHint::with_exact(head_and_tail as u64 + self.left)
    }
}

/// Removes keys from the JSON lines of a file. A file without keys is not rewritten.
fn remove_secrets(path: &Path, scrub: &Scrub) -> io::Result<()> {
    if scrub.is_empty() || !has_secrets(path, scrub)? {
        return Ok(());
    }
    let cleaned = path.with_extension("cleaned");
    let mut out = BufWriter::new(create_new(&cleaned)?);
    for_each_line(path, |line| {
        let text = String::from_utf8_lossy(line).into_owned();
        out.write_all(scrub.json_line(text).as_bytes())
    })?;
    out.into_inner()?.sync_all()?;
    fs::rename(&cleaned, path)
}

/// True if a line of the file contains a key.
fn has_secrets(path: &Path, scrub: &Scrub) -> io::Result<bool> {
    let mut found = false;
    for_each_line(path, |line| {
        let text = String::from_utf8_lossy(line).into_owned();
        found = found || scrub.json_line(text.clone()) != text;
        Ok(())
    })?;
    Ok(found)
}

/// Calls `visit` with each line of a file, including its line end.
fn for_each_line(path: &Path, mut visit: impl FnMut(&[u8]) -> io::Result<()>) -> io::Result<()> {
    let mut file = BufReader::new(files::open(path)?);
    let mut line = Vec::new();
    while file.read_until(b'\n', &mut line)? > 0 {
        visit(&line)?;
        line.clear();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn common_ids_are_not_encoded() {
        for (id, segment) in [("batch_6f-0a", "batch_6f-0a"), ("../a?b", "%2E%2E%2Fa%3Fb")] {
            assert_eq!(path_segment(id), segment);
        }
    }

    #[test]
    fn states_are_parsed_in_any_case() {
        for (word, state) in [
            ("in_progress", BatchState::Working("in_progress".into())),
            ("IN_PROGRESS", BatchState::Working("in_progress".into())),
            ("COMPLETED", BatchState::Completed),
            ("canceled", BatchState::Cancelled),
            ("expired", BatchState::Expired),
            ("FAILED", BatchState::Failed),
            ("dreaming", BatchState::Unknown("dreaming".into())),
        ] {
            assert_eq!(BatchState::from_name(word), state, "{word}");
        }
    }

    fn failed_batch(errors: &Value) -> RemoteBatch {
        let object = json!({"id": "b", "status": "failed", "errors": errors});
        RemoteBatch::from_json(&object, &Scrub::default()).unwrap()
    }

    #[test]
    fn a_failed_batch_has_its_line_or_quota() {
        let line = failed_batch(&json!({"object": "list", "data": [
            {"code": "invalid_json_line", "message": "not JSON", "param": null, "line": 7},
        ]}));
        assert_eq!(line.problem, "line 7: not JSON (invalid_json_line)");
        assert_eq!(line.quota, None);
        let full = failed_batch(&json!({"data": [{"code": "token_limit_exceeded", "line": null, "message":
            "Enqueued token limit reached for m in organization o. Limit: 2,000,000 enqueued tokens."}]}));
        let quota = full.quota.unwrap();
        assert_eq!(quota.limit, Some(2_000_000));
        assert_eq!(failed_batch(&Value::Null).quota, None);
    }

    #[test]
    fn the_form_has_an_exact_size() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let content = b"{\"custom_id\":1}\n".repeat(40_000);
        std::fs::write(file.path(), &content).unwrap();
        let mut form = FileForm::open(file.path(), "a.jsonl", "batch", "XX").unwrap();
        let size = form.size_hint().exact().unwrap();
        let (mut sent, mut chunks) = (Vec::new(), 0);
        while let Some(chunk) = form.next_chunk().unwrap() {
            assert!(chunk.len() <= CHUNK);
            sent.extend_from_slice(&chunk);
            chunks += 1;
        }
        assert!(form.is_end_stream());
        assert_eq!(sent.len() as u64, size);
        assert!(chunks > 3, "{chunks}");
        let text = String::from_utf8(sent).unwrap();
        let start = "--XX\r\nContent-Disposition: form-data; name=\"purpose\"\r\n\r\nbatch\r\n--XX\r\n";
        assert!(text.starts_with(start), "{}", &text[..200]);
        assert!(text.ends_with("\n\r\n--XX--\r\n"));
        assert!(text.contains("filename=\"a.jsonl\""));
    }

    fn rewritten(path: &Path, scrub: &Scrub, before: &[u8]) -> Vec<u8> {
        fs::write(path, before).unwrap();
        remove_secrets(path, scrub).unwrap();
        fs::read(path).unwrap()
    }

    #[test]
    fn only_keys_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("part.download");
        let scrub = Scrub::new(["sk-0123456789abcdef".to_owned()]);
        assert_eq!(
            rewritten(&path, &scrub, b"{\"a\": 1}\r\n\n{\"key\": \"sk-0123456789abcdef\"}"),
            b"{\"a\": 1}\r\n\n{\"key\": \"[secret]\"}"
        );
        // Parts of a key within one string are removed, but not across strings or in ids.
        assert_eq!(
            rewritten(
                &path,
                &scrub,
                br#"{"custom_id": "abc0123456789abcdef", "b": ["0123", "4567"], "c": "\u0030123 4567 89a"}"#
            ),
            br#"{"custom_id": "abc0123456789abcdef", "b": ["0123", "4567"], "c": "[secret]"}"#
        );
        let other = b"sk-01234\xff\n\n";
        assert_eq!(rewritten(&path, &scrub, other), other);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
