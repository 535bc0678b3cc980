//! The whole report of one run, of either experiment: [`whole`].

use super::alerts::alerts;
use super::combine::combine;
use super::whole_report::{WholeReport, shown};
use super::{choice, enhancers, open, own_answers};
use crate::error::Result;
use crate::report::choice_report::ChoiceReport;
use crate::report::json::SummaryRuns;
use crate::report::report_length::ReportLength;
use crate::runs::stored::{AnyRun, StoredRun};
use crate::tables::{FLIPS, write_flips};
use crate::types::{ChoiceDetail, OpenDetail, Truths};

/// The report of a run with the models that it shows now.
///
/// # Errors
/// If the run has no record, or a record is broken.
pub(crate) fn whole(run: AnyRun) -> Result<WholeReport> {
    match run {
        AnyRun::Choice(run) => choice_report(run),
        AnyRun::Open(run) => open_report(run),
    }
}

fn choice_report(run: StoredRun<ChoiceDetail>) -> Result<WholeReport> {
    let combined = combine(vec![shown(run)?])?;
    if combined.truths() == Truths::Unknown {
        return own_answers::whole(&combined);
    }
    let findings = combined.findings();
    let report = ChoiceReport::new(&findings, alerts(&combined, &findings))
        .with_enhancers(&enhancers::rows(&combined.runs));
    let runs = combined.manifests();
    let mut files = choice::files(&report, &combined, SummaryRuns::One(runs[0].0, None))?;
    if !findings.first_failures.is_empty() {
        let mut rows = Vec::new();
        write_flips(&findings, &mut rows)?;
        files.push((FLIPS.to_owned(), rows));
    }
    Ok(WholeReport {
        files,
        markdown: choice::markdown(&report, &runs, ReportLength::Summary),
    })
}

fn open_report(run: StoredRun<OpenDetail>) -> Result<WholeReport> {
    open::Scores::new(open::combine(vec![shown(run)?])?)?.whole()
}
