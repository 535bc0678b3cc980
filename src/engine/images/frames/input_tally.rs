//! Thread-safe counts of changes made to images when they were read: [`InputTally`].

use std::sync::{Mutex, PoisonError};

use crate::engine::images::frames::source::warn_of_inputs;
use crate::types::{FrameId, InputNote, InputSummary};

/// Changes to the images of a command so far.
#[derive(Debug, Default)]
pub(crate) struct InputTally(Mutex<InputSummary>);

impl InputTally {
    /// Counts one image.
    pub(crate) fn add(&self, frame: &FrameId, note: &InputNote) {
        let mut summary = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        summary.add(frame, note);
    }

    /// Logs one warning per kind of change.
    pub(crate) fn warn(self) {
        let summary = self.0.into_inner();
        warn_of_inputs(&summary.unwrap_or_else(PoisonError::into_inner));
    }
}
