//! The error in a server's response, in any of the known JSON shapes: [`Complaint`].

use serde_json::Value;

/// An error as the server states it; secrets are not yet removed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Complaint {
    /// The error text of the server.
    pub(super) message: String,
    /// The kind of error, as `invalid_request_error` or `insufficient_quota`.
    pub(super) kind: Option<String>,
    /// The error code, as `model_not_found`, or a number as text.
    pub(super) code: Option<String>,
    /// The field of the request that the error is about.
    pub(super) param: Option<String>,
    /// Whether moderation refused the content of the request, and not the account.
    pub(super) moderated: bool,
}

impl Complaint {
    /// The error at the top level of a body, if there is one: `error` as an object or text, or the flat shapes of vLLM, FastAPI
    /// and problem+json.
    pub(super) fn of(body: &Value) -> Option<Self> {
        Self::in_error(body).or_else(|| {
            ["message", "detail", "title"]
                .iter()
                .any(|field| body.get(field).is_some_and(is_filled))
                .then(|| Self::of_error(body))
        })
    }

    /// The error in the field `error`; flat shapes are not read.
    pub(super) fn in_error(body: &Value) -> Option<Self> {
        let error = body.get("error").filter(|error| is_filled(error));
        error.map(Self::of_error)
    }

    /// The error in the value of a field `error`.
    pub(super) fn of_error(error: &Value) -> Self {
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
        let field = |name| error.get(name).and_then(text_or_number);
        Self {
            message,
            kind: field("type"),
            code: field("code").or_else(|| field("status")),
            param: field("param"),
            moderated: metadata.is_some_and(|metadata| {
                metadata.get("reasons").is_some() || metadata.get("flagged_input").is_some()
            }),
        }
    }

    /// The error in the body of a refused request: JSON, an HTML page or plain text.
    pub(super) fn of_body(body: &str) -> Self {
        let parsed: Option<Value> = serde_json::from_str(body).ok();
        parsed.as_ref().and_then(Self::of).unwrap_or_else(|| Self {
            message: page_title(body).unwrap_or_else(|| body.trim().to_owned()),
            ..Self::default()
        })
    }

    /// Whether the code or kind is one of these.
    pub(super) fn has_code(&self, codes: &[&str]) -> bool {
        [&self.code, &self.kind]
            .into_iter()
            .flatten()
            .any(|code| codes.contains(&code.as_str()))
    }

    /// Whether the message has one of these phrases, without regard to letter case.
    pub(super) fn mentions_any(&self, phrases: &[&str]) -> bool {
        let message = self.message.to_lowercase();
        phrases.iter().any(|phrase| message.contains(phrase))
    }

    /// The error code as an HTTP status; `None` if it is not one from 400 to 599.
    pub(super) fn status(&self) -> Option<u16> {
        let status = self.code.as_ref()?.parse().ok()?;
        (400..600).contains(&status).then_some(status)
    }
}

/// The reason why a body with a status of success has no reply.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum UnreadableReply {
    /// The body states an error.
    Complaint(Complaint),
    /// The body is not a reply of the API; the text says what it is.
    Other(String),
}

/// The title of an HTML page; `None` if the body is not one.
pub(super) fn page_title(body: &str) -> Option<String> {
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
            let complaint = Complaint::of_body(body);
            assert_eq!(complaint.message, message, "{body}");
            assert_eq!(complaint.code.as_deref(), code, "{body}");
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
                Complaint::of(&serde_json::from_str(body).unwrap()),
                None,
                "{body}"
            );
        }
    }
}
