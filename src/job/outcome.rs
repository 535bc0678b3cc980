//! How a command ended: [`Outcome`].

use crate::types::manifest::Status;

/// How a command ended.
#[derive(Debug)]
pub struct Outcome {
    /// How far it came.
    pub status: Status,
    /// What belongs on standard output.
    pub output: String,
}
