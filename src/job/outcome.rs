//! How a command ended: [`Outcome`].

use crate::types::manifest::Status;

/// How a command ended.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// How far it came.
    pub status: Status,
    /// What belongs on standard output.
    pub output: String,
}

/// What standard output gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StdoutFormat {
    /// A table.
    Table,
    /// The summary as JSON.
    Json,
}

impl StdoutFormat {
    /// What the switch `--json` asks for.
    #[must_use]
    pub(crate) fn of(json: bool) -> Self {
        if json { Self::Json } else { Self::Table }
    }
}
