//! What `merge` is told.

use std::path::PathBuf;

use super::Show;
use crate::cli::MergeArgs;

/// Everything `merge` is told.
#[derive(Debug)]
pub struct Merge {
    /// The folders of the shards, or folders that hold them.
    pub runs: Vec<PathBuf>,
    /// The folder of the whole run.
    pub out: PathBuf,
    /// What is done where shards are missing.
    pub missing: Missing,
    /// In what form on standard output.
    pub show: Show,
}

/// What is done where shards are missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Missing {
    /// Nothing is merged.
    Refused,
    /// What there is is merged.
    PassedOver,
}

impl Merge {
    /// What was said.
    #[must_use]
    pub fn resolve(said: MergeArgs) -> Self {
        Self {
            runs: said.runs,
            out: said.out,
            missing: if said.partial {
                Missing::PassedOver
            } else {
                Missing::Refused
            },
            show: Show::said(said.json),
        }
    }
}
