//! Parsing of the JSON in a response body: [`parse_body`].

use std::borrow::Cow;

use serde_json::Value;

use crate::ask::failures::{ReplyError, Unreadable, page_title};
use crate::ask::replies::bounded_json::parse;

/// Decodes a body as UTF-8 without a byte order mark; invalid bytes become replacement characters.
pub(super) fn text(body: &[u8]) -> Cow<'_, str> {
    match String::from_utf8_lossy(body) {
        Cow::Borrowed(text) => text.trim_start_matches('\u{FEFF}').into(),
        Cow::Owned(text) => text.trim_start_matches('\u{FEFF}').to_owned().into(),
    }
}

/// Parses the JSON of a body.
pub(super) fn parse_body(text: &str, content_type: &str) -> Result<Value, ReplyError> {
    parse(text).map_err(|error| unreadable(text, content_type, &error).into())
}

/// String in a field of an object; `None` if the field is missing or of another type.
pub(super) fn string_field(object: &Value, field: &str) -> Option<String> {
    object.get(field)?.as_str().map(str::to_owned)
}

/// Describes a body that is not JSON.
fn unreadable(text: &str, content_type: &str, error: &serde_json::Error) -> Unreadable {
    if text.trim().is_empty() {
        return Unreadable::new("an empty body");
    }
    let description =
        page_title(text).unwrap_or_else(|| format!("{content_type:?} that is not complete JSON ({error}): {text}"));
    Unreadable::new(description)
}
