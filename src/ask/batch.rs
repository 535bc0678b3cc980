//! Lines of Batch API files: [`Model::batch_line`](super::Model::batch_line) writes input lines, [`BatchLine`] reads
//! output lines.
//!
//! Properties of a vendor's Batch API: [`BatchInterface`].

use std::num::{NonZeroU64, NonZeroUsize};

use serde_json::Value;

use super::bounded_json::parse;
use super::endpoints::BaseUrl;
use super::failures::{ApiError, Refusal, ReplyError, implied_status, is_moderated, is_out_of_tokens};
use super::requests::Constrain;
use super::secrets::{Scrub, without_secrets};
use super::vendors::{BatchForm, Vendor, VendorBatch};
use super::wire::{batch_reply, body_usage};
use crate::requests::field::constrained_letter;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{Failure, FailureKind, LostAttempts, Reply, Usage};

/// Writes a line of an input file, with a line end: `{"custom_id", "method", "url", "body"}`, with the body of a single
/// request.
pub(super) fn input_line(id: &str, url: &str, body: &[u8]) -> Result<Vec<u8>, serde_json::Error> {
    let (id, url) = (serde_json::to_string(id)?, serde_json::to_string(url)?);
    let head = format!("{{\"custom_id\":{id},\"method\":\"POST\",\"url\":{url},\"body\":");
    Ok([head.as_bytes(), body, b"}\n"].concat())
}

/// One line of an output or error file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BatchLine {
    /// Id of the request, from the input line.
    pub id: String,
    /// The reply or the failure.
    pub result: Result<Reply, Failure>,
    /// Status and body of a refused request; `None` for a reply and for other failures. They are only classified and
    /// not stored, so secrets are not removed.
    pub refusal: Option<(u16, String)>,
    /// Tokens charged for a failure; `None` for a reply, or if the server does not report them.
    pub charged: Option<Usage>,
}

impl BatchLine {
    /// Parses a line of the user's own file; `None` if it has another form, as input files and the results of other
    /// interfaces have. No key is known without a server, so no secret is removed. For lines from a server use
    /// [`BatchServer::line`](super::batch_api::BatchServer::line).
    #[must_use]
    pub fn read(line: &str) -> Option<Self> {
        let line = parse(line.trim_start_matches('\u{feff}')).ok()?;
        let has_result = ["response", "error"].iter().any(|field| line.get(field).is_some());
        has_result.then(|| Self::from_json(&line, &Scrub::default())).flatten()
    }

    /// Parses a line, and removes secrets from the reply or the failure; `None` if the line has another form.
    pub(super) fn read_without_secrets(line: &str, scrub: &Scrub) -> Option<Self> {
        Self::from_json(&parse(line).ok()?, scrub)
    }

    fn from_json(line: &Value, scrub: &Scrub) -> Option<Self> {
        let id = line.get("custom_id")?.as_str()?.to_owned();
        let result = result(line, scrub).map(|reply| without_secrets(reply, scrub));
        let is_failure = result.is_err();
        let charged = match line.get("response").and_then(|response| response.get("body")) {
            Some(body) if result.is_err() => body_usage(&body_text(body)),
            _ => None,
        };
        Some(Self { id, charged, result, refusal: refusal(line).filter(|_| is_failure) })
    }
}

/// Status and body of a request that was refused with a 4xx status.
fn refusal(line: &Value) -> Option<(u16, String)> {
    let response = line.get("response")?;
    let status = response.get("status_code")?.as_u64()?;
    let status = u16::try_from(status).ok()?;
    let is_refused = (400..500).contains(&status);
    is_refused.then_some((status, body_text(response.get("body")?)))
}

/// True for an error without content: some servers add one to every reply.
fn is_empty(error: &Value) -> bool {
    match error {
        Value::Null | Value::Bool(false) => true,
        Value::String(text) => text.is_empty(),
        Value::Array(items) => items.is_empty(),
        Value::Object(fields) => fields.is_empty(),
        Value::Bool(true) | Value::Number(_) => false,
    }
}

/// A body as JSON text. Some servers write the body of a failed request as a string, not as an object.
fn body_text(body: &Value) -> String {
    body.as_str().map_or_else(|| body.to_string(), str::to_owned)
}

/// The reply or the failure in a line.
fn result(line: &Value, scrub: &Scrub) -> Result<Reply, Failure> {
    let response = line.get("response").filter(|response| !response.is_null());
    let status = response.and_then(|response| u16::try_from(response.get("status_code")?.as_u64()?).ok());
    let error = line.get("error").filter(|error| !is_empty(error));
    let refused = |status: u16, api_error: &ApiError, usage: Option<Usage>| {
        let words = scrub.line(&api_error.message);
        let code = api_error.code.as_deref().map(|code| scrub.line(code));
        let mut lost = LostAttempts::default();
        if is_out_of_tokens(status, api_error) {
            return Some(Reply::empty_truncated(usage));
        }
        lost.add(usage);
        is_moderated(status, api_error).then(|| Refusal::new(status, code.as_deref(), words).into_reply(1, lost))
    };
    let fail = |kind, text: &str| {
        let text = scrub.line(text);
        Err(Failure {
            kind,
            status: status.filter(|status| (100..1000).contains(status)),
            message: format!("the batch says: {text}"),
        })
    };
    if let Some(error) = error {
        let api_error = ApiError::from_error(error);
        let kind = if api_error.has_code(&["batch_expired", "batch_cancelled"]) {
            FailureKind::Timeout
        } else {
            FailureKind::Request
        };
        if let Some(reply) = refused(status.unwrap_or(400), &api_error, None) {
            return Ok(reply);
        }
        let code = api_error.code.unwrap_or_default();
        return fail(kind, format!("{code} {}", api_error.message).trim());
    }
    let Some(body) = response.and_then(|response| response.get("body")) else {
        return fail(FailureKind::Response, "a line with neither a response nor an error");
    };
    let text = body_text(body);
    match status {
        None | Some(200..300) => batch_reply(&text).or_else(|error| match error {
            ReplyError::Api(api_error) => refused(implied_status(&api_error), &api_error, body_usage(&text))
                .map_or_else(|| fail(FailureKind::Server, &api_error.message), Ok),
            ReplyError::Unreadable(unreadable) => fail(FailureKind::Response, &unreadable.description),
        }),
        Some(code) => {
            let api_error = ApiError::from_body(&text);
            if let Some(reply) = refused(code, &api_error, body_usage(&text)) {
                return Ok(reply);
            }
            let kind = match code {
                429 => FailureKind::RateLimit,
                // Some servers write 0 if they could not forward the request.
                0 | 500.. => FailureKind::Server,
                _ => FailureKind::Request,
            };
            fail(kind, &format!("{code} {}", api_error.message))
        }
    }
}

/// Replaces the text of a constrained reply by its letter, if it has one.
#[must_use]
pub fn with_letter(reply: Reply, constrain: Constrain, choices: usize) -> Reply {
    Reply {
        text: constrained_letter(constrain, choices, &reply.text).unwrap_or(reply.text),
        finish: reply.finish.shorten(),
        ..reply
    }
}

/// Properties of the Batch API at an address; those of OpenAI if the address is not in the table of vendors.
#[derive(Debug, Clone, Copy)]
pub struct BatchInterface {
    vendor: Option<&'static Vendor>,
}

/// Limits of OpenAI and Azure per file: 200 MB and 50,000 requests.
const MAX_FILE_SIZE: NonZeroU64 = NonZeroU64::new(200).unwrap();
const MAX_REQUESTS: NonZeroUsize = NonZeroUsize::new(50_000).unwrap();

/// Purpose of OpenAI's input files.
const PURPOSE: &str = "batch";

impl BatchInterface {
    /// Looks up the Batch API at a base URL.
    pub fn at(base: &str) -> Self {
        let base = base.parse::<BaseUrl>().ok();
        let vendor = base.and_then(|base| Vendor::at_host(base.host()));
        Self { vendor }
    }

    /// Entry in the table of vendors.
    fn entry(self) -> Option<&'static VendorBatch> {
        self.vendor?.batch.as_ref()
    }

    /// Purpose under which files are uploaded.
    pub fn purpose(self) -> &'static str {
        self.entry().and_then(|entry| entry.purpose.as_deref()).unwrap_or(PURPOSE)
    }

    /// Maximum size of a file, in MB.
    pub fn file_size(self) -> NonZeroU64 {
        self.entry().and_then(|entry| entry.file_size).unwrap_or(MAX_FILE_SIZE)
    }

    /// Maximum number of requests in a file.
    pub fn requests(self) -> NonZeroUsize {
        self.entry().and_then(|entry| entry.requests).unwrap_or(MAX_REQUESTS)
    }

    /// Path in the lines of a file, for requests with OpenAI's path `default`. Some vendors have another path for chat
    /// completions.
    pub fn url(self, default: &str) -> &str {
        if !default.ends_with("/chat/completions") {
            return default;
        }
        self.entry().and_then(|entry| entry.url.as_deref()).unwrap_or(default)
    }

    /// Checks that batches can be submitted as files.
    ///
    /// # Errors
    /// If the vendor has no Batch API, or one of another form.
    pub fn require_files(self) -> Result<()> {
        let name = self.vendor.map_or("", |vendor| &*vendor.name);
        let form = self.entry().map_or(BatchForm::Files, |entry| entry.form);
        let problem = match form {
            BatchForm::Files => return Ok(()),
            BatchForm::Other => format!(
                "the Batch API of {name} has another form than OpenAI's, which batch run knows; ask directly, or convert the files of \
                 batch export"
            ),
            BatchForm::None => format!("{name} has no Batch API; ask directly, without batch run"),
        };
        Err(Error::usage("--base-url", problem))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::Finish;

    /// A known key is removed from every recorded text; an unknown one is not.
    #[test]
    fn keys_are_removed_from_replies_and_failures() {
        const KEY: &str = "sk-0123456789abcdef";
        let scrub = Scrub::new([KEY.to_owned()]);
        let choice = r#"{"message":{"content":"B, KEY","refusal":"no KEY"},"finish_reason":"KEY is over"}"#;
        let answered = format!(
            r#"{{"custom_id":"k","response":{{"status_code":200,"body":{{"model":"m-KEY","choices":[{choice}]}}}}}}"#
        );
        let lines = [
            answered.as_str(),
            r#"{"custom_id":"k","response":{"status_code":401,"body":{"error":{"message":"no such key: KEY"}}}}"#,
            r#"{"custom_id":"k","error":{"code":"bad","message":"KEY"}}"#,
            r#"{"custom_id":"k","response":{"status_code":200,"body":{"error":{"message":"KEY"}}}}"#,
        ];
        for line in lines {
            let line = line.replace("KEY", KEY);
            let read = BatchLine::read_without_secrets(&line, &scrub).unwrap();
            let kept = format!("{:?}", read.result);
            assert!(kept.contains("[secret]") && !kept.contains("sk-"), "{kept}");
            let unknown = BatchLine::read(&line).unwrap();
            assert!(format!("{:?}", unknown.result).contains(KEY));
        }
    }

    fn read_line(line: &str) -> BatchLine {
        BatchLine::read(line).unwrap()
    }

    #[test]
    fn lines_with_replies_and_failures_are_read() {
        let answered = read_line(
            r#"{"id":"batch_req_1","custom_id":"k","response":{"status_code":200,"request_id":"r","body":{"choices":[{"message":{"content":"B"},"finish_reason":"stop"}],"usage":{"prompt_tokens":9}}},"error":null}"#,
        );
        assert_eq!(answered.id, "k");
        let reply = answered.result.unwrap();
        assert_eq!(reply.text, "B");
        assert_eq!(reply.usage.unwrap().prompt_tokens, Some(9));
        for empty in ["{}", "\"\"", "false", "[]"] {
            let line = format!(
                r#"{{"custom_id":"k","response":{{"status_code":200,"body":{{"choices":[{{"message":{{"content":"B"}},"finish_reason":"stop"}}]}}}},"error":{empty}}}"#
            );
            assert_eq!(read_line(&line).result.unwrap().text, "B", "{empty}");
        }
        for (line, kind, message) in [
            (
                r#"{"custom_id":"k","response":null,"error":{"code":"batch_expired","message":"This request could not be executed before the completion window expired."}}"#,
                FailureKind::Timeout,
                "batch_expired This request",
            ),
            (
                r#"{"custom_id":"k","response":{"status_code":400,"body":{"error":{"message":"bad image"}}},"error":null}"#,
                FailureKind::Request,
                "400 bad image",
            ),
            (
                r#"{"custom_id":"k","response":{"status_code":429,"body":"slow \u001b[31mdown"}}"#,
                FailureKind::RateLimit,
                "429 slow [31mdown",
            ),
            (
                r#"{"custom_id":"k","response":{"status_code":200,"body":{"choices":[]}}}"#,
                FailureKind::Response,
                "no choices",
            ),
            (r#"{"custom_id":"k","response":null}"#, FailureKind::Response, "neither"),
        ] {
            let failure = read_line(line).result.unwrap_err();
            assert_eq!(failure.kind, kind, "{line}");
            assert!(failure.message.contains(message), "{}", failure.message);
        }
        for wrong in ["", "{}", r#"{"custom_id":7,"error":null}"#, "[1]"] {
            assert_eq!(BatchLine::read(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn refused_content_is_a_reply() {
        for line in [
            r#"{"custom_id":"k","response":{"status_code":400,"body":{"error":{"code":"content_filter","message":"filtered"}}}}"#,
            r#"{"custom_id":"k","response":{"status_code":403,"body":{"error":"Content violates usage guidelines."}}}"#,
            r#"{"custom_id":"k","response":{"status_code":200,"body":{"choices":null,"base_resp":{"status_code":1026,"status_msg":"input new_sensitive"}}}}"#,
            r#"{"custom_id":"k","error":{"code":"content_policy_violation","message":"no"}}"#,
        ] {
            let line = read_line(line);
            let reply = line.result.unwrap();
            assert_eq!((&*reply.text, &reply.finish), ("", &Finish::Filter));
            assert!(reply.refusal.is_some() && line.refusal.is_none());
        }
        let cut = read_line(
            r#"{"custom_id":"k","response":{"status_code":400,"body":{"error":{"message":"Could not finish the message because max_tokens or model output limit was reached."}}}}"#,
        );
        assert_eq!(cut.result.unwrap().finish, Finish::Length);
        let doubtful = read_line(
            r#"{"custom_id":"k","response":{"status_code":200,"body":{"choices":[{"message":{"content":""},"finish_reason":"zeitgeist"}]}}}"#,
        );
        assert!(doubtful.result.unwrap().may_heal);
    }

    #[test]
    fn lines_of_other_files_are_refused() {
        for wrong in [
            r#"{"custom_id":"k","method":"POST","url":"/v1/chat/completions","body":{}}"#,
            r#"{"custom_id":"k","result":{"type":"succeeded"}}"#,
        ] {
            assert_eq!(BatchLine::read(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn byte_order_mark_of_a_line_is_ignored() {
        let line = "\u{feff}{\"custom_id\":\"k\",\"error\":{\"message\":\"late\"}}";
        assert_eq!(read_line(line).id, "k");
    }

    #[test]
    fn invalid_json_is_repaired() {
        let line = r#"{"custom_id":"k","response":{"status_code":200,"body":{"choices":[{"message":{"content":"B \ud83d"},"finish_reason":"stop","logprobs":{"content":[{"token":"B","logprob":NaN}]}}]}}}"#;
        assert_eq!(read_line(line).result.unwrap().text, "B \u{FFFD}");
    }

    #[test]
    fn the_address_decides_the_batch_api() {
        let together = BatchInterface::at("https://api.together.xyz/v1");
        assert_eq!((together.purpose(), together.file_size().get()), ("batch-api", 100));
        let unknown = BatchInterface::at("http://127.0.0.1:8000/v1");
        assert_eq!((unknown.purpose(), unknown.file_size().get()), ("batch", 200));
        assert_eq!(unknown.requests().get(), 50_000);
        let azure = BatchInterface::at("https://r.openai.azure.com/openai/v1");
        assert_eq!(azure.url("/v1/chat/completions"), "/chat/completions");
        assert_eq!(azure.url("/v1/responses"), "/v1/responses");
        assert_eq!(unknown.url("/v1/chat/completions"), "/v1/chat/completions");
    }

    #[test]
    fn other_batch_apis_are_refused() {
        for (base, expected) in [
            ("https://api.anthropic.com/v1", "Anthropic has another form"),
            ("https://api.mistral.ai/v1", "Mistral has another form"),
            ("https://api.deepseek.com", "DeepSeek has no Batch API"),
        ] {
            let error = BatchInterface::at(base).require_files().unwrap_err();
            assert!(error.to_string().contains(expected), "{error}");
        }
        for base in [
            "https://api.openai.com/v1",
            "https://api.groq.com/openai/v1",
            "https://api.together.xyz/v1",
            "http://127.0.0.1:8000/v1",
            "https://gateway.example/v1",
        ] {
            assert!(BatchInterface::at(base).require_files().is_ok(), "{base}");
        }
    }
}
