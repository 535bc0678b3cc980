//! Lenient parsing of the JSON in a response body: [`parse_lenient`].

use std::borrow::Cow;

use serde_json::Value;

use crate::ask::failures::{ReplyError, Unreadable, page_title};
use crate::ask::replies::bounded_json::parse;
use crate::ask::replies::escapes;

/// Decodes a body as UTF-8 without a byte order mark; invalid bytes become replacement characters.
pub(super) fn text(body: &[u8]) -> Cow<'_, str> {
    match String::from_utf8_lossy(body) {
        Cow::Borrowed(text) => text.trim_start_matches('\u{FEFF}').into(),
        Cow::Owned(text) => text.trim_start_matches('\u{FEFF}').to_owned().into(),
    }
}

/// Parses JSON; unpaired surrogates become replacement characters.
pub(super) fn parse_lenient(text: &str, content_type: &str) -> Result<Value, ReplyError> {
    parse(text).or_else(|error| {
        escapes::repaired(text)
            .and_then(|text| parse(&text).ok())
            .ok_or_else(|| unreadable(text, content_type, &error).into())
    })
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
    let description = page_title(text)
        .unwrap_or_else(|| format!("{content_type:?} that is not complete JSON ({error}): {text}"));
    Unreadable::new(description)
}
