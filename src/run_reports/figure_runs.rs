//! Runs whose figures are drawn: [`FigureRuns`].

use std::path::PathBuf;

use super::alerts::alerts;
use super::combine::{Combined, combine};
use super::runs::distinct;
use super::whole_report::no_records;
use crate::error::{Error, Result};
use crate::runs::run_parts::choice_run;
use crate::runs::stored::{ShownModels, StoredRun};
use crate::text::alert::Alert;
use crate::types::{ChoiceDetail, Thumbnail, Truths};
use darkqa_score::findings::Findings;

/// Runs of questions with choices, joined as the report joins them.
pub(crate) struct FigureRuns {
    combined: Combined,
    again: Vec<Alert>,
}

impl FigureRuns {
    /// Opens the runs of these folders.
    ///
    /// # Errors
    /// If a folder holds no such run or one without records, if the runs asked different questions, or if nobody knows the true answers.
    pub(crate) fn open(folders: &[PathBuf]) -> Result<Self> {
        let (folders, again) = distinct(folders);
        let runs = folders.into_iter().map(|folder| {
            let instead =
                "figures draws runs of questions with choices; `report` draws the figures of these";
            let mut run: StoredRun<ChoiceDetail> = choice_run(folder, instead)?;
            if run.trials.is_empty() {
                return Err(no_records(run.folder));
            }
            run.leave_out(ShownModels::Current);
            Ok(run)
        });
        let combined = combine(runs.collect::<Result<_>>()?)?;
        if combined.truths() == Truths::Unknown {
            let problem = "the figures are of accuracies, and nobody knows the true answers (--ask): `report` draws the figures of \
                           these runs";
            return Err(Error::usage("figures", problem));
        }
        Ok(Self { combined, again })
    }

    /// The results that follow from the records.
    pub(crate) fn findings(&self) -> Findings<'_> {
        self.combined.findings()
    }

    /// Alerts to read before any number.
    pub(crate) fn alerts(&self, findings: &Findings<'_>) -> Vec<Alert> {
        let mut all = self.again.clone();
        all.extend(alerts(&self.combined, findings));
        all
    }

    /// The small copies that the runs stored.
    pub(crate) fn thumbnails(&self) -> &[Thumbnail] {
        &self.combined.thumbnails
    }
}
