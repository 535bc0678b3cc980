//! Token probabilities of a reply ([`TokenChances`]) and of the choices in a trial ([`OptionProbabilities`]).

use serde::{Deserialize, Serialize};

/// The likeliest tokens at the first positions of a reply.
#[derive(Debug, Clone, PartialEq)]
pub struct TokenChances {
    /// The positions, from the first token of the reply on.
    pub positions: Vec<TokenPosition>,
    /// Whether the model reasoned before it answered.
    pub thought: Thought,
}

/// One position of a reply.
#[derive(Debug, Clone, PartialEq)]
pub struct TokenPosition {
    /// The token that the model chose.
    pub token: String,
    /// The likeliest tokens with the natural logarithms of their probabilities; each token once, the chosen one among
    /// them.
    pub likeliest: Vec<(String, f64)>,
}

/// Whether reasoning came before the answer of a reply. If so, the reasoning decided the answer, and the probability of
/// its letter is not the model's confidence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Thought {
    /// The model reasoned first.
    Before,
    /// No reasoning was reported.
    None,
}

/// The probability that a model gave to each choice when it answered. All numbers are finite.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OptionProbabilities {
    /// The probability of each choice in the order shown; they add up to 1.
    pub p: Vec<f64>,
    /// The probability that the model gave to all tokens that name a choice, before it was scaled to 1.
    pub mass: f64,
    /// Upper bound of the probability of a choice whose token the server did not list, before scaling.
    pub bound: f64,
    /// The token that the model chose at the position of the answer.
    pub token: String,
    /// True if the model reasoned before the answer, so that no figure uses these numbers; not in the file otherwise.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reasoned: bool,
}

// None of their numbers is NaN.
impl Eq for TokenChances {}
impl Eq for OptionProbabilities {}

impl OptionProbabilities {
    /// The greatest probability of a choice: the model's confidence.
    #[must_use]
    pub fn confidence(&self) -> f64 {
        self.p.iter().copied().fold(0.0, f64::max)
    }
}
