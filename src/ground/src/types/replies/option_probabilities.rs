//! Token probabilities of a reply ([`TokenChances`]) and of the choices in a trial ([`OptionProbabilities`]).

use serde::{Deserialize, Serialize};

/// The likeliest tokens at the first positions of a reply.
#[derive(Debug, Clone, PartialEq)]
pub struct TokenChances {
    /// The positions, from the first token of the reply on.
    pub positions: Vec<TokenPosition>,
    /// Whether the model thought before it answered.
    pub thought: Thought,
}

/// One position of a reply.
#[derive(Debug, Clone, PartialEq)]
pub struct TokenPosition {
    /// The token that was chosen.
    pub token: String,
    /// The likeliest tokens with the natural logarithms of their probabilities; each token once, the chosen one among them.
    pub likeliest: Vec<(String, f64)>,
}

/// Whether a reply had reasoning before the answer. If so, the reasoning decided the answer, and a letter's probability tells little.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Thought {
    /// It had.
    Before,
    /// No reasoning was reported.
    None,
}

/// How likely a model held each choice when it answered. All numbers are finite.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OptionProbabilities {
    /// The probability of each choice in the order shown; they add up to 1.
    pub p: Vec<f64>,
    /// The probability that the model gave to all tokens that name a choice, before it was scaled to 1.
    pub mass: f64,
    /// The most that a choice can have whose token is not among the listed ones, before scaling.
    pub bound: f64,
    /// The token that was chosen at that position.
    pub token: String,
    /// Whether reasoning stood before the answer, so that no figure uses these numbers; not in the file if not.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reasoned: bool,
}

// No number of them is NaN.
impl Eq for TokenChances {}
impl Eq for OptionProbabilities {}

impl OptionProbabilities {
    /// The greatest probability of a choice: the model's confidence.
    #[must_use]
    pub fn confidence(&self) -> f64 {
        self.p.iter().copied().fold(0.0, f64::max)
    }
}
