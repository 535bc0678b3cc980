//! A list or an object in a text: [`list`], [`dict`].

use serde_json::Value;

use super::python_list::{python_dict, python_list};

/// The texts of a list in a text: JSON, then Python's notation; `None` if the text is no list of texts and numbers.
pub(in crate::dataset::ready_made) fn list(text: &str) -> Option<Vec<String>> {
    let text = text.trim();
    if !text.starts_with('[') || !is_short(text) {
        return None;
    }
    let items = serde_json::from_str::<Vec<Value>>(text).ok();
    let texts = items.and_then(|items| items.iter().map(item).collect());
    texts.or_else(|| python_list(text))
}

/// The names and the texts of an object in a text: JSON, then Python's notation; `None` if the text is no object of texts and numbers.
pub(in crate::dataset::ready_made) fn dict(text: &str) -> Option<Vec<(String, Option<String>)>> {
    let text = text.trim();
    if !text.starts_with('{') || !is_short(text) {
        return None;
    }
    let fields = serde_json::from_str::<serde_json::Map<String, Value>>(text).ok();
    let texts = fields.and_then(|fields| {
        fields
            .iter()
            .map(|(name, value)| match value {
                Value::Null => Some((name.clone(), None)),
                value => Some((name.clone(), Some(item(value)?))),
            })
            .collect()
    });
    texts.or_else(|| python_dict(text))
}

/// Whether a text holds so few signs between values that these may be held in memory.
fn is_short(text: &str) -> bool {
    let signs = text
        .bytes()
        .filter(|byte| matches!(byte, b',' | b'[' | b'{'));
    signs.count() <= 1 << 20
}

fn item(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(_) | Value::Bool(_) => Some(value.to_string()),
        _ => None,
    }
}
