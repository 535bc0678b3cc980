//! Removal of keys from a reply, in all texts of it that a record keeps: [`without_secrets`].

use super::secret::Scrub;
use crate::types::{Finish, Reply, TokenChances, TokenPosition};

/// The reply without keys that a server or a model repeats in it.
pub(super) fn without_secrets(reply: Reply, scrub: &Scrub) -> Reply {
    let scrubbed = |text: String| scrub.reply(text);
    Reply {
        text: scrubbed(reply.text),
        refusal: reply.refusal.map(scrubbed),
        served_model: reply.served_model.map(scrubbed),
        provider: reply.provider.map(scrubbed),
        finish: match reply.finish {
            // Shortened last: otherwise the first half of a key could remain.
            Finish::Other(reason) => Finish::Other(scrub.line(&reason)),
            finish => finish,
        }
        .shortened(),
        chances: reply.chances.map(|chances| without_keys(chances, scrubbed)),
        ..reply
    }
}

/// The likeliest tokens without keys.
fn without_keys(chances: TokenChances, scrubbed: impl Fn(String) -> String) -> TokenChances {
    let position = |position: TokenPosition| {
        let likeliest = position.likeliest.into_iter();
        let likeliest = likeliest.map(|(token, logprob)| (scrubbed(token), logprob));
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
