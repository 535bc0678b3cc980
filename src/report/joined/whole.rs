//! The report on one run of either experiment, with all its files: [`whole_report`].
//!
//! The report on one run of questions with choices, made from its records alone.

use std::path::Path;

use super::alerts::alerts;
use super::combine::{CombinedRuns, combine};
use super::listing::ReportFolder;
use super::own_answers::{self, WholeReport, with_summary, without_hidden_models};
use super::{enhancers, open};
use crate::error::Result;
use crate::files::write_with;
use crate::report::choice_report::ChoiceReport;
use crate::report::json::{SummaryRuns, summary};
use crate::report::markdown::MarkdownReport;
use crate::report::products::{PAGE, products};
use crate::report::short;
use crate::report::tables::{FLIPS, write_flips};
use crate::runs::outcome::{Outcome, ReportLength, StdoutFormat, Syntax};
use crate::runs::stored::{AnyRun, ShownModels, StoredRun, run_name};
use crate::store::Store;
use crate::types::manifests::RunManifest;
use crate::types::{ChoiceDetail, OpenDetail, Truths};
use darkqa_score::findings::Findings;

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
    let mut files = files(&report, &combined, SummaryRuns::One(runs[0].0, None))?;
    if !findings.first_failures.is_empty() {
        let mut rows = Vec::new();
        write_flips(&findings, &mut rows)?;
        files.push((FLIPS.to_owned(), rows));
    }
    Ok(WholeReport { files, markdown: markdown(&report, &runs, ReportLength::Summary) })
}

fn open_report(run: StoredRun<OpenDetail>) -> Result<WholeReport> {
    open::Scores::new(open::combine(vec![without_hidden_models(run)?])?)?.whole_report()
}

/// Writes the report and the manifest of a run into its folder.
pub(crate) fn write(store: &Store, mut run: StoredRun<ChoiceDetail>, show: StdoutFormat) -> Result<Outcome> {
    let manifest = run.manifest.clone();
    run.leave_out(ShownModels::Current);
    Ok(Outcome::wrote(
        store.folder(),
        manifest.status,
        write_report(&ReportFolder::Run(store), &manifest, &combine(vec![run])?, show)?,
    )
    .in_format(show))
}

/// Writes the report of one run into its folder; returns the text for standard output.
///
/// # Errors
/// If a file cannot be written.
pub(super) fn write_report(
    target: &ReportFolder<'_, ChoiceDetail>,
    manifest: &RunManifest,
    combined: &CombinedRuns,
    show: StdoutFormat,
) -> Result<String> {
    if combined.truths() == Truths::Unknown {
        return own_answers::write_report(target, manifest, combined, show);
    }
    let (folder, findings) = (target.path(), combined.findings());
    let report =
        ChoiceReport::new(&findings, alerts(combined, &findings)).with_enhancers(&enhancers::rows(&combined.runs));
    let files = files(&report, combined, SummaryRuns::One(manifest, None))?;
    write_flip_rows(&findings, folder)?;
    target.write(&files, manifest)?;
    let list = SummaryRuns::One(manifest, Some(folder));
    let text = text(&report, &[(manifest, folder)], list, show)?;
    if show.is_document() {
        return Ok(text);
    }
    let cost = match combined.runs.iter().find_map(|run| run.cost.as_ref()) {
        Some(cost) => format!("cost: {cost}\n"),
        None => String::new(),
    };
    let page = folder.join(PAGE).display().to_string();
    Ok(text + &cost + &format!("report: {page}\n"))
}

/// The files of a report, by name.
pub(super) fn files(
    report: &ChoiceReport<'_>,
    combined: &CombinedRuns,
    runs: SummaryRuns<'_>,
) -> Result<Vec<(String, Vec<u8>)>> {
    let products = products(report, &combined.page_inputs())?;
    let summary = summary(report, runs, ReportLength::Summary)?;
    Ok(with_summary(products, summary))
}

/// Writes the file with one row for each item into a folder; nothing if there are no such rows.
pub(super) fn write_flip_rows(findings: &Findings<'_>, folder: &Path) -> Result<()> {
    if findings.first_failures.is_empty() {
        return Ok(());
    }
    write_with(&folder.join(FLIPS), |out| write_flips(findings, out))
}

/// The text of a report for standard output. `list` has the same runs as `runs`, for JSON.
pub(super) fn text(
    report: &ChoiceReport<'_>,
    runs: &[(&RunManifest, &Path)],
    list: SummaryRuns<'_>,
    show: StdoutFormat,
) -> Result<String> {
    match show.syntax {
        Syntax::Text => Ok(short::text(report, runs, show.length)),
        Syntax::Markdown => Ok(markdown(report, runs, show.length)),
        Syntax::Json => summary(report, list, show.length),
    }
}

/// The report as Markdown.
pub(super) fn markdown(report: &ChoiceReport<'_>, runs: &[(&RunManifest, &Path)], length: ReportLength) -> String {
    let names = runs.iter().map(|(_, folder)| run_name(folder)).collect();
    MarkdownReport::for_choices(report, names, length).text()
}
