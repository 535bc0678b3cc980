//! The result of a command: [`Outcome`].

use crate::types::manifest::Status;

/// The status and output of a command that has ended.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// Status that decides the exit code.
    pub status: Status,
    /// Text for standard output.
    pub output: String,
}

/// Format of the results on standard output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StdoutFormat {
    Table,
    Json,
}

impl StdoutFormat {
    /// The format for the switch `--json`.
    #[must_use]
    pub(crate) fn of(json: bool) -> Self {
        if json { Self::Json } else { Self::Table }
    }
}
