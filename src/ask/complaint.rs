//! What a server says went wrong, in whichever shape it says so: [`Complaint`].

use serde_json::Value;

/// An error in the words of a server; not yet scrubbed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Complaint {
    /// The words.
    pub(super) message: String,
    /// Its kind: `invalid_request_error`, `insufficient_quota`.
    pub(super) kind: Option<String>,
    /// Its code: `model_not_found`, or a number as text.
    pub(super) code: Option<String>,
    /// The field of the request that it is about.
    pub(super) param: Option<String>,
    /// Whether a moderator refused what was asked, rather than who asked.
    pub(super) moderated: bool,
}

impl Complaint {
    /// The error at the top level of a body, if there is one: `error` as an object or text, or without `error` the flat shapes of
    /// vLLM, FastAPI and problem+json.
    pub(super) fn of(body: &Value) -> Option<Self> {
        Self::in_error(body).or_else(|| {
            ["message", "detail", "title"]
                .iter()
                .any(|field| body.get(field).is_some_and(says_something))
                .then(|| Self::of_error(body))
        })
    }

    /// The error in the field `error` alone.
    pub(super) fn in_error(body: &Value) -> Option<Self> {
        let error = body.get("error").filter(|error| says_something(error));
        error.map(Self::of_error)
    }

    /// The error that a value named `error` holds.
    pub(super) fn of_error(error: &Value) -> Self {
        let metadata = error.get("metadata");
        let mut message = text(error)
            .or_else(|| {
                ["message", "detail", "error", "title"]
                    .iter()
                    .find_map(|f| text(error.get(f)?))
            })
            .unwrap_or_else(|| error.to_string());
        // OpenRouter passes on what the provider said beside its own words.
        if let Some(raw) = metadata.and_then(|metadata| text(metadata.get("raw")?)) {
            message = format!("{message}: {raw}");
        }
        let field = |name| error.get(name).and_then(word);
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

    /// The error in the body of a refused request, whatever it is.
    pub(super) fn of_body(body: &str) -> Self {
        let parsed: Option<Value> = serde_json::from_str(body).ok();
        parsed.as_ref().and_then(Self::of).unwrap_or_else(|| Self {
            message: page_title(body).unwrap_or_else(|| body.trim().to_owned()),
            ..Self::default()
        })
    }

    /// Whether its code or kind is one of these words.
    pub(super) fn is_any(&self, words: &[&str]) -> bool {
        [&self.code, &self.kind]
            .into_iter()
            .flatten()
            .any(|said| words.contains(&said.as_str()))
    }

    /// Whether the message holds one of these wordings, in any case.
    pub(super) fn says_any(&self, wordings: &[&str]) -> bool {
        let message = self.message.to_lowercase();
        wordings.iter().any(|wording| message.contains(wording))
    }

    /// The HTTP status that its code stands for.
    pub(super) fn status(&self) -> Option<u16> {
        let status = self.code.as_ref()?.parse().ok()?;
        (400..600).contains(&status).then_some(status)
    }
}

/// Why the body of a reply with a status of success holds no answer.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum UnreadableReply {
    /// The server says that something went wrong.
    Complaint(Complaint),
    /// The body is no reply of the wire; what it is instead.
    Other(String),
}

/// The title of an HTML page.
pub(super) fn page_title(body: &str) -> Option<String> {
    // ASCII folding keeps byte positions.
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

fn says_something(value: &Value) -> bool {
    match value {
        Value::Null | Value::Bool(false) => false,
        Value::String(text) => !text.trim().is_empty(),
        Value::Array(items) => !items.is_empty(),
        Value::Object(fields) => !fields.is_empty(),
        Value::Bool(true) | Value::Number(_) => true,
    }
}

/// A text, or the texts of a list of complaints such as FastAPI makes.
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
fn word(value: &Value) -> Option<String> {
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
    fn every_shape_is_read() {
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
    fn no_error_is_no_complaint() {
        for fine in [
            r#"{"choices":[],"error":null}"#,
            r#"{"choices":[],"error":""}"#,
            r#"{"error":{},"message":""}"#,
            r"{}",
            r"[]",
        ] {
            assert_eq!(
                Complaint::of(&serde_json::from_str(fine).unwrap()),
                None,
                "{fine}"
            );
        }
    }
}
