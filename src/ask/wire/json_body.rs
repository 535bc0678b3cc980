//! The JSON in the body of a reply, read leniently: [`parsed`].

use std::borrow::Cow;

use serde_json::Value;

use crate::ask::failures::{ReplyError, Unreadable, page_title};
use crate::ask::replies::bounded_json::parse;
use crate::ask::replies::escapes;

/// The reason why a body is not a reply, in words.
pub(super) fn other(what: &str) -> ReplyError {
    Unreadable::new(what).into()
}

/// A body as text, without a byte order mark; invalid UTF-8 becomes replacement characters.
pub(super) fn text(body: &[u8]) -> Cow<'_, str> {
    match String::from_utf8_lossy(body) {
        Cow::Borrowed(text) => text.trim_start_matches('\u{FEFF}').into(),
        Cow::Owned(text) => text.trim_start_matches('\u{FEFF}').to_owned().into(),
    }
}

/// The JSON of a text; escapes of no character become replacement characters.
pub(super) fn parsed(text: &str, content_type: &str) -> Result<Value, ReplyError> {
    parse(text).or_else(|error| {
        let repaired = escapes::repaired(text).and_then(|text| parse(&text).ok());
        repaired.ok_or_else(|| unreadable(text, content_type, &error))
    })
}

/// The text in a field of an object; `None` if it has none.
pub(super) fn word(object: &Value, field: &str) -> Option<String> {
    object.get(field)?.as_str().map(str::to_owned)
}

/// The description of a body that is not JSON.
fn unreadable(text: &str, content_type: &str, error: &serde_json::Error) -> ReplyError {
    if text.trim().is_empty() {
        return other("an empty body");
    }
    let what = page_title(text)
        .unwrap_or_else(|| format!("{content_type:?} that is not complete JSON ({error}): {text}"));
    Unreadable::new(what).into()
}
