//! What the place of a trial among those of its run follows from: [`TrialLine`].

use serde::Deserialize;

use darkqa_ground::types::{Condition, QuestionId, TrialKey};

/// What names a trial, of the line of its record.
#[derive(Debug, Deserialize)]
pub struct TrialLine {
    /// The key of the trial.
    pub key: TrialKey,
    /// The question that it asks.
    pub question: QuestionId,
    /// The condition of its image; `None` if it has none.
    pub condition: Option<Condition>,
    /// The name of the model in the records.
    pub model: String,
    /// Number of the repetition, from 0.
    #[serde(default)]
    pub repeat: u32,
}
