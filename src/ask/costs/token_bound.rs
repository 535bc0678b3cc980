//! Upper bounds of the tokens of a request: [`TokenBound`].

use crate::types::{Unstated, Usage};

/// Upper bounds of the tokens of one request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct TokenBound {
    pub(crate) prompt: u64,
    /// Tokens of the reply, hidden reasoning included.
    pub(crate) reply: u64,
}

impl TokenBound {
    /// One request with these tokens, none of which the server stated.
    pub(crate) fn unstated(self) -> Unstated {
        Unstated {
            requests: 1,
            prompt_tokens: self.prompt,
            completion_tokens: self.reply,
        }
    }

    /// The part of the bound that a server leaves open with these stated tokens. A server that states no token of a prompt does not
    /// count tokens.
    pub(crate) fn missing_from(self, usage: Usage) -> Self {
        let prompt = usage.prompt_tokens.filter(|tokens| *tokens > 0);
        let reply = match (prompt, usage.completion_tokens) {
            (None, Some(0)) => None,
            (_, reply) => reply,
        };
        Self {
            prompt: prompt.map_or(self.prompt, |_| 0),
            reply: reply.map_or(self.reply, |_| 0),
        }
    }
}
