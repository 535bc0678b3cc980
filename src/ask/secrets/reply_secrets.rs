//! The texts of a reply as a record keeps them, without keys and not too long: [`without_secrets`].

use super::secret::Scrub;
use crate::types::{Finish, Reply, TokenChances, TokenPosition};

/// The longest text of a reply that a record keeps, in bytes; chosen: four times a reply of 4,096 tokens.
const LONGEST: usize = 64 << 10;

/// The most bytes of the note in the place of what is not kept.
const NOTE: usize = 64;

/// The longest name of a model or provider, and the longest token, in bytes; chosen.
const LONGEST_NAME: usize = 200;

/// The reply without keys that a server or a model repeats in it, and with texts of bounded length.
pub(in crate::ask) fn without_secrets(reply: Reply, scrub: &Scrub) -> Reply {
    // Shortened last: otherwise a part of a key could remain.
    let text = |text: String| shortened(scrub.reply(text));
    let name = |mut name: String| {
        name = scrub.reply(name);
        name.truncate(name.floor_char_boundary(LONGEST_NAME));
        name
    };
    Reply {
        text: text(reply.text),
        refusal: reply.refusal.map(text),
        served_model: reply.served_model.map(name),
        provider: reply.provider.map(name),
        finish: match reply.finish {
            Finish::Other(reason) => Finish::Other(scrub.line(&reason)),
            finish => finish,
        }
        .shortened(),
        chances: reply.chances.map(|chances| without_keys(chances, name)),
        ..reply
    }
}

/// A text of at most [`LONGEST`] bytes. Of a longer one its beginning and its end are kept, because a long answer states its choice
/// at its end, with a note of the bytes between them.
fn shortened(text: String) -> String {
    if text.len() <= LONGEST {
        return text;
    }
    let half = (LONGEST - NOTE) / 2;
    let start = text.floor_char_boundary(half);
    let end = text.ceil_char_boundary(text.len() - half);
    let omitted = end - start;
    format!(
        "{}\n[… {omitted} bytes omitted …]\n{}",
        &text[..start],
        &text[end..]
    )
}

/// The likeliest tokens without keys.
fn without_keys(chances: TokenChances, scrubbed: impl Fn(String) -> String) -> TokenChances {
    let position = |position: TokenPosition| {
        let likeliest = position
            .likeliest
            .into_iter()
            .map(|(token, logprob)| (scrubbed(token), logprob));
        TokenPosition {
            likeliest: likeliest.collect(),
            token: scrubbed(position.token),
        }
    };
    TokenChances {
        positions: chances.positions.into_iter().map(position).collect(),
        ..chances
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_text_keeps_both_its_ends() {
        let kept = "é".repeat(LONGEST / 2);
        assert_eq!(shortened(kept.clone()), kept);
        let long = shortened(format!("start é{} the end", "é".repeat(LONGEST)));
        assert!(long.len() <= LONGEST, "{}", long.len());
        assert!(long.starts_with("start é") && long.ends_with("é the end"));
        assert!(long.contains("bytes omitted …]"));
        assert_eq!(shortened(long.clone()), long);
    }

    #[test]
    fn names_and_tokens_are_short_and_have_no_key() {
        let key = "sk-0123456789abcdef";
        let long = "x".repeat(LONGEST_NAME - 4) + key;
        let reply = Reply {
            served_model: Some(long.clone()),
            provider: Some(long),
            ..Reply::local(format!("{}{key}", "x".repeat(LONGEST)))
        };
        let reply = without_secrets(reply, &Scrub::new([key.to_owned()]));
        let names = [reply.served_model, reply.provider].map(Option::unwrap);
        for text in names.iter().chain([&reply.text]) {
            assert!(!text.contains("sk-"), "{text}");
        }
        assert_eq!(names[0].len(), LONGEST_NAME);
    }
}
