//! Parsing of the finish reason that a server sends: [`read`], with the known reasons in `finish_reasons.toml`.
//!
//! A reply that the server ended deliberately and would end so again, by a filter, a limit or a loop, is the model's:
//! it is scored as unread and asked once. A generation that the server gave up is a failure and asked again. A word in
//! no list may mean either; [`FinishWords`](crate::models) decides it by a second try, so that a vendor's choice
//! of words moves no accuracy.
//!
//! Refusals of an API: [`requested_wire`] finds the API that the server asks for instead.

use std::sync::LazyLock;

use serde::Deserialize;

use crate::failures::{ApiError, Unreadable};
use crate::wire_kind::Wire;
use darkqa_base::types::{Finish, Usage};

/// Finish reasons of servers, grouped by meaning; in lower case, with underscores.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Reasons {
    stop: Vec<String>,
    length: Vec<String>,
    filter: Vec<String>,
    context: Vec<String>,
    #[serde(rename = "loop")]
    loops: Vec<String>,
    broken: Vec<String>,
}

/// The known reasons; a test parses the file.
static REASONS: LazyLock<Reasons> =
    LazyLock::new(|| toml::from_str(include_str!("finish_reasons.toml")).unwrap_or_default());

/// The end of a reply, as a server states it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ReplyEnding {
    pub(super) finish: Finish,
    /// True if the reason is not known, so that another try may end in another way.
    pub(super) may_heal: bool,
}

/// Parses a server's finish reason; an empty one is [`Finish::Unknown`].
///
/// # Errors
/// If the server gave the generation up. The error includes `usage`, the tokens charged.
pub(super) fn read(reason: &str, usage: Option<Usage>) -> Result<ReplyEnding, Box<Unreadable>> {
    let name = Finish::normalized(reason);
    let reasons = &*REASONS;
    let other = Finish::Other(reason.trim().to_owned());
    let finish = if name.is_empty() {
        Finish::Unknown
    } else if reasons.stop.contains(&name) {
        Finish::Stop
    } else if reasons.length.contains(&name) {
        Finish::Length
    } else if reasons.filter.contains(&name) {
        Finish::Filter
    } else if reasons.context.contains(&name) || reasons.loops.contains(&name) || other.is_whole() {
        other
    } else if reasons.broken.contains(&name) {
        return Err(Box::new(Unreadable {
            usage,
            finish: Some(reason.to_owned()),
            ..Unreadable::new(format!("a reply that broke off: its finish_reason is {reason:?}"))
        }));
    } else {
        return Ok(ReplyEnding { finish: other, may_heal: true });
    };
    Ok(ReplyEnding { finish, may_heal: false })
}

/// True if a finish reason means that prompt and reply are as long as the model's context.
pub fn is_context_full(word: &str) -> bool {
    REASONS.context.contains(&Finish::normalized(word))
}

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
    fn each_reason_is_listed_once() {
        let Reasons { stop, length, filter, context, loops, broken } =
            toml::from_str(include_str!("finish_reasons.toml")).unwrap();
        let mut all = [stop, length, filter, context, loops, broken].concat();
        let count = all.len();
        all.sort();
        all.dedup();
        assert_eq!(all.len(), count);
        assert!(all.iter().all(|word| *word == Finish::normalized(word)));
        assert!(all.iter().all(|word| !Finish::Other(word.clone()).is_whole()));
    }

    fn certain(finish: Finish) -> ReplyEnding {
        ReplyEnding { finish, may_heal: false }
    }

    #[test]
    fn interrupted_generation_is_an_error() {
        for word in ["abort", "Cancelled", "network_error", "insufficient-system-resource"] {
            let broken = read(word, None).unwrap_err();
            assert!(broken.description.contains("broke off"), "{word}");
        }
    }

    #[test]
    fn words_of_context_and_loops_are_kept() {
        for word in ["model_context_window_exceeded", "Repetition", "repeat"] {
            assert_eq!(read(word, None), Ok(certain(Finish::Other(word.to_owned()))));
        }
        assert!(is_context_full("MODEL-LENGTH") && !is_context_full("length"));
    }

    #[test]
    fn unknown_reason_is_doubtful() {
        for word in ["zeitgeist", "MALFORMED_FUNCTION_CALL", "NO_IMAGE", "language"] {
            let ending = read(word, None).unwrap();
            assert_eq!(ending.finish, Finish::Other(word.to_owned()));
            assert!(ending.may_heal && !ending.finish.is_whole());
        }
    }

    #[test]
    fn known_reasons_are_parsed_in_any_case() {
        assert_eq!(read("END_TURN", None), Ok(certain(Finish::Stop)));
        assert_eq!(read("tool_use", None), Ok(certain(Finish::Other("tool_use".to_owned()))));
        assert_eq!(read("MAX_TOKENS", None), Ok(certain(Finish::Length)));
        for word in ["SAFETY", "RECITATION", "PROHIBITED_CONTENT", "guardrail_intervened", "sensitive"] {
            assert_eq!(read(word, None), Ok(certain(Finish::Filter)), "{word}");
        }
        assert_eq!(read("", None), Ok(certain(Finish::Unknown)));
    }

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
