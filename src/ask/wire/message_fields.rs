//! Fields of messages and their parts: [`words`], [`refusal_field`].
//!
//! Replies without content whose text is in another field: in the arguments of a tool call ([`tool_call`]), which are
//! read, or among the thoughts, which are named.

use serde_json::Value;

use crate::bounded_json::parse;
use darkqa_base::types::OtherField;

/// A text field of a content part; empty if it is absent.
pub(super) fn words<'a>(part: &'a Value, field: &str) -> &'a str {
    part.get(field).and_then(Value::as_str).unwrap_or_default()
}

/// The refusal of a message or of a piece of one: its field `refusal`, or that of one of its objects. LiteLLM keeps
/// fields that it does not know in `provider_specific_fields`, LangChain in `additional_kwargs`.
pub(super) fn refusal_field(message: &Value) -> Option<&str> {
    let objects = message.as_object().into_iter().flat_map(|fields| fields.values());
    std::iter::once(message)
        .chain(objects.filter(|value| value.is_object()))
        .filter_map(|value| value.get("refusal")?.as_str())
        .find(|text| !text.is_empty())
}

/// Parts of the names of arguments that hold an answer; chosen.
const ANSWER_WORDS: [&str; 12] = [
    "answer", "choice", "option", "letter", "select", "response", "reply", "result", "verdict", "mark", "score",
    "rating",
];

/// Text fields of a message that never hold its text.
const OTHER_FIELDS: [&str; 15] = [
    "role",
    "content",
    "refusal",
    "name",
    "id",
    "type",
    "object",
    "status",
    "phase",
    "channel",
    "recipient",
    "author",
    "model",
    "provider",
    "stop_reason",
];

/// The text of a chat message without content, and the field that holds it. The answer in the only tool call becomes
/// the text; other fields do not.
pub(super) fn of_message(text: String, message: &Value) -> (String, Option<OtherField>) {
    let calls = message.get("tool_calls").and_then(Value::as_array);
    let functions: Vec<&Value> = calls
        .into_iter()
        .flatten()
        .filter_map(|call| call.get("function"))
        .chain(message.get("function_call").filter(|call| call.is_object()))
        .collect();
    if let [function] = functions[..]
        && let Some((answer, field)) = tool_call(function)
    {
        return (answer.unwrap_or(text), Some(field));
    }
    (text, thoughts(message))
}

/// The answer in the arguments of a function call, and the field; `None` without arguments. The answer is `None` unless
/// exactly one argument is named like one.
pub(super) fn tool_call(function: &Value) -> Option<(Option<String>, OtherField)> {
    let arguments = function.get("arguments")?;
    let text = match arguments {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let object = parse(&text).ok();
    let answers: Vec<(&String, String)> = object
        .iter()
        .filter_map(Value::as_object)
        .flatten()
        .filter(|(name, _)| is_answer(name))
        .filter_map(|(name, value)| Some((name, scalar(value)?)))
        .collect();
    let function = words(function, "name");
    if let [(name, answer)] = &answers[..] {
        let name = format!("tool_calls ({name}, {function})");
        let text = answer.clone();
        return Some((Some(answer.clone()), OtherField { name, text }));
    }
    let name = format!("tool_calls ({function})");
    Some((None, OtherField { name, text }))
}

fn is_answer(name: &str) -> bool {
    let name = name.to_lowercase();
    ANSWER_WORDS.iter().any(|word| name.contains(word))
}

/// A string or a number as text.
fn scalar(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        _ => None,
    }
}

/// The field of a message with the longest text, besides its content: `reasoning_content`, or as a server calls it.
fn thoughts(message: &Value) -> Option<OtherField> {
    let fields = message.as_object()?;
    fields
        .iter()
        .filter(|(name, _)| !OTHER_FIELDS.contains(&&***name))
        .chain(fields.get_key_value("content"))
        .map(|(name, value)| OtherField { name: name.clone(), text: text_of(value) })
        .filter(|field| !field.text.trim().is_empty())
        .max_by_key(|field| field.text.len())
}

/// The text in a value: a string, or the strings `text`, `thinking` and `summary` in a list of parts, at any depth.
pub(super) fn text_of(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(parts) => parts
            .iter()
            .filter_map(Value::as_object)
            .flat_map(|part| ["text", "thinking", "summary"].map(|field| part.get(field)))
            .flatten()
            .map(text_of)
            .collect(),
        _ => String::new(),
    }
}
