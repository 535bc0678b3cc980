//! Lists and objects written in a text: [`parse_list`], [`parse_object`].

use serde_json::Value;

use super::python_list::{python_dict, python_list};

/// Parses a list in JSON, or else in the notation of Python or NumPy; `None` if the text is not a list of scalars.
pub(crate) fn parse_list(text: &str) -> Option<Vec<String>> {
    let text = text.trim();
    if !text.starts_with(['[', '(']) || !has_few_values(text) {
        return None;
    }
    serde_json::from_str::<Vec<Value>>(text)
        .ok()
        .and_then(|items| items.iter().map(scalar_text).collect())
        .or_else(|| python_list(text))
}

/// Parses an object in JSON, or else a dictionary in Python's notation, to names and values; `None` if the text is not
/// an object of scalars. A value is `None` if it is null.
pub(crate) fn parse_object(text: &str) -> Option<Vec<(String, Option<String>)>> {
    let text = text.trim();
    if !text.starts_with('{') || !has_few_values(text) {
        return None;
    }
    serde_json::from_str::<serde_json::Map<String, Value>>(text)
        .ok()
        .and_then(|fields| {
            fields
                .iter()
                .map(|(name, value)| match value {
                    Value::Null => Some((name.clone(), None)),
                    value => Some((name.clone(), Some(scalar_text(value)?))),
                })
                .collect()
        })
        .or_else(|| python_dict(text))
}

/// True if a text has at most about a million values, which limits the memory to parse it.
fn has_few_values(text: &str) -> bool {
    text.bytes().filter(|byte| matches!(byte, b',' | b'[' | b'{')).count() <= 1 << 20
}

/// Text of a string, number or truth value.
fn scalar_text(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(_) | Value::Bool(_) => Some(value.to_string()),
        _ => None,
    }
}
