//! Runs for the `figures` command: [`FigureRuns`].

use std::path::PathBuf;

use super::alerts::alerts;
use super::combine::{CombinedRuns, combine};
use super::command::distinct;
use super::written::without_hidden_models;
use crate::text::alert::Alert;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{Thumbnail, Truths};
use darkqa_runs::sharded_run::open_choice_run;
use darkqa_score::findings::Findings;

/// Runs of questions with choices, joined as `report` joins them.
pub struct FigureRuns {
    combined: CombinedRuns,
    duplicate_alerts: Vec<Alert>,
}

impl FigureRuns {
    /// Opens the runs of these folders.
    ///
    /// # Errors
    /// If a folder has no such run or no records, the runs asked different questions, or the true answers are unknown.
    pub fn open(folders: &[PathBuf]) -> Result<Self> {
        let (folders, duplicate_alerts) = distinct(folders);
        let runs = folders
            .into_iter()
            .map(|folder| {
                let problem = "figures draws runs of questions with choices; `report` draws the figures of these";
                without_hidden_models(open_choice_run(folder, problem)?)
            })
            .collect::<Result<_>>()?;
        let combined = combine(runs)?;
        if combined.truths() == Truths::Unknown {
            let problem = "the figures are of accuracies, and nobody knows the true answers (--ask): `report` draws the figures of \
                           these runs";
            return Err(Error::usage("figures", problem));
        }
        Ok(Self { combined, duplicate_alerts })
    }

    /// All results of the runs, computed from their records.
    pub fn findings(&self) -> Findings<'_> {
        self.combined.findings()
    }

    /// All alerts about the runs.
    pub fn alerts(&self, findings: &Findings<'_>) -> Vec<Alert> {
        let mut all = self.duplicate_alerts.clone();
        all.extend(alerts(&self.combined, findings));
        all
    }

    /// The thumbnails that the runs stored.
    pub fn thumbnails(&self) -> &[Thumbnail] {
        &self.combined.thumbnails
    }
}
