//! The report of one run: [`WholeReport`].

use std::path::PathBuf;

use crate::error::{Error, Result};
use crate::runs::stored::{ShownModels, StoredRun};
use darkqa_score::answers::record::Detail;

/// Name of the file with the rows of the summary.
const SUMMARY_JSON: &str = "summary.json";

/// The report of one run.
pub(crate) struct WholeReport {
    /// The files by name, as `report` writes them into the folder of the run.
    pub(crate) files: Vec<(String, Vec<u8>)>,
    /// The findings and the table by level, as Markdown.
    pub(crate) markdown: String,
}

/// The products of a report, and its summary as JSON, by name.
pub(super) fn with_summary(
    mut products: Vec<(String, Vec<u8>)>,
    summary: String,
) -> Vec<(String, Vec<u8>)> {
    products.push((SUMMARY_JSON.to_owned(), summary.into_bytes()));
    products
}

/// A run without the models that a report leaves out.
///
/// # Errors
/// If the run has no record.
pub(super) fn shown<D: Detail>(mut run: StoredRun<D>) -> Result<StoredRun<D>> {
    if run.trials.is_empty() {
        return Err(no_records(run.folder));
    }
    run.leave_out(ShownModels::Current);
    Ok(run)
}

/// The error about a run without a record.
pub(super) fn no_records(path: PathBuf) -> Error {
    let problem = "the run has no records yet: nothing to report".to_owned();
    Error::Run { path, problem }
}
