//! The reason why a model stopped, from a server's word: [`read`], by `finish_reasons.toml`.

use std::sync::LazyLock;

use serde::Deserialize;

use crate::ask::failures::Unreadable;
use crate::types::{Finish, Usage};

/// The words of servers, by their meaning.
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

static REASONS: LazyLock<Reasons> =
    LazyLock::new(|| toml::from_str(include_str!("finish_reasons.toml")).unwrap_or_default());

/// The reason in a server's word; none is [`Finish::Unknown`].
///
/// # Errors
/// If the word states that the generation did not come to its end, or if it is not known. `usage` is what it was charged.
pub(super) fn read(word: &str, usage: Option<Usage>) -> Result<Finish, Unreadable> {
    let name = word.trim().to_ascii_lowercase().replace('-', "_");
    let reasons = &*REASONS;
    let is_in = |list: &[String]| list.contains(&name);
    match () {
        () if name.is_empty() => Ok(Finish::Unknown),
        () if is_in(&reasons.stop) => Ok(Finish::Stop),
        () if is_in(&reasons.other) => Ok(Finish::Other(word.to_owned())),
        () if is_in(&reasons.length) => Ok(Finish::Length),
        () if is_in(&reasons.filter) => Ok(Finish::Filter),
        () if is_in(&reasons.context) => Err(Unreadable {
            usage,
            is_final: true,
            finish: Some(word.to_owned()),
            ..Unreadable::new(format!(
                "a reply that ended at the model's context length: its finish_reason is {word:?} (send smaller images: --image max-side=N, or a \
                 smaller --max-tokens)"
            ))
        }),
        () if is_in(&reasons.broken) => Err(Unreadable {
            usage,
            finish: Some(word.to_owned()),
            ..Unreadable::new(format!(
                "a reply that broke off: its finish_reason is {word:?}"
            ))
        }),
        () => Err(Unreadable {
            usage,
            finish: Some(word.to_owned()),
            ..Unreadable::new(format!(
                "a reply whose finish_reason {word:?} is not known, so that it may have broken off"
            ))
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_servers_have_one_meaning_each() {
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
    fn a_generation_that_was_given_up_is_no_reply() {
        for word in [
            "abort",
            "Cancelled",
            "network_error",
            "insufficient-system-resource",
            "MALFORMED_FUNCTION_CALL",
        ] {
            let broken = read(word, None).unwrap_err();
            assert!(
                !broken.is_final && broken.what.contains("broke off"),
                "{word}"
            );
        }
        assert!(
            read("model_context_window_exceeded", None)
                .unwrap_err()
                .is_final
        );
        let unknown = read("zeitgeist", None).unwrap_err();
        assert!(unknown.what.contains("\"zeitgeist\" is not known"));
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
