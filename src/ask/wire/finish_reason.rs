//! Parsing of the finish reason that a server sends: [`read`], with the known reasons in `finish_reasons.toml`.

use std::sync::LazyLock;

use serde::Deserialize;

use crate::ask::failures::Unreadable;
use crate::types::{Finish, Usage};

/// Finish reasons of servers, grouped by meaning; in lower case, with underscores.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Reasons {
    stop: Vec<String>,
    other: Vec<String>,
    length: Vec<String>,
    filter: Vec<String>,
    context: Vec<String>,
    broken: Vec<String>,
}

/// The known reasons; a test parses the file.
static REASONS: LazyLock<Reasons> =
    LazyLock::new(|| toml::from_str(include_str!("finish_reasons.toml")).unwrap_or_default());

/// Parses a server's finish reason; an empty one is [`Finish::Unknown`].
///
/// # Errors
/// If the reason means that the reply is incomplete, or if the reason is unknown. The error includes `usage`, the tokens charged.
pub(super) fn read(reason: &str, usage: Option<Usage>) -> Result<Finish, Unreadable> {
    let name = reason.trim().to_ascii_lowercase().replace('-', "_");
    let reasons = &*REASONS;
    if name.is_empty() {
        Ok(Finish::Unknown)
    } else if reasons.stop.contains(&name) {
        Ok(Finish::Stop)
    } else if reasons.other.contains(&name) {
        Ok(Finish::Other(reason.to_owned()))
    } else if reasons.length.contains(&name) {
        Ok(Finish::Length)
    } else if reasons.filter.contains(&name) {
        Ok(Finish::Filter)
    } else if reasons.context.contains(&name) {
        Err(Unreadable {
            usage,
            is_final: true,
            finish: Some(reason.to_owned()),
            ..Unreadable::new(format!(
                "a reply that ended at the model's context length: its finish_reason is {reason:?} (send smaller images: --image max-side=N, or a \
                 smaller --max-tokens)"
            ))
        })
    } else if reasons.broken.contains(&name) {
        Err(Unreadable {
            usage,
            finish: Some(reason.to_owned()),
            ..Unreadable::new(format!(
                "a reply that broke off: its finish_reason is {reason:?}"
            ))
        })
    } else {
        Err(Unreadable {
            usage,
            finish: Some(reason.to_owned()),
            ..Unreadable::new(format!(
                "a reply whose finish_reason {reason:?} is not known, so that it may have broken off"
            ))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reason_is_listed_once() {
        let Reasons {
            stop,
            other,
            length,
            filter,
            context,
            broken,
        } = toml::from_str(include_str!("finish_reasons.toml")).unwrap();
        let mut all = [stop, other, length, filter, context, broken].concat();
        let count = all.len();
        all.sort();
        all.dedup();
        assert_eq!(all.len(), count);
        assert!(all.iter().all(|word| *word == word.to_ascii_lowercase()));
    }

    #[test]
    fn interrupted_generation_is_an_error() {
        for word in [
            "abort",
            "Cancelled",
            "network_error",
            "insufficient-system-resource",
            "MALFORMED_FUNCTION_CALL",
        ] {
            let broken = read(word, None).unwrap_err();
            assert!(
                !broken.is_final && broken.description.contains("broke off"),
                "{word}"
            );
        }
    }

    #[test]
    fn full_context_is_a_final_error() {
        assert!(
            read("model_context_window_exceeded", None)
                .unwrap_err()
                .is_final
        );
    }

    #[test]
    fn unknown_reason_is_an_error() {
        let unknown = read("zeitgeist", None).unwrap_err();
        assert!(unknown.description.contains("\"zeitgeist\" is not known"));
    }

    #[test]
    fn known_reasons_are_parsed_in_any_case() {
        assert_eq!(read("END_TURN", None), Ok(Finish::Stop));
        assert_eq!(
            read("tool_use", None),
            Ok(Finish::Other("tool_use".to_owned()))
        );
        assert_eq!(read("MAX_TOKENS", None), Ok(Finish::Length));
        for word in [
            "SAFETY",
            "RECITATION",
            "PROHIBITED_CONTENT",
            "guardrail_intervened",
        ] {
            assert_eq!(read(word, None), Ok(Finish::Filter), "{word}");
        }
        assert_eq!(read("", None), Ok(Finish::Unknown));
    }
}
