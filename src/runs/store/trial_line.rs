//! [`TrialLine`]: the fields of a record that identify its trial.

use serde::Deserialize;

use darkqa_base::types::{Condition, QuestionId, TrialKey};

/// Fields of a record's line that identify the trial.
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
