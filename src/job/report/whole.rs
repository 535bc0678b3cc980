//! The whole report of one run, of either experiment: [`WholeReport`].

use super::alerts::alerts;
use super::combine::combine;
use super::runs::no_records;
use super::{enhancers, open, own_answers};
use crate::error::Result;
use crate::job::StdoutFormat;
use crate::job::stored::{AnyRun, ShownModels, StoredRun};
use crate::report::choice_report::ChoiceReport;
use crate::report::json::{RunList, summary};
use crate::report::products::products;
use crate::types::{ChoiceDetail, Detail, OpenDetail, Truths};

/// Name of the file with the rows of the summary.
pub(super) const SUMMARY_JSON: &str = "summary.json";

/// What a report of one run consists of.
pub(crate) struct WholeReport {
    /// The files by name, as `report` writes them into the folder of the run.
    pub(crate) files: Vec<(String, Vec<u8>)>,
    /// The findings and the table by level, as Markdown.
    pub(crate) markdown: String,
}

impl WholeReport {
    /// The report of a run with the models that it shows now.
    ///
    /// # Errors
    /// If the run has no record, or a record is broken.
    pub(crate) fn of(run: AnyRun) -> Result<Self> {
        match run {
            AnyRun::Choice(run) => of_choices(run),
            AnyRun::Open(run) => of_open(run),
        }
    }
}

fn of_choices(run: StoredRun<ChoiceDetail>) -> Result<WholeReport> {
    let combined = combine(vec![shown(run)?])?;
    if combined.truths() == Truths::Unknown {
        return own_answers::whole(&combined);
    }
    let findings = combined.findings();
    let report = ChoiceReport::new(&findings, alerts(&combined, &findings))
        .with_enhancers(&enhancers::rows(&combined.runs));
    let runs = combined.manifests();
    let mut files = products(&report, &combined.shown())?;
    let json = summary(&report, RunList::One(runs[0].0, None))?;
    files.push((SUMMARY_JSON.to_owned(), json.into_bytes()));
    Ok(WholeReport {
        files,
        markdown: super::choice::text(&report, &runs, StdoutFormat::Markdown),
    })
}

fn of_open(run: StoredRun<OpenDetail>) -> Result<WholeReport> {
    open::Scores::new(open::combine(vec![shown(run)?])?)?.whole()
}

/// A run without the models that a report leaves out.
pub(super) fn shown<D: Detail>(mut run: StoredRun<D>) -> Result<StoredRun<D>> {
    if run.records.is_empty() {
        return Err(no_records(run.folder));
    }
    run.leave_out(ShownModels::Current);
    Ok(run)
}
