//! Open answers and their outcomes: [`ScoredAnswer`], [`AnswerOutcome`].

use crate::choice::llm_match::points;
use crate::model_in_condition::ModelInCondition;

/// Outcome of an open answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AnswerOutcome {
    /// The answer is missing so far, or the trial failed. Not scored.
    Missing,
    /// The answer is not judged yet. Not scored.
    Unjudged,
    /// The judge's reply has no mark. Not scored.
    Unmarked,
    /// A null answer, which gets 0 points without a judge.
    Null,
    /// The mark from the judge's reply, before it is clipped to 1 to 5.
    Marked(i64),
}

impl AnswerOutcome {
    /// Points between 0 and 1; `None` if the answer is not scored.
    #[must_use]
    pub fn points(self) -> Option<f64> {
        match self {
            Self::Missing | Self::Unjudged | Self::Unmarked => None,
            Self::Null => Some(points(None)),
            Self::Marked(mark) => Some(points(Some(mark))),
        }
    }
}

/// One answer of one subject to one question.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoredAnswer {
    /// Model and condition that gave the answer.
    pub subject: ModelInCondition,
    /// Index of the question among those asked.
    pub question: usize,
    /// Outcome of the answer.
    pub outcome: AnswerOutcome,
    /// True if the protocol shortened the answer before it was judged.
    pub cut: bool,
}
