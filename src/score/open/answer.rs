//! One answer and what came of it: [`ScoredAnswer`], [`AnswerOutcome`].

use crate::score::llm_match::points;
use crate::score::subject::Subject;

/// What came of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AnswerOutcome {
    /// It was not given yet, or it failed: not scored.
    Missing,
    /// It was given and not judged yet: not scored.
    Unjudged,
    /// The judge's reply has no mark in it: not scored.
    Unmarked,
    /// There is none: worth nothing, unjudged.
    Null,
    /// The judge's mark.
    Marked(i64),
}

impl AnswerOutcome {
    /// What it is worth, between 0 and 1; `None` where it is not scored.
    #[must_use]
    pub fn points(self) -> Option<f64> {
        match self {
            Self::Missing | Self::Unjudged | Self::Unmarked => None,
            Self::Null => Some(points(None)),
            Self::Marked(mark) => Some(points(Some(mark))),
        }
    }
}

/// One answer to one question.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoredAnswer {
    /// Whose it is.
    pub subject: Subject,
    /// The question's place among those asked.
    pub question: usize,
    /// What came of it.
    pub outcome: AnswerOutcome,
    /// Whether the protocol has cut it before it was judged.
    pub cut: bool,
}
