//! The whole report of one run, of either experiment: [`whole`].

use super::alerts::alerts;
use super::combine::combine;
use super::whole_report::{SUMMARY_JSON, WholeReport, shown};
use super::{enhancers, open, own_answers};
use crate::error::Result;
use crate::job::StdoutFormat;
use crate::job::stored::{AnyRun, StoredRun};
use crate::report::choice_report::ChoiceReport;
use crate::report::json::{RunList, summary};
use crate::report::products::products;
use crate::types::{ChoiceDetail, OpenDetail, Truths};

/// The report of a run with the models that it shows now.
///
/// # Errors
/// If the run has no record, or a record is broken.
pub(crate) fn whole(run: AnyRun) -> Result<WholeReport> {
    match run {
        AnyRun::Choice(run) => of_choices(run),
        AnyRun::Open(run) => of_open(run),
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
