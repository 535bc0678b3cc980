//! Refusals of an API: [`requested_wire`] finds the API that the server asks for instead.

use crate::ask::failures::ApiError;
use crate::ask::wire_kind::Wire;

/// Phrases for servers that reply only with event streams (Alibaba Model Studio, ModelScope).
const STREAM_ONLY: [&str; 8] = [
    "only support stream",
    "only supports stream",
    "enable the stream parameter",
    "does not support http call",
    "for non-streaming call",
    // "not streaming" in Chinese: the same servers use both languages.
    "非流式",
    "stream=false",
    "stream must be set to true",
];

/// Phrases of OpenAI for models that are available only through the Responses API.
const RESPONSES_ONLY: [&str; 3] =
    ["only supported in v1/responses", "only supported in /v1/responses", "use /v1/responses"];

/// API that a server asks for when it refuses a request; `None` if it asks for no other API.
pub(crate) fn requested_wire(api_error: &ApiError, sent: Wire) -> Option<Wire> {
    let wanted = if api_error.mentions_any(&RESPONSES_ONLY) {
        Wire::Responses
    } else if api_error.mentions_any(&STREAM_ONLY) {
        Wire::ChatStream
    } else {
        return None;
    };
    // Streams are used only for chat completions.
    let is_other = match wanted {
        Wire::ChatStream => sent == Wire::Chat,
        wanted => sent != wanted,
    };
    is_other.then_some(wanted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_for_another_api_are_recognized() {
        use Wire::{Chat, ChatStream, Responses};
        for (words, expected) in [
            (
                "This model only support stream mode, please enable the stream parameter to access the model.",
                Some(ChatStream),
            ),
            ("parameter.enable_thinking must be set to false for non-streaming calls", Some(ChatStream)),
            ("enable thinking can not be support when `stream=False`", Some(ChatStream)),
            ("parameter.enable_thinking 必须在非流式调用中设置为 false", Some(ChatStream)),
            ("current user api does not support http call", Some(ChatStream)),
            ("This model is only supported in v1/responses and not in v1/chat/completions.", Some(Responses)),
            ("Unknown parameter: 'stream_options'.", None),
            ("a streaming error occurred", None),
            ("", None),
        ] {
            let api_error = ApiError::from_body(words);
            assert_eq!(requested_wire(&api_error, Chat), expected, "{words}");
            // The API that was already used is not the remedy.
            if let Some(wire) = expected {
                assert_eq!(requested_wire(&api_error, wire), None, "{words}");
            }
        }
    }
}
