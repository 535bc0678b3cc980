//! Errors in the responses of servers, in all known JSON shapes: [`ApiError`].
//!
//! Errors in the bodies of responses without a reply, recognized by their structure: [`find_error`].

#[cfg(test)]
mod tests;

use std::sync::LazyLock;
use std::time::Duration;

use regex::Regex;
use serde_json::{Value, json};

use crate::bounded_json::{parse, parse_start};
use crate::pace::{wait_in_field, wait_in_words};
use darkqa_base::types::Usage;

/// Error that a server reports in a response. Secrets are not yet removed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ApiError {
    /// Error text of the server.
    pub message: String,
    /// Kind of error, such as `invalid_request_error` or `insufficient_quota`.
    pub(super) kind: Option<String>,
    /// Error code, such as `model_not_found`, or a number as text.
    pub code: Option<String>,
    /// Request field that caused the error.
    pub param: Option<String>,
    /// True if moderation rejected the content of the request, as opposed to the account.
    pub(super) is_moderated: bool,
    /// Wait stated in the error, in a field or in its text.
    pub wait: Option<Duration>,
    /// Ids of the reached limits, such as `GenerateRequestsPerDayPerProject`.
    limits: Vec<String>,
    /// Google's names of the cause, such as `API_KEY_INVALID`.
    reasons: Vec<String>,
    /// True if a stated limit is 0: there is no quota at all.
    pub(super) has_zero_limit: bool,
    /// Start of the body in lower case, if it is an HTML page: a gateway, firewall or web site sent it, not the API.
    pub(super) page: Option<String>,
}

/// Maximum depth of errors nested in errors: routers embed the error of a server as text.
const MAX_DEPTH: usize = 3;

/// Maximum length of a message, in bytes; chosen: it is searched for many phrases, and its first line is printed.
const MAX_MESSAGE: usize = 64 << 10;

/// Maximum length of the start of an HTML page that is searched for phrases, in bytes; chosen.
const MAX_PAGE: usize = 16 << 10;

/// Names of the text of an error, in the order in which they are searched.
const TEXT_FIELDS: [&str; 10] = [
    "message",
    "detail",
    "error",
    "title",
    "msg",
    "error_msg",
    "error_message",
    "errorMessage",
    "error_description",
    "Message",
];

/// Names of the code of an error, in the order in which they are searched.
const CODE_FIELDS: [&str; 6] = ["code", "status", "error_code", "errorCode", "statusCode", "__type"];

/// Matches a limit of 0 in a text, such as Gemini's `limit: 0`, but not `limit: 0.5`.
static ZERO_LIMIT: LazyLock<Regex> = LazyLock::new(|| {
    Regex::new(r"(?i)\b(?:limit|quota)(?: value)?(?:\s*[:=]\s*|\s+(?:is|of)\s+|\s+)0(?:[,;)\s]|\.(?:\D|$)|$)")
        .unwrap_or_else(|e| unreachable!("a test compiles it: {e}"))
});

/// Phrases in the text or the id of a limit that resets once a day.
const DAILY: [&str; 6] = ["(rpd)", "(tpd)", "perday", "per day", "per-day", "daily"];

impl ApiError {
    /// Parses the error at the top level of a body: `error` as an object or text, or the flat shapes of vLLM, FastAPI
    /// and problem+json. `None` if the body has no error.
    pub fn from_json(body: &Value) -> Option<Self> {
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
    pub fn in_error(body: &Value) -> Option<Self> {
        body.get("error").filter(|error| is_filled(error)).map(Self::from_error)
    }

    /// Parses an error by its structure: an object with an error code and words, under any name.
    pub fn in_structure(body: &Value) -> Option<Self> {
        find_error(body).as_ref().map(Self::from_error)
    }

    /// Parses the value of a field `error`.
    pub fn from_error(error: &Value) -> Self {
        Self::nested(error, MAX_DEPTH)
    }

    /// Parses an error, and up to `depth` levels of errors nested in its message as an object or as JSON text.
    fn nested(error: &Value, depth: usize) -> Self {
        let outer = Self::flat(error);
        let inner =
            error.get("message").or_else(|| error.get("error")).filter(|_| depth > 0).and_then(
                |message| match message {
                    Value::Object(_) => Some(message.clone()),
                    Value::String(text) => embedded_error(text),
                    _ => None,
                },
            );
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
            has_zero_limit: inner.has_zero_limit || outer.has_zero_limit,
            page: None,
            message: inner.message,
        }
    }

    /// Parses an error without the errors nested in it.
    fn flat(error: &Value) -> Self {
        let metadata = error.get("metadata");
        let mut message = text(error)
            .or_else(|| TEXT_FIELDS.iter().find_map(|field| text(error.get(field)?)))
            .unwrap_or_else(|| error.to_string());
        // OpenRouter adds the text of the provider.
        if let Some(raw) = metadata.and_then(|metadata| text(metadata.get("raw")?)) {
            message = format!("{message}: {raw}");
        }
        let message = truncated(message);
        Self {
            kind: field(error, "type").or_else(|| field(error, "error_type")),
            code: CODE_FIELDS.iter().find_map(|name| field(error, name)),
            param: field(error, "param").or_else(|| error_location(error)),
            is_moderated: metadata
                .is_some_and(|metadata| metadata.get("reasons").is_some() || metadata.get("flagged_input").is_some()),
            wait: wait_in_words(&message).max(stated_wait(error)),
            has_zero_limit: ZERO_LIMIT.is_match(&message) || quota_values(error).any(|value| value == "0"),
            page: None,
            limits: quota_ids(error),
            reasons: details(error).filter_map(|detail| text_or_number(detail.get("reason")?)).collect(),
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
    pub fn from_body(body: &str) -> Self {
        let parsed = parse(body).ok();
        if let Some(found) = parsed.as_ref().and_then(Self::from_json) {
            return found;
        }
        let has_text = |body: &Value| TEXT_FIELDS.iter().any(|field| body.get(field).is_some_and(is_filled));
        if let Some(found) = parsed.filter(has_text) {
            return Self::from_error(&found);
        }
        let title = page_title(body);
        let page = title.as_ref().map(|_| body[..body.floor_char_boundary(MAX_PAGE)].to_lowercase());
        let message = title.unwrap_or_else(|| truncated(body.trim().to_owned()));
        Self { wait: wait_in_words(&message), message, page, ..Self::default() }
    }

    /// True if the code or the kind is one of these.
    pub fn has_code(&self, codes: &[&str]) -> bool {
        [&self.code, &self.kind].into_iter().flatten().any(|code| codes.contains(&code.as_str()))
    }

    /// True if the message contains one of these lower-case phrases, ignoring case.
    pub fn mentions_any(&self, phrases: &[&str]) -> bool {
        let message = self.message.to_lowercase();
        phrases.iter().any(|phrase| message.contains(phrase))
    }

    /// True if the message contains a name that is not part of a longer word, ignoring case.
    pub(super) fn names(&self, name: &str) -> bool {
        let (message, name) = (self.message.to_lowercase(), name.to_lowercase());
        message.match_indices(&name).any(|(start, found)| {
            let before = message[..start].chars().next_back();
            let after = message[start + found.len()..].chars().next();
            ![before, after].into_iter().flatten().any(char::is_alphanumeric)
        })
    }

    /// True if the code, the kind or a cause contains one of these words; case and separators are ignored:
    /// `insufficientquota` is in `Insufficient_Quota`.
    pub(super) fn has_code_like(&self, words: &[&str]) -> bool {
        [&self.code, &self.kind]
            .into_iter()
            .flatten()
            .chain(&self.reasons)
            .map(|code| {
                code.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect::<String>()
            })
            .any(|code| words.iter().any(|word| code.contains(word)))
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
    pub fn status(&self) -> Option<u16> {
        let status = self.code.as_ref()?.parse().ok()?;
        (400..600).contains(&status).then_some(status)
    }
}

fn field(error: &Value, name: &str) -> Option<String> {
    error.get(name).and_then(text_or_number)
}

/// Reason why a response with a success status has no reply.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum ReplyError {
    /// The body contains an error of the server.
    Api(Box<ApiError>),
    /// The body contains no reply in the form of the API.
    Unreadable(Box<Unreadable>),
}

/// A response body without a usable reply.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Unreadable {
    /// Description of the body, as a phrase that follows "answered with".
    pub description: String,
    /// Tokens charged for it; `None` if the server does not report them.
    pub usage: Option<Usage>,
    /// Finish reason of the server, if it is unknown or means that the reply is incomplete.
    pub finish: Option<String>,
    /// True if the body has a part of the reply, so that the server has worked on it.
    pub broke_off: bool,
}

impl Unreadable {
    /// A body with this description, without known charges.
    pub(crate) fn new(description: impl Into<String>) -> Self {
        Self { description: description.into(), ..Self::default() }
    }

    /// The same body with the tokens charged for it.
    pub(crate) fn with_usage(self, usage: Option<Usage>) -> Self {
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
pub(crate) fn page_title(body: &str) -> Option<String> {
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
    let is_error = ["error", "message", "detail"].iter().any(|field| value.get(field).is_some());
    is_error.then_some(value)
}

/// Name of the request field that caused the error: the last part of the first `loc` in `detail` or in a list of
/// errors.
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
    error.get("details").and_then(Value::as_array).into_iter().flatten()
}

/// Longest wait in the fields of an error, of its `metadata` and the headers in it, and of Google's `details`:
/// `retryDelay`, `retry_after_seconds`, `estimated_time` and others ([`wait_in_field`]).
fn stated_wait(error: &Value) -> Option<Duration> {
    let metadata = error.get("metadata");
    let headers = metadata.and_then(|metadata| metadata.get("headers"));
    [Some(error), metadata, headers]
        .into_iter()
        .flatten()
        .chain(details(error))
        .filter_map(Value::as_object)
        .flatten()
        .filter_map(|(name, value)| wait_in_field(name, &text_or_number(value)?))
        .max()
}

/// Violated limits in Google's `details`.
fn violations(error: &Value) -> impl Iterator<Item = &Value> {
    details(error).filter_map(|detail| detail.get("violations")?.as_array()).flatten()
}

/// Ids of the limits in Google's `details`.
fn quota_ids(error: &Value) -> Vec<String> {
    violations(error).filter_map(|violation| text_or_number(violation.get("quotaId")?)).collect()
}

/// Values of the limits in Google's `details`.
fn quota_values(error: &Value) -> impl Iterator<Item = String> {
    violations(error).filter_map(|violation| text_or_number(violation.get("quotaValue")?))
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

/// A string with content, or the joined messages of a list of errors, each with its place, as FastAPI sends them.
fn text(value: &Value) -> Option<String> {
    match value {
        Value::String(text) if !text.trim().is_empty() => Some(text.clone()),
        Value::Array(items) => {
            let texts: Vec<String> =
                items.iter().filter_map(|item| text(item).or_else(|| located_text(item))).collect();
            (!texts.is_empty()).then(|| texts.join("; "))
        }
        _ => None,
    }
}

/// Message of an item of FastAPI's list of errors, after the place in the request that it is about: `seed: Extra inputs
/// are not permitted`.
fn located_text(item: &Value) -> Option<String> {
    let message = text(item.get("msg")?)?;
    let place: Vec<String> = item
        .get("loc")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
        .filter_map(text_or_number)
        .filter(|part| part != "body")
        .collect();
    Some(match place.join(".") {
        place if place.is_empty() => message,
        place => format!("{place}: {message}"),
    })
}

/// A string or a number, as text.
fn text_or_number(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        _ => None,
    }
}

/// End of the names of fields with an error code (MiniMax: status_code; Baidu: error_code), in lower case.
const CODE_FIELD: &str = "code";

/// Ends of the names of fields whose numbers are error codes, in lower case.
const NUMBER_FIELDS: [&str; 4] = ["code", "errno", "ret", "status"];

/// Ends of the names of fields with the words of an error, in lower case.
const MESSAGE_FIELDS: [&str; 4] = ["message", "msg", "detail", "description"];

/// Codes of success.
const SUCCESS: [&str; 6] = ["0", "200", "ok", "success", "succeeded", "completed"];

/// The error in a JSON body that has no reply, in the form of an error object: of the body, or of an object or list in
/// it, the first with an error code other than that of success and words.
pub(crate) fn find_error(body: &Value) -> Option<Value> {
    let fields = body.as_object()?;
    let nested = fields.values().flat_map(|value| match value {
        Value::Array(items) => items.iter().collect::<Vec<&Value>>(),
        value => vec![value],
    });
    std::iter::once(body).chain(nested).find_map(error_object)
}

/// The code and the words of an object, if it has both and the code is none of success.
fn error_object(object: &Value) -> Option<Value> {
    let fields = object.as_object()?;
    let ends_in = |name: &str, ends: &[&str]| {
        let name = name.to_lowercase();
        ends.iter().any(|end| name.ends_with(end))
    };
    let code = fields.iter().find_map(|(name, value)| {
        let code = error_code(value)?;
        let is_number = code.parse::<i64>().is_ok();
        let is_code = ends_in(name, &[CODE_FIELD]) || (is_number && ends_in(name, &NUMBER_FIELDS));
        is_code.then_some(code)
    })?;
    let message = fields
        .iter()
        .filter(|(name, _)| ends_in(name, &MESSAGE_FIELDS))
        .find_map(|(_, value)| value.as_str().filter(|text| !text.trim().is_empty()))?;
    Some(json!({"code": code, "message": message}))
}

/// A code other than that of success, as text.
fn error_code(value: &Value) -> Option<String> {
    let code = match value {
        Value::Number(number) => number.to_string(),
        Value::String(text) => text.trim().to_owned(),
        _ => return None,
    };
    let is_success = code.is_empty() || SUCCESS.contains(&code.to_lowercase().as_str());
    (!is_success).then_some(code)
}
