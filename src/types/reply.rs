//! What a model said: [`Reply`].

use serde::{Deserialize, Serialize};

/// Why a model stopped speaking.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Finish {
    /// It was done.
    Stop,
    /// It ran into the token limit.
    Length,
    /// A content filter cut in.
    Filter,
    /// Another reason, in the server's words.
    Other(String),
    /// The server did not say.
    Unknown,
}

/// Tokens a request was charged for, where the server said so.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Usage {
    /// Tokens of the prompt, image included.
    pub prompt_tokens: Option<u64>,
    /// Tokens of the reply, hidden reasoning included.
    pub completion_tokens: Option<u64>,
}

impl Usage {
    /// All tokens, where any were told.
    #[must_use]
    pub fn total(&self) -> Option<u64> {
        let (prompt, completion) = (self.prompt_tokens, self.completion_tokens);
        (prompt.is_some() || completion.is_some())
            .then(|| prompt.unwrap_or(0).saturating_add(completion.unwrap_or(0)))
    }
}

/// One reply of a model, as it arrived.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reply {
    /// What it said, text parts joined; hidden reasoning left out.
    pub text: String,
    /// The words of a refusal that came apart from the text; never read for an answer.
    pub refusal: Option<String>,
    /// Why it stopped.
    pub finish: Finish,
    /// Tokens charged.
    pub usage: Option<Usage>,
    /// The model's name as the server gave it.
    pub served_model: Option<String>,
    /// From the first byte sent in the last try to the last received, in milliseconds.
    pub latency_ms: u64,
    /// How many requests it took.
    pub attempts: u32,
}

impl Reply {
    /// A reply that was made in process: complete, at no cost.
    #[must_use]
    pub fn local(text: String) -> Self {
        Self {
            text,
            refusal: None,
            finish: Finish::Stop,
            usage: None,
            served_model: None,
            latency_ms: 0,
            attempts: 1,
        }
    }
}
