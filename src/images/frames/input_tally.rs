//! Counts of what was done to images when they were read, from several threads: [`InputTally`].

use std::sync::{Mutex, PoisonError};

use crate::images::frames::source::warn_of_inputs;
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

    /// Prints what was done, in one line for each thing.
    pub(crate) fn warn(self) {
        let summary = self.0.into_inner();
        warn_of_inputs(&summary.unwrap_or_else(PoisonError::into_inner));
    }
}
