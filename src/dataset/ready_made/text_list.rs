//! A list in a text: [`list`].

use serde_json::Value;

use super::python_list::python_list;

/// The texts of a list in a text: JSON, then Python's notation; `None` if the text is no list of texts and numbers.
pub(super) fn list(text: &str) -> Option<Vec<String>> {
    let text = text.trim();
    if !text.starts_with('[') {
        return None;
    }
    let items = serde_json::from_str::<Vec<Value>>(text).ok();
    let texts = items.and_then(|items| items.iter().map(item).collect());
    texts.or_else(|| python_list(text))
}

fn item(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(_) | Value::Bool(_) => Some(value.to_string()),
        _ => None,
    }
}
