//! The error in a server's response, in any of the known JSON shapes: [`Complaint`].

use std::time::Duration;

use serde_json::Value;

use crate::ask::pace::{protobuf_duration, wait_in_words};
use crate::ask::replies::bounded_json::{parse, parse_start};
use crate::types::Usage;

/// An error as the server states it; secrets are not yet removed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(in crate::ask) struct Complaint {
    /// The error text of the server.
    pub(in crate::ask) message: String,
    /// The kind of error, as `invalid_request_error` or `insufficient_quota`.
    pub(super) kind: Option<String>,
    /// The error code, as `model_not_found`, or a number as text.
    pub(in crate::ask) code: Option<String>,
    /// The field of the request that the error is about.
    pub(in crate::ask) param: Option<String>,
    /// Whether moderation refused the content of the request, and not the account.
    pub(super) moderated: bool,
    /// The wait that the error states, in a field or in words.
    pub(in crate::ask) wait: Option<Duration>,
    /// Ids of the limits that were reached, as `GenerateRequestsPerDayPerProject`.
    limits: Vec<String>,
    /// Google's words for the cause, as `API_KEY_INVALID`.
    reasons: Vec<String>,
}

/// The number of errors within errors that are opened: routers pass on a server's error as text.
const MOST_NESTED: usize = 3;

/// The longest message that is read, in bytes; chosen: it is searched for many phrases, and its first line is shown.
const LONGEST_MESSAGE: usize = 64 << 10;

/// Words and ids of a limit that resets once a day.
const DAILY: [&str; 6] = ["(rpd)", "(tpd)", "perday", "per day", "per-day", "daily"];

impl Complaint {
    /// The error at the top level of a body, if there is one: `error` as an object or text, or the flat shapes of vLLM, FastAPI
    /// and problem+json.
    pub(in crate::ask) fn from_json(body: &Value) -> Option<Self> {
        // Gemini sends a list with one error.
        if let Value::Array(items) = body {
            return items.first().and_then(Self::from_json);
        }
        let found = Self::in_error(body).or_else(|| {
            ["message", "detail", "title"]
                .iter()
                .any(|field| body.get(field).is_some_and(is_filled))
                .then(|| Self::from_error(body))
        });
        found.map(|found| Self {
            // Hugging Face states it beside the error.
            wait: found.wait.max(stated_wait(body)),
            ..found
        })
    }

    /// The error in the field `error`; flat shapes are not read.
    pub(in crate::ask) fn in_error(body: &Value) -> Option<Self> {
        body.get("error")
            .filter(|error| is_filled(error))
            .map(Self::from_error)
    }

    /// The error in the value of a field `error`.
    pub(in crate::ask) fn from_error(error: &Value) -> Self {
        Self::nested(error, MOST_NESTED)
    }

    /// The error in a value, or in its message if that is an error as text or as an object; at most `depth` levels are opened.
    fn nested(error: &Value, depth: usize) -> Self {
        let own = Self::flat(error);
        let message = error.get("message").or_else(|| error.get("error"));
        let inner = message
            .filter(|_| depth > 0)
            .and_then(|message| match message {
                Value::Object(_) => Some(message.clone()),
                Value::String(text) => object_in(text),
                _ => None,
            });
        let Some(inner) = inner else {
            return own;
        };
        let inner = match inner.get("error").filter(|error| error.is_object()) {
            Some(error) => Self::nested(error, depth - 1),
            None => Self::nested(&inner, depth - 1),
        };
        Self {
            kind: inner.kind.or(own.kind),
            code: inner.code.or(own.code),
            param: inner.param.or(own.param),
            moderated: inner.moderated || own.moderated,
            wait: inner.wait.max(own.wait),
            limits: [inner.limits, own.limits].concat(),
            reasons: [inner.reasons, own.reasons].concat(),
            message: inner.message,
        }
    }

    fn flat(error: &Value) -> Self {
        let metadata = error.get("metadata");
        let mut message = text(error)
            .or_else(|| {
                ["message", "detail", "error", "title"]
                    .iter()
                    .find_map(|f| text(error.get(f)?))
            })
            .unwrap_or_else(|| error.to_string());
        // OpenRouter sends the provider's text in addition to its own.
        if let Some(raw) = metadata.and_then(|metadata| text(metadata.get("raw")?)) {
            message = format!("{message}: {raw}");
        }
        let message = shortened(message);
        let field = |name| error.get(name).and_then(text_or_number);
        Self {
            kind: field("type"),
            code: field("code").or_else(|| field("status")),
            param: field("param").or_else(|| located(error)),
            moderated: metadata.is_some_and(|metadata| {
                metadata.get("reasons").is_some() || metadata.get("flagged_input").is_some()
            }),
            wait: wait_in_words(&message).max(stated_wait(error)),
            limits: limits(error),
            reasons: details(error)
                .filter_map(|detail| text_or_number(detail.get("reason")?))
                .collect(),
            message,
        }
    }

    /// Whether the limit that was reached resets once a day.
    pub(super) fn is_daily(&self) -> bool {
        let message = self.message.to_lowercase();
        self.limits
            .iter()
            .map(|limit| limit.to_lowercase())
            .chain([message])
            .any(|text| DAILY.iter().any(|words| text.contains(words)))
    }

    /// The error in the body of a refused request: JSON, an HTML page or plain text.
    pub(in crate::ask) fn from_body(body: &str) -> Self {
        let parsed = parse(body).ok();
        parsed
            .as_ref()
            .and_then(Self::from_json)
            .unwrap_or_else(|| Self {
                message: page_title(body).unwrap_or_else(|| shortened(body.trim().to_owned())),
                ..Self::default()
            })
    }

    /// Whether the code or kind is one of these.
    pub(in crate::ask) fn has_code(&self, codes: &[&str]) -> bool {
        [&self.code, &self.kind]
            .into_iter()
            .flatten()
            .any(|code| codes.contains(&code.as_str()))
    }

    /// Whether the message has one of these phrases, without regard to letter case.
    pub(in crate::ask) fn mentions_any(&self, phrases: &[&str]) -> bool {
        let message = self.message.to_lowercase();
        phrases.iter().any(|phrase| message.contains(phrase))
    }

    /// The message, the codes and the causes, in lower case.
    pub(super) fn texts(&self) -> Vec<String> {
        [&self.code, &self.kind]
            .into_iter()
            .flatten()
            .chain(&self.reasons)
            .chain([&self.message])
            .map(|text| text.to_lowercase())
            .collect()
    }

    /// The error code as an HTTP status; `None` if it is not one from 400 to 599.
    pub(in crate::ask) fn status(&self) -> Option<u16> {
        let status = self.code.as_ref()?.parse().ok()?;
        (400..600).contains(&status).then_some(status)
    }
}

/// The reason why a body with a status of success has no reply.
#[derive(Debug, PartialEq, Eq)]
pub(in crate::ask) enum UnreadableReply {
    /// The body states an error.
    Complaint(Box<Complaint>),
    /// The body has no reply of the API.
    Other(Box<Unreadable>),
}

/// A body without a usable reply.
#[derive(Debug, Default, PartialEq, Eq)]
pub(in crate::ask) struct Unreadable {
    /// The content of the body, in words.
    pub(in crate::ask) what: String,
    /// The tokens that it was charged; `None` if the server does not state it.
    pub(in crate::ask) usage: Option<Usage>,
    /// The word for the reason why the model stopped, if that is not known or is no end.
    pub(in crate::ask) finish: Option<String>,
    /// Whether the same request would end in the same way.
    pub(in crate::ask) is_final: bool,
}

impl Unreadable {
    /// A body of this content, which was not charged as far as is known.
    pub(in crate::ask) fn new(what: impl Into<String>) -> Self {
        Self {
            what: what.into(),
            ..Self::default()
        }
    }

    /// The same body with the tokens that it was charged.
    pub(in crate::ask) fn charged(self, usage: Option<Usage>) -> Self {
        Self { usage, ..self }
    }
}

impl From<Unreadable> for UnreadableReply {
    fn from(unreadable: Unreadable) -> Self {
        Self::Other(Box::new(unreadable))
    }
}

/// The beginning of a long message.
fn shortened(mut message: String) -> String {
    message.truncate(message.floor_char_boundary(LONGEST_MESSAGE));
    message
}

/// The title of an HTML page; `None` if the body is not one.
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
    Some(format!("an HTML page titled {title:?}"))
}

/// The JSON object in a text that may have words before it; `None` if there is none.
fn object_in(text: &str) -> Option<Value> {
    let object = &text[text.find('{')?..];
    let value = parse_start(object).ok()?;
    let is_error = ["error", "message", "detail"]
        .iter()
        .any(|field| value.get(field).is_some());
    is_error.then_some(value)
}

/// The field that a list of `detail` or of errors points to: the last part of its first `loc`.
fn located(error: &Value) -> Option<String> {
    [error.get("detail"), Some(error)]
        .into_iter()
        .flatten()
        .filter_map(Value::as_array)
        .flatten()
        .find_map(|item| text_or_number(item.get("loc")?.as_array()?.last()?))
}

/// The entries of Google's `details`.
fn details(error: &Value) -> impl Iterator<Item = &Value> {
    error
        .get("details")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
}

/// The wait that an error states in a field: Google's `retryDelay`, OpenRouter's `retry_after_seconds` and headers, Hugging Face's
/// `estimated_time`.
fn stated_wait(error: &Value) -> Option<Duration> {
    let delays =
        details(error).filter_map(|detail| protobuf_duration(detail.get("retryDelay")?.as_str()?));
    let metadata = error.get("metadata");
    let headers = metadata.and_then(|metadata| metadata.get("headers")?.as_object());
    let header = headers.and_then(|headers| {
        let (_, value) = headers
            .iter()
            .find(|(name, _)| name.eq_ignore_ascii_case("retry-after"))?;
        text_or_number(value)
    });
    let field = metadata.and_then(|metadata| text_or_number(metadata.get("retry_after_seconds")?));
    let estimated = error.get("estimated_time").and_then(text_or_number);
    let seconds = [header, field, estimated].into_iter().flatten();
    let seconds = seconds.filter_map(|seconds| protobuf_duration(&format!("{seconds}s")));
    delays.chain(seconds).max()
}

/// The ids of the limits in Google's `details`.
fn limits(error: &Value) -> Vec<String> {
    details(error)
        .filter_map(|detail| detail.get("violations")?.as_array())
        .flatten()
        .filter_map(|violation| text_or_number(violation.get("quotaId")?))
        .collect()
}

fn is_filled(value: &Value) -> bool {
    match value {
        Value::Null | Value::Bool(false) => false,
        Value::String(text) => !text.trim().is_empty(),
        Value::Array(items) => !items.is_empty(),
        Value::Object(fields) => !fields.is_empty(),
        Value::Bool(true) | Value::Number(_) => true,
    }
}

/// A text, or the joined texts of a list of errors, as FastAPI sends them.
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

/// A text or a number, as text.
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
    fn errors_of_every_shape_are_read() {
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
            ("\n<!DOCTYPE html><p>", "an HTML page titled \"\"", None),
            (" upstream\n", "upstream", None),
            ("", "", None),
        ] {
            let complaint = Complaint::from_body(body);
            assert_eq!(complaint.message, message, "{body}");
            assert_eq!(complaint.code.as_deref(), code, "{body}");
        }
    }

    #[test]
    fn errors_within_errors_and_lists_are_opened() {
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
            // Five levels: the fourth is shown as it is.
            (
                r#"{"error":{"message":{"message":{"message":{"message":{"message":"x"}}}}}}"#,
                r#"{"message":{"message":"x"}}"#,
                None,
                None,
            ),
            // Braces that are no error stay a part of the words.
            (
                r#"{"error":{"message":"use {\"a\": 1}"}}"#,
                r#"use {"a": 1}"#,
                None,
                None,
            ),
        ] {
            let complaint = Complaint::from_body(body);
            assert_eq!(complaint.message, message, "{body}");
            assert_eq!(complaint.code.as_deref(), code, "{body}");
            assert_eq!(complaint.param.as_deref(), param, "{body}");
        }
    }

    #[test]
    fn waits_and_days_are_read_from_every_shape() {
        let gemini = |id: &str| {
            format!(
                r#"[{{"error":{{"code":429,"message":"You exceeded your current quota.","details":[{{"violations":[{{"quotaId":"{id}"}}]}},{{"@type":"type.googleapis.com/google.rpc.RetryInfo","retryDelay":"45.837906927s"}}]}}}}]"#
            )
        };
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
            let complaint = Complaint::from_body(&body);
            let wait = complaint.wait.map(|wait| wait.as_secs_f64());
            assert_eq!(wait, seconds, "{body}");
            assert_eq!(complaint.is_daily(), is_daily, "{body}");
        }
    }

    #[test]
    fn a_body_without_an_error_is_not_a_complaint() {
        for body in [
            r#"{"choices":[],"error":null}"#,
            r#"{"choices":[],"error":""}"#,
            r#"{"error":{},"message":""}"#,
            r"{}",
            r"[]",
        ] {
            assert_eq!(
                Complaint::from_json(&serde_json::from_str(body).unwrap()),
                None,
                "{body}"
            );
        }
    }
}
