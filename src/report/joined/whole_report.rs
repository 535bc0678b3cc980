//! The report on one run, with all its files: [`WholeReport`].

use std::path::PathBuf;

use crate::error::{Error, Result};
use crate::runs::stored::{ShownModels, StoredRun};
use darkqa_score::answers::record::Detail;

/// Name of the file with the summary.
const SUMMARY_JSON: &str = "summary.json";

/// The report on one run.
pub(crate) struct WholeReport {
    /// Names and contents of the files that `report` writes into the folder of the run.
    pub(crate) files: Vec<(String, Vec<u8>)>,
    /// The findings and the table by level, as Markdown.
    pub(crate) markdown: String,
}

/// Adds the summary as JSON to the files of a report.
pub(super) fn with_summary(mut products: Vec<(String, Vec<u8>)>, summary: String) -> Vec<(String, Vec<u8>)> {
    products.push((SUMMARY_JSON.to_owned(), summary.into_bytes()));
    products
}

/// Removes the models that a report leaves out by default.
///
/// # Errors
/// If the run has no records.
pub(super) fn without_hidden_models<D: Detail>(mut run: StoredRun<D>) -> Result<StoredRun<D>> {
    if run.trials.is_empty() {
        return Err(no_records(run.folder));
    }
    run.leave_out(ShownModels::Current);
    Ok(run)
}

/// The error for a run without records.
pub(super) fn no_records(path: PathBuf) -> Error {
    let problem = "the run has no records yet: nothing to report".to_owned();
    Error::Run { path, problem }
}
