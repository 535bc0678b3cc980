//! Removal of keys from replies, and limits on the length of their texts: [`without_secrets`].

use super::secret::Scrub;
use crate::types::{Finish, OtherField, Reply, TokenChances, TokenPosition};

/// Maximum length of the text of a recorded reply, in bytes; chosen: four times a reply of 4,096 tokens.
const MAX_TEXT: usize = 64 << 10;

/// Maximum length of the note about omitted bytes, in bytes.
const MAX_NOTE: usize = 64;

/// Maximum length of the name of a model or provider, and of a token, in bytes; chosen.
const MAX_NAME: usize = 200;

/// Removes keys that a server or a model repeats in a reply, and limits the length of its texts.
pub(crate) fn without_secrets(reply: Reply, scrub: &Scrub) -> Reply {
    let name = |mut name: String| {
        name = scrub.reply(name);
        name.truncate(name.floor_char_boundary(MAX_NAME));
        name
    };
    Reply {
        // Shorten last: otherwise a part of a key could remain.
        text: shortened(scrub.reply(reply.text)),
        refusal: reply.refusal.map(|text| shortened(scrub.reply(text))),
        served_model: reply.served_model.map(name),
        provider: reply.provider.map(name),
        finish: match reply.finish {
            Finish::Other(reason) => Finish::Other(scrub.line(&reason)),
            finish => finish,
        }
        .shorten(),
        chances: reply.chances.map(|chances| map_tokens(chances, name)),
        other_field: reply
            .other_field
            .map(|field| OtherField { name: name(field.name), text: shortened(scrub.reply(field.text)) }),
        ..reply
    }
}

/// Cuts the middle of a text longer than [`MAX_TEXT`] and replaces it by a note. The end remains, because a long answer
/// states its choice there.
fn shortened(text: String) -> String {
    if text.len() <= MAX_TEXT {
        return text;
    }
    let half = (MAX_TEXT - MAX_NOTE) / 2;
    let start = text.floor_char_boundary(half);
    let end = text.ceil_char_boundary(text.len() - half);
    let omitted = end - start;
    format!("{}\n[… {omitted} bytes omitted …]\n{}", &text[..start], &text[end..])
}

/// Applies a function to all tokens.
fn map_tokens(chances: TokenChances, map: impl Fn(String) -> String) -> TokenChances {
    TokenChances {
        positions: chances
            .positions
            .into_iter()
            .map(|position| TokenPosition {
                likeliest: position.likeliest.into_iter().map(|(token, logprob)| (map(token), logprob)).collect(),
                token: map(position.token),
            })
            .collect(),
        ..chances
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_lose_their_middle() {
        let kept = "é".repeat(MAX_TEXT / 2);
        assert_eq!(shortened(kept.clone()), kept);
        let long = shortened(format!("start é{} the end", "é".repeat(MAX_TEXT)));
        assert!(long.len() <= MAX_TEXT, "{}", long.len());
        assert!(long.starts_with("start é") && long.ends_with("é the end"));
        assert!(long.contains("bytes omitted …]"));
        assert_eq!(shortened(long.clone()), long);
    }

    #[test]
    fn names_are_short_and_without_keys() {
        let key = "sk-0123456789abcdef";
        let long = "x".repeat(MAX_NAME - 4) + key;
        let reply = Reply {
            served_model: Some(long.clone()),
            provider: Some(long),
            ..Reply::local(format!("{}{key}", "x".repeat(MAX_TEXT)))
        };
        let reply = without_secrets(reply, &Scrub::new([key.to_owned()]));
        let names = [reply.served_model, reply.provider].map(Option::unwrap);
        for text in names.iter().chain([&reply.text]) {
            assert!(!text.contains("sk-"), "{text}");
        }
        assert_eq!(names[0].len(), MAX_NAME);
    }
}
