//! Fields of messages and their parts: [`words`], [`refusal_field`].

use serde_json::Value;

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
