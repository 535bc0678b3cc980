//! The curves of a run's story figure: [`story_curves`].

use super::combine::combine;
use crate::error::Result;
use crate::report::charts::figures::{self, StoryCurves};
use crate::runs::stored::StoredRun;
use crate::types::ChoiceDetail;

/// The curves of a run; `None` if no model was shown a dark image.
///
/// # Errors
/// If a record of the run has no true choice.
pub(crate) fn story_curves(run: StoredRun<ChoiceDetail>) -> Result<Option<StoryCurves>> {
    Ok(figures::story_curves(combine(vec![run])?.findings().shown()))
}
