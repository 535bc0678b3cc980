//! A value of TOML as a word of the command line: [`text_of`].

use std::ffi::OsString;

use toml::Value;

/// The text of a value; `None` if it is not a text, a number or a switch.
pub(super) fn text_of(value: &Value) -> Option<OsString> {
    match value {
        Value::String(text) => Some(text.into()),
        Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => Some(value.to_string().into()),
        _ => None,
    }
}
