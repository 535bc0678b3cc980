//! The report on one run of either experiment, with all its files: [`whole_report`].

use super::alerts::alerts;
use super::combine::combine;
use super::whole_report::{WholeReport, without_hidden_models};
use super::{choice, enhancers, open, own_answers};
use crate::error::Result;
use crate::report::choice_report::ChoiceReport;
use crate::report::json::SummaryRuns;
use crate::report::tables::{FLIPS, write_flips};
use crate::runs::report_length::ReportLength;
use crate::runs::stored::{AnyRun, StoredRun};
use crate::types::{ChoiceDetail, OpenDetail, Truths};

/// The report on a run, without the models that are no longer in the models file.
///
/// # Errors
/// If the run has no record, or a record is broken.
pub(crate) fn whole_report(run: AnyRun) -> Result<WholeReport> {
    match run {
        AnyRun::Choice(run) => choice_report(run),
        AnyRun::Open(run) => open_report(run),
    }
}

fn choice_report(run: StoredRun<ChoiceDetail>) -> Result<WholeReport> {
    let combined = combine(vec![without_hidden_models(run)?])?;
    if combined.truths() == Truths::Unknown {
        return own_answers::whole_report(&combined);
    }
    let findings = combined.findings();
    let report =
        ChoiceReport::new(&findings, alerts(&combined, &findings)).with_enhancers(&enhancers::rows(&combined.runs));
    let runs = combined.manifests();
    let mut files = choice::files(&report, &combined, SummaryRuns::One(runs[0].0, None))?;
    if !findings.first_failures.is_empty() {
        let mut rows = Vec::new();
        write_flips(&findings, &mut rows)?;
        files.push((FLIPS.to_owned(), rows));
    }
    Ok(WholeReport { files, markdown: choice::markdown(&report, &runs, ReportLength::Summary) })
}

fn open_report(run: StoredRun<OpenDetail>) -> Result<WholeReport> {
    open::Scores::new(open::combine(vec![without_hidden_models(run)?])?)?.whole_report()
}
