//! Errors in the responses of servers, in all known JSON shapes: [`ApiError`].

use std::time::Duration;

use serde_json::Value;

use super::structured_error::find_error;
use crate::ask::pace::{protobuf_duration, wait_in_words};
use crate::ask::replies::bounded_json::{parse, parse_start};
use crate::types::Usage;

/// Error that a server reports in a response. Secrets are not yet removed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(in crate::ask) struct ApiError {
    /// Error text of the server.
    pub(in crate::ask) message: String,
    /// Kind of error, such as `invalid_request_error` or `insufficient_quota`.
    pub(super) kind: Option<String>,
    /// Error code, such as `model_not_found`, or a number as text.
    pub(in crate::ask) code: Option<String>,
    /// Request field that caused the error.
    pub(in crate::ask) param: Option<String>,
    /// True if moderation rejected the content of the request, as opposed to the account.
    pub(super) is_moderated: bool,
    /// Wait stated in the error, in a field or in its text.
    pub(in crate::ask) wait: Option<Duration>,
    /// Ids of the reached limits, such as `GenerateRequestsPerDayPerProject`.
    limits: Vec<String>,
    /// Google's names of the cause, such as `API_KEY_INVALID`.
    reasons: Vec<String>,
}

/// Maximum depth of errors nested in errors: routers embed the error of a server as text.
const MAX_DEPTH: usize = 3;

/// Maximum length of a message, in bytes; chosen: it is searched for many phrases, and its first line is printed.
const MAX_MESSAGE: usize = 64 << 10;

/// Phrases in the text or the id of a limit that resets once a day.
const DAILY: [&str; 6] = ["(rpd)", "(tpd)", "perday", "per day", "per-day", "daily"];

impl ApiError {
    /// Parses the error at the top level of a body: `error` as an object or text, or the flat shapes of vLLM, FastAPI and
    /// problem+json. `None` if the body has no error.
    pub(in crate::ask) fn from_json(body: &Value) -> Option<Self> {
        // Gemini sends a list of one error.
        if let Value::Array(items) = body {
            return items.first().and_then(Self::from_json);
        }
        let found = Self::in_error(body)
            .or_else(|| {
                ["message", "detail", "title"]
                    .iter()
                    .any(|field| body.get(field).is_some_and(is_filled))
                    .then(|| Self::from_error(body))
            })
            .or_else(|| Self::in_structure(body));
        found.map(|found| Self {
            // Hugging Face puts the wait next to the error.
            wait: found.wait.max(stated_wait(body)),
            ..found
        })
    }

    /// Parses the error in the field `error`; flat shapes are ignored.
    pub(in crate::ask) fn in_error(body: &Value) -> Option<Self> {
        body.get("error")
            .filter(|error| is_filled(error))
            .map(Self::from_error)
    }

    /// Parses an error by its structure: an object with an error code and words, under any name.
    pub(in crate::ask) fn in_structure(body: &Value) -> Option<Self> {
        find_error(body).as_ref().map(Self::from_error)
    }

    /// Parses the value of a field `error`.
    pub(in crate::ask) fn from_error(error: &Value) -> Self {
        Self::nested(error, MAX_DEPTH)
    }

    /// Parses an error, and up to `depth` levels of errors nested in its message as an object or as JSON text.
    fn nested(error: &Value, depth: usize) -> Self {
        let outer = Self::flat(error);
        let inner = error
            .get("message")
            .or_else(|| error.get("error"))
            .filter(|_| depth > 0)
            .and_then(|message| match message {
                Value::Object(_) => Some(message.clone()),
                Value::String(text) => embedded_error(text),
                _ => None,
            });
        let Some(inner) = inner else {
            return outer;
        };
        let inner = match inner.get("error").filter(|error| error.is_object()) {
            Some(error) => Self::nested(error, depth - 1),
            None => Self::nested(&inner, depth - 1),
        };
        Self {
            kind: inner.kind.or(outer.kind),
            code: inner.code.or(outer.code),
            param: inner.param.or(outer.param),
            is_moderated: inner.is_moderated || outer.is_moderated,
            wait: inner.wait.max(outer.wait),
            limits: [inner.limits, outer.limits].concat(),
            reasons: [inner.reasons, outer.reasons].concat(),
            message: inner.message,
        }
    }

    /// Parses an error without the errors nested in it.
    fn flat(error: &Value) -> Self {
        let metadata = error.get("metadata");
        let mut message = text(error)
            .or_else(|| {
                ["message", "detail", "error", "title"]
                    .iter()
                    .find_map(|f| text(error.get(f)?))
            })
            .unwrap_or_else(|| error.to_string());
        // OpenRouter adds the text of the provider.
        if let Some(raw) = metadata.and_then(|metadata| text(metadata.get("raw")?)) {
            message = format!("{message}: {raw}");
        }
        let message = truncated(message);
        Self {
            kind: field(error, "type"),
            code: field(error, "code").or_else(|| field(error, "status")),
            param: field(error, "param").or_else(|| error_location(error)),
            is_moderated: metadata.is_some_and(|metadata| {
                metadata.get("reasons").is_some() || metadata.get("flagged_input").is_some()
            }),
            wait: wait_in_words(&message).max(stated_wait(error)),
            limits: quota_ids(error),
            reasons: details(error)
                .filter_map(|detail| text_or_number(detail.get("reason")?))
                .collect(),
            message,
        }
    }

    /// True if the reached limit resets once a day.
    pub(super) fn is_daily(&self) -> bool {
        let message = self.message.to_lowercase();
        self.limits
            .iter()
            .map(|limit| limit.to_lowercase())
            .chain([message])
            .any(|text| DAILY.iter().any(|phrase| text.contains(phrase)))
    }

    /// Parses the body of a refused request: JSON, an HTML page or plain text.
    pub(in crate::ask) fn from_body(body: &str) -> Self {
        let parsed = parse(body).ok();
        parsed
            .as_ref()
            .and_then(Self::from_json)
            .unwrap_or_else(|| Self {
                message: page_title(body).unwrap_or_else(|| truncated(body.trim().to_owned())),
                ..Self::default()
            })
    }

    /// True if the code or the kind is one of these.
    pub(in crate::ask) fn has_code(&self, codes: &[&str]) -> bool {
        [&self.code, &self.kind]
            .into_iter()
            .flatten()
            .any(|code| codes.contains(&code.as_str()))
    }

    /// True if the message contains one of these lower-case phrases, ignoring case.
    pub(in crate::ask) fn mentions_any(&self, phrases: &[&str]) -> bool {
        let message = self.message.to_lowercase();
        phrases.iter().any(|phrase| message.contains(phrase))
    }

    /// Code, kind, causes and message, in lower case.
    pub(super) fn lower_case_texts(&self) -> Vec<String> {
        [&self.code, &self.kind]
            .into_iter()
            .flatten()
            .chain(&self.reasons)
            .chain([&self.message])
            .map(|text| text.to_lowercase())
            .collect()
    }

    /// The error code as an HTTP status; `None` unless it is a number from 400 to 599.
    pub(in crate::ask) fn status(&self) -> Option<u16> {
        let status = self.code.as_ref()?.parse().ok()?;
        (400..600).contains(&status).then_some(status)
    }
}

fn field(error: &Value, name: &str) -> Option<String> {
    error.get(name).and_then(text_or_number)
}

/// Reason why a response with a success status has no reply.
#[derive(Debug, PartialEq, Eq)]
pub(in crate::ask) enum ReplyError {
    /// The body contains an error of the server.
    Api(Box<ApiError>),
    /// The body contains no reply in the form of the API.
    Unreadable(Box<Unreadable>),
}

/// A response body without a usable reply.
#[derive(Debug, Default, PartialEq, Eq)]
pub(in crate::ask) struct Unreadable {
    /// Description of the body, as a phrase that follows "answered with".
    pub(in crate::ask) description: String,
    /// Tokens charged for it; `None` if the server does not report them.
    pub(in crate::ask) usage: Option<Usage>,
    /// Finish reason of the server, if it is unknown or means that the reply is incomplete.
    pub(in crate::ask) finish: Option<String>,
}

impl Unreadable {
    /// A body with this description, without known charges.
    pub(in crate::ask) fn new(description: impl Into<String>) -> Self {
        Self {
            description: description.into(),
            ..Self::default()
        }
    }

    /// The same body with the tokens charged for it.
    pub(in crate::ask) fn with_usage(self, usage: Option<Usage>) -> Self {
        Self { usage, ..self }
    }
}

impl From<Unreadable> for ReplyError {
    fn from(unreadable: Unreadable) -> Self {
        Self::Unreadable(Box::new(unreadable))
    }
}

/// Cuts a message to [`MAX_MESSAGE`].
fn truncated(mut message: String) -> String {
    message.truncate(message.floor_char_boundary(MAX_MESSAGE));
    message
}

/// Describes an HTML page by its title; `None` if the body is not an HTML page.
pub(in crate::ask) fn page_title(body: &str) -> Option<String> {
    // ASCII lower case keeps byte positions.
    let lower = body.trim_start().to_ascii_lowercase();
    let is_page = lower.starts_with("<!doctype html") || lower.starts_with("<html");
    if !is_page {
        return None;
    }
    let title = lower
        .find("<title>")
        .and_then(|start| {
            let from = start + "<title>".len();
            let length = lower[from..].find("</title>")?;
            body.trim_start().get(from..from + length)
        })
        .map_or("", str::trim);
    Some(match title {
        "" => "an HTML page without a title".to_owned(),
        title => format!("an HTML page titled {title:?}"),
    })
}

/// Parses the first JSON object in a text; `None` if there is none or it does not look like an error.
fn embedded_error(text: &str) -> Option<Value> {
    let object = &text[text.find('{')?..];
    let value = parse_start(object).ok()?;
    let is_error = ["error", "message", "detail"]
        .iter()
        .any(|field| value.get(field).is_some());
    is_error.then_some(value)
}

/// Name of the request field that caused the error: the last part of the first `loc` in `detail` or in a list of errors.
fn error_location(error: &Value) -> Option<String> {
    [error.get("detail"), Some(error)]
        .into_iter()
        .flatten()
        .filter_map(Value::as_array)
        .flatten()
        .find_map(|item| text_or_number(item.get("loc")?.as_array()?.last()?))
}

/// Entries of Google's `details`.
fn details(error: &Value) -> impl Iterator<Item = &Value> {
    error
        .get("details")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
}

/// Longest wait in the fields of an error: Google's `retryDelay`, OpenRouter's `retry_after_seconds` and headers, and
/// Hugging Face's `estimated_time`.
fn stated_wait(error: &Value) -> Option<Duration> {
    let metadata = error.get("metadata");
    let header = metadata
        .and_then(|metadata| metadata.get("headers")?.as_object())
        .into_iter()
        .flatten()
        .find(|(name, _)| name.eq_ignore_ascii_case("retry-after"))
        .and_then(|(_, value)| text_or_number(value));
    let field = metadata.and_then(|metadata| text_or_number(metadata.get("retry_after_seconds")?));
    let estimated = error.get("estimated_time").and_then(text_or_number);
    let seconds = [header, field, estimated]
        .into_iter()
        .flatten()
        .filter_map(|seconds| protobuf_duration(&format!("{seconds}s")));
    details(error)
        .filter_map(|detail| protobuf_duration(detail.get("retryDelay")?.as_str()?))
        .chain(seconds)
        .max()
}

/// Ids of the limits in Google's `details`.
fn quota_ids(error: &Value) -> Vec<String> {
    details(error)
        .filter_map(|detail| detail.get("violations")?.as_array())
        .flatten()
        .filter_map(|violation| text_or_number(violation.get("quotaId")?))
        .collect()
}

/// True for a value with content: not null, false or empty.
fn is_filled(value: &Value) -> bool {
    match value {
        Value::Null | Value::Bool(false) => false,
        Value::String(text) => !text.trim().is_empty(),
        Value::Array(items) => !items.is_empty(),
        Value::Object(fields) => !fields.is_empty(),
        Value::Bool(true) | Value::Number(_) => true,
    }
}

/// A string with content, or the joined messages of a list of errors, as FastAPI sends them.
fn text(value: &Value) -> Option<String> {
    match value {
        Value::String(text) if !text.trim().is_empty() => Some(text.clone()),
        Value::Array(items) => {
            let texts: Vec<String> = items
                .iter()
                .filter_map(|item| text(item).or_else(|| text(item.get("msg")?)))
                .collect();
            (!texts.is_empty()).then(|| texts.join("; "))
        }
        _ => None,
    }
}

/// A string or a number, as text.
fn text_or_number(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_every_shape_are_parsed() {
        for (body, message, code) in [
            (
                r#"{"error":{"message":"m","type":"t","code":"c"}}"#,
                "m",
                Some("c"),
            ),
            (r#"{"error":{"message":"m","code":502}}"#, "m", Some("502")),
            (r#"{"error":"m"}"#, "m", None),
            (
                r#"{"object":"error","message":"m","code":400}"#,
                "m",
                Some("400"),
            ),
            (r#"{"detail":"m"}"#, "m", None),
            (
                r#"{"detail":[{"loc":["body"],"msg":"m"},{"msg":"n"}]}"#,
                "m; n",
                None,
            ),
            (
                r#"{"type":"error","error":{"type":"overloaded_error","message":"m"}}"#,
                "m",
                None,
            ),
            (
                r#"{"type":"about:blank","title":"m","status":422}"#,
                "m",
                Some("422"),
            ),
            (
                r#"{"error":{"message":"m","metadata":{"raw":"r"}}}"#,
                "m: r",
                None,
            ),
            (r#"{"error":{"odd":1}}"#, r#"{"odd":1}"#, None),
            (
                "<html><head><TITLE> 413 Too Large </TITLE>é",
                "an HTML page titled \"413 Too Large\"",
                None,
            ),
            ("\n<!DOCTYPE html><p>", "an HTML page without a title", None),
            (" upstream\n", "upstream", None),
            ("", "", None),
        ] {
            let api_error = ApiError::from_body(body);
            assert_eq!(api_error.message, message, "{body}");
            assert_eq!(api_error.code.as_deref(), code, "{body}");
        }
    }

    #[test]
    fn nested_errors_are_parsed() {
        for (body, message, code, param) in [
            (
                r#"[{"error":{"message":"m","code":429}}]"#,
                "m",
                Some("429"),
                None,
            ),
            (
                r#"{"object":"error","message":{"detail":[{"type":"extra_forbidden","loc":["body","max_completion_tokens"],"msg":"Extra inputs are not permitted"}]}}"#,
                "Extra inputs are not permitted",
                None,
                Some("max_completion_tokens"),
            ),
            (
                r#"{"error":{"message":"litellm.BadRequestError: {\"error\":{\"message\":\"deep\",\"param\":\"temperature\"}}","code":"400"}}"#,
                "deep",
                Some("400"),
                Some("temperature"),
            ),
            (
                r#"{"detail":[{"loc":["body","logprobs"],"msg":"m"}]}"#,
                "m",
                None,
                Some("logprobs"),
            ),
            // Five levels: the fourth remains JSON text.
            (
                r#"{"error":{"message":{"message":{"message":{"message":{"message":"x"}}}}}}"#,
                r#"{"message":{"message":"x"}}"#,
                None,
                None,
            ),
            // A JSON object that is not an error remains part of the message.
            (
                r#"{"error":{"message":"use {\"a\": 1}"}}"#,
                r#"use {"a": 1}"#,
                None,
                None,
            ),
        ] {
            let api_error = ApiError::from_body(body);
            assert_eq!(api_error.message, message, "{body}");
            assert_eq!(api_error.code.as_deref(), code, "{body}");
            assert_eq!(api_error.param.as_deref(), param, "{body}");
        }
    }

    fn gemini(id: &str) -> String {
        format!(
            r#"[{{"error":{{"code":429,"message":"You exceeded your current quota.","details":[{{"violations":[{{"quotaId":"{id}"}}]}},{{"@type":"type.googleapis.com/google.rpc.RetryInfo","retryDelay":"45.837906927s"}}]}}}}]"#
        )
    }

    #[test]
    fn waits_and_daily_limits_are_parsed() {
        for (body, seconds, is_daily) in [
            (gemini("GenerateRequestsPerMinutePerProject"), Some(45.837_906_927), false),
            (gemini("GenerateRequestsPerDayPerProject"), Some(45.837_906_927), true),
            (
                r#"{"error":{"message":"m","metadata":{"retry_after_seconds":7,"headers":{"RETRY-AFTER":"9"}}}}"#.to_owned(),
                Some(9.0),
                false,
            ),
            (r#"{"error":"loading","estimated_time":20.5}"#.to_owned(), Some(20.5), false),
            (
                r#"{"error":{"message":"Rate limit reached on requests per day (RPD): Limit 200. Please try again in 7m12s."}}"#.to_owned(),
                Some(432.0),
                true,
            ),
            (r#"{"error":{"message":"slow down"}}"#.to_owned(), None, false),
        ] {
            let api_error = ApiError::from_body(&body);
            let wait = api_error.wait.map(|wait| wait.as_secs_f64());
            assert_eq!(wait, seconds, "{body}");
            assert_eq!(api_error.is_daily(), is_daily, "{body}");
        }
    }

    #[test]
    fn a_body_without_an_error_has_none() {
        for body in [
            r#"{"choices":[],"error":null}"#,
            r#"{"choices":[],"error":""}"#,
            r#"{"error":{},"message":""}"#,
            r"{}",
            r"[]",
        ] {
            assert_eq!(
                ApiError::from_json(&serde_json::from_str(body).unwrap()),
                None,
                "{body}"
            );
        }
    }
}
