//! The reply of a model: [`Reply`].

use serde::{Deserialize, Serialize};

use super::observed::Observed;
use super::option_probabilities::TokenChances;
use super::stated_cost::{ServiceTier, StatedCost};

/// The reason why a model stopped.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Finish {
    /// The reply is complete.
    Stop,
    /// The token limit was reached.
    Length,
    /// A content filter stopped the reply.
    Filter,
    /// Another reason, in the server's words: of a complete reply if [`Finish::is_whole`], else of one that the server
    /// ended early.
    Other(String),
    /// Not reported by the server.
    Unknown,
}

impl Finish {
    /// Maximum length of a reason in a server's words, in characters; chosen.
    const MAX_REASON_CHARS: usize = 40;

    /// Words of replies that are complete and end in a way of their own: calls of tools (OpenAI, Anthropic), guesses of
    /// built-in models.
    const WHOLE: [&str; 4] = ["tool_calls", "function_call", "tool_use", "guess"];

    /// True if the reply is complete, so that an answer is looked for in a sentence, too. Of a reply that a filter, a
    /// limit or the server ended early, only a text that is an answer and nothing else counts.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        match self {
            Self::Stop | Self::Unknown => true,
            Self::Length | Self::Filter => false,
            Self::Other(word) => Self::WHOLE.contains(&&*Self::normalized(word)),
        }
    }

    /// A server's word in lower case, with underscores.
    #[must_use]
    pub fn normalized(word: &str) -> String {
        word.trim().to_ascii_lowercase().replace(['-', ' '], "_")
    }

    /// Shortens a reason in the server's words and removes its control characters.
    #[must_use]
    pub fn shorten(self) -> Self {
        match self {
            Self::Other(reason) => {
                let reason = reason.chars().filter(|c| !c.is_control()).take(Self::MAX_REASON_CHARS).collect();
                Self::Other(reason)
            }
            named => named,
        }
    }
}

/// The tokens that the server charged for a request; each number is `None` if the server did not report it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
pub struct Usage {
    /// The number of tokens in the prompt, image included.
    pub prompt_tokens: Option<u64>,
    /// The number of tokens in the reply, hidden reasoning included.
    pub completion_tokens: Option<u64>,
    /// The number of tokens of the prompt that the server had in its cache, which may cost less.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cached_tokens: Option<u64>,
    /// The total as the server stated it; not in the file if it stated none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub total_tokens: Option<u64>,
    /// The charge as the server stated it, in US dollars; not in the file if it stated none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<StatedCost>,
    /// The service tier as the server stated it; not in the file if it stated none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub service_tier: Option<ServiceTier>,
}

impl Usage {
    /// The sum of prompt and reply tokens; `None` if the server stated neither.
    #[must_use]
    pub fn total(&self) -> Option<u64> {
        let (prompt, completion) = (self.prompt_tokens, self.completion_tokens);
        (prompt.is_some() || completion.is_some()).then(|| prompt.unwrap_or(0).saturating_add(completion.unwrap_or(0)))
    }

    /// True if the server stated that it charges for the request: tokens, or a cost.
    #[must_use]
    pub fn is_charged(&self) -> bool {
        let is_cost = self.cost.is_some_and(|cost| cost.dollars() > 0.0);
        is_cost || self.total().is_some_and(|tokens| tokens > 0)
    }

    /// Adds two usages; a number is unknown if it is unknown in both. If only one has a cost, the tokens of the other
    /// one count at its cost per token.
    #[must_use]
    pub fn plus(self, more: Self) -> Self {
        Self {
            prompt_tokens: sum(self.prompt_tokens, more.prompt_tokens),
            completion_tokens: sum(self.completion_tokens, more.completion_tokens),
            cached_tokens: sum(self.cached_tokens, more.cached_tokens),
            total_tokens: sum(self.total_tokens, more.total_tokens),
            cost: match (self.cost, more.cost) {
                (Some(cost), Some(other)) => Some(cost.plus(other)),
                (Some(cost), None) => Some(extend(cost, self, more)),
                (None, Some(cost)) => Some(extend(cost, more, self)),
                (None, None) => None,
            },
            service_tier: self.service_tier.max(more.service_tier),
        }
    }
}

/// Cost of the requests of two usages, of which only `priced` has a cost: the same cost per token for both.
fn extend(cost: StatedCost, priced: Usage, other: Usage) -> StatedCost {
    let [known, added] = [priced, other].map(|usage| usage.total().unwrap_or(0) as f64);
    if known > 0.0 { cost.times((known + added) / known) } else { cost }
}

/// Adds two numbers of which each may be unknown.
fn sum(one: Option<u64>, other: Option<u64>) -> Option<u64> {
    match (one, other) {
        (Some(one), Some(other)) => Some(one.saturating_add(other)),
        (one, other) => one.or(other),
    }
}

/// Charged attempts without a reply, with their tokens; and requests for which the server stated no tokens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
pub struct LostAttempts {
    /// The number of attempts.
    pub attempts: u32,
    /// The tokens of all attempts.
    pub usage: Usage,
    /// Requests that may have been charged although the server stated no tokens, the request of the reply included.
    /// Absent in the file if there are none.
    #[serde(default, skip_serializing_if = "Unstated::is_none")]
    pub unstated: Unstated,
}

impl LostAttempts {
    /// True if no attempt was lost and the tokens of every request are known.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.attempts == 0 && self.unstated.is_none()
    }

    /// Adds an attempt without a reply; one that was not charged does not count.
    pub fn add(&mut self, usage: Option<Usage>) {
        if let Some(usage) = usage.filter(Usage::is_charged) {
            self.attempts += 1;
            self.usage = self.usage.plus(usage);
        }
    }

    /// Adds the attempts of two trials.
    #[must_use]
    pub fn plus(self, more: Self) -> Self {
        Self {
            attempts: self.attempts.saturating_add(more.attempts),
            usage: self.usage.plus(more.usage),
            unstated: self.unstated.plus(more.unstated),
        }
    }
}

/// Requests that may have been charged although the server stated no tokens, or not all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
pub struct Unstated {
    /// The number of requests.
    pub requests: u32,
    /// Upper bound of the prompt tokens that were not stated.
    pub prompt_tokens: u64,
    /// Upper bound of the reply tokens that were not stated, hidden reasoning included.
    pub completion_tokens: u64,
}

impl Unstated {
    /// True if the server stated the tokens of every request.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.requests == 0
    }

    /// Adds two counts.
    #[must_use]
    pub fn plus(self, more: Self) -> Self {
        Self {
            requests: self.requests.saturating_add(more.requests),
            prompt_tokens: self.prompt_tokens.saturating_add(more.prompt_tokens),
            completion_tokens: self.completion_tokens.saturating_add(more.completion_tokens),
        }
    }
}

/// One reply of a model, as it arrived.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reply {
    /// The text, with its parts joined and without hidden reasoning.
    pub text: String,
    /// The text of a refusal that came separately; no answer is read from it.
    pub refusal: Option<String>,
    /// The reason why the model stopped.
    pub finish: Finish,
    /// The tokens that the server charged; `None` if it did not report them.
    pub usage: Option<Usage>,
    /// The model's name in the server's reply.
    pub served_model: Option<String>,
    /// The provider that a router passed the request on to; `None` if the server names none.
    pub provider: Option<String>,
    /// The replica of the endpoint that replied; `None` if there is one address.
    pub endpoint: Option<usize>,
    /// The time from the first byte sent to the last byte received in the last try, in milliseconds.
    pub latency_ms: u64,
    /// The number of requests that were sent.
    pub attempts: u32,
    /// The earlier attempts that were charged and gave no reply.
    pub lost: LostAttempts,
    /// The observer's view of the frame; `None` for every other model.
    pub observed: Option<Observed>,
    /// The likeliest tokens; `None` if they were not requested or the server stated none.
    pub chances: Option<TokenChances>,
    /// True if another try may end in another way: the server's word for the end is not known, or the model thought and
    /// gave no answer. Not stored.
    pub may_heal: bool,
    /// The field with the only text of a reply without content; `None` for every other reply.
    pub other_field: Option<OtherField>,
}

/// A field of a response, other than that of the content, with its text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OtherField {
    /// The field: `reasoning_content`, the arguments of a tool call.
    pub name: String,
    /// The text.
    pub text: String,
}

impl Reply {
    /// A complete reply from this process, without cost.
    #[must_use]
    pub fn local(text: String) -> Self {
        Self {
            text,
            refusal: None,
            finish: Finish::Stop,
            usage: None,
            served_model: None,
            provider: None,
            endpoint: None,
            latency_ms: 0,
            attempts: 1,
            lost: LostAttempts::default(),
            observed: None,
            chances: None,
            may_heal: false,
            other_field: None,
        }
    }

    /// A reply without text that ended at the token limit, from a server that sent none of the text.
    #[must_use]
    pub fn empty_truncated(usage: Option<Usage>) -> Self {
        Self { finish: Finish::Length, usage, ..Self::local(String::new()) }
    }
}
