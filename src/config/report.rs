//! What `report` is told.

use std::path::PathBuf;

use super::Show;
use crate::cli::ReportArgs;

/// Which readings a report rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Readings {
    /// Those in the records.
    Kept,
    /// Those that this version of the program makes of the kept replies.
    Anew,
}

/// Everything `report` is told.
#[derive(Debug)]
pub struct Report {
    /// The run folders.
    pub runs: Vec<PathBuf>,
    /// Where the report goes; `None` for the folder of the one run.
    pub out: Option<PathBuf>,
    /// Which readings count.
    pub readings: Readings,
    /// In what form on standard output.
    pub show: Show,
}

impl Report {
    /// What was said.
    #[must_use]
    pub fn resolve(said: ReportArgs) -> Self {
        Self {
            runs: said.runs,
            out: said.out,
            readings: if said.rescore {
                Readings::Anew
            } else {
                Readings::Kept
            },
            show: Show::said(said.json),
        }
    }
}
