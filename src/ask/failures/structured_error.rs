//! Errors in the bodies of responses without a reply, recognized by their structure: [`find_error`].

use serde_json::{Value, json};

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
