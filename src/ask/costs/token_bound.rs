//! Upper bound on the tokens of a request: [`TokenBound`].

use crate::types::{Unstated, Usage};

/// Upper bound on the tokens of one request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct TokenBound {
    pub(crate) prompt: u64,
    /// Tokens of the reply, hidden reasoning included.
    pub(crate) reply: u64,
}

impl TokenBound {
    /// Returns the bound as the unreported tokens of one request.
    pub(crate) fn unstated(self) -> Unstated {
        Unstated { requests: 1, prompt_tokens: self.prompt, completion_tokens: self.reply }
    }

    /// Returns the bound on the counts that are missing from `usage`; reported counts become 0.
    ///
    /// Nothing is missing if the server states what it charges. Without prompt tokens (absent or 0), the server does
    /// not count tokens: 0 reply tokens are then also missing.
    pub(crate) fn missing_from(self, usage: Usage) -> Self {
        if usage.cost.is_some_and(|cost| cost.dollars() > 0.0) {
            return Self::default();
        }
        let prompt = usage.prompt_tokens.filter(|tokens| *tokens > 0);
        let reply = match (prompt, usage.completion_tokens) {
            (None, Some(0)) => None,
            (_, reply) => reply,
        };
        Self { prompt: prompt.map_or(self.prompt, |_| 0), reply: reply.map_or(self.reply, |_| 0) }
    }
}
