//! What the place of a trial among those of its run follows from: [`TrialLine`].

use serde::Deserialize;

use crate::types::{Condition, QuestionId, TrialKey};

/// What names a trial, of the line of its record.
#[derive(Debug, Deserialize)]
pub(crate) struct TrialLine {
    pub(crate) key: TrialKey,
    pub(crate) question: QuestionId,
    pub(crate) condition: Option<Condition>,
    /// The name of the model in the records.
    pub(crate) model: String,
    #[serde(default)]
    pub(crate) repeat: u32,
}
