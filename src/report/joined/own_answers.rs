//! The report on runs without true answers, which compares each model with its own answers at L0.
//!
//! The report on one run, with all its files: [`WholeReport`].

use std::path::{Path, PathBuf};

use super::alerts::alerts_without_truths;
use super::combine::{CombinedRuns, frame_ties};
use super::enhancers;
use super::listing::ReportFolder;
use crate::error::{Error, Result};
use crate::report::json::SummaryRuns;
use crate::report::markdown::MarkdownReport;
use crate::report::products::PAGE;
use crate::report::self_agreement::{AgreementReport, products, summary, text};
use crate::report::text::alert::Alert;
use crate::runs::outcome::ReportLength;
use crate::runs::stored::{ShownModels, StoredRun, run_name};
use crate::runs::{StdoutFormat, Syntax};
use crate::types::ChoiceDetail;
use crate::types::manifests::RunManifest;
use darkqa_score::answers::record::Detail;
use darkqa_score::comparisons::self_agreement::SelfAgreement;

/// The files of a report, by name, and its text for standard output.
pub(super) struct ReportOutput {
    pub(super) files: Vec<(String, Vec<u8>)>,
    pub(super) text: String,
}

/// Writes the report and the manifest of a run into its folder; returns the text for standard output.
pub(super) fn write_report(
    target: &ReportFolder<'_, ChoiceDetail>,
    manifest: &RunManifest,
    combined: &CombinedRuns,
    show: StdoutFormat,
) -> Result<String> {
    let agreement = self_agreement(combined);
    let report = report(combined, &agreement, &[]);
    let files = files(&report, combined, SummaryRuns::One(manifest, None))?;
    target.write(&files, manifest)?;
    let folder = target.path();
    let list = SummaryRuns::One(manifest, Some(folder));
    let text = stdout_text(&report, &[(manifest, folder)], list, show)?;
    if show.is_document() {
        return Ok(text);
    }
    let page = folder.join(PAGE);
    Ok(text + &format!("report: {}\n", page.display()))
}

/// The report on several runs, or on one whose report is not written into its folder. The files are empty unless
/// `with_files` is set.
pub(super) fn report_output(
    combined: &CombinedRuns,
    duplicate_alerts: &[Alert],
    show: StdoutFormat,
    with_files: bool,
) -> Result<ReportOutput> {
    let agreement = self_agreement(combined);
    let report = report(combined, &agreement, duplicate_alerts);
    let runs = combined.manifests();
    let list = SummaryRuns::Several(&runs);
    let files = if with_files { files(&report, combined, list)? } else { Vec::new() };
    let text = stdout_text(&report, &runs, list, show)?;
    Ok(ReportOutput { files, text })
}

/// The report on one run, with all its files.
pub(super) fn whole_report(combined: &CombinedRuns) -> Result<WholeReport> {
    let agreement = self_agreement(combined);
    let report = report(combined, &agreement, &[]);
    let runs = combined.manifests();
    Ok(WholeReport {
        files: files(&report, combined, SummaryRuns::One(runs[0].0, None))?,
        markdown: markdown(&report, &runs, ReportLength::Summary),
    })
}

/// The files of a report, by name.
fn files(
    report: &AgreementReport<'_>,
    combined: &CombinedRuns,
    runs: SummaryRuns<'_>,
) -> Result<Vec<(String, Vec<u8>)>> {
    let products = products(report, &combined.page_inputs())?;
    let summary = summary(report, runs, ReportLength::Summary)?;
    Ok(with_summary(products, summary))
}

fn self_agreement(combined: &CombinedRuns) -> SelfAgreement<'_> {
    SelfAgreement::new(&combined.trials, &frame_ties(&combined.questions), &combined.questions, &combined.listing)
        .with_set(combined.photographed_set())
}

fn report<'a>(
    combined: &CombinedRuns,
    agreement: &'a SelfAgreement<'a>,
    duplicate_alerts: &[Alert],
) -> AgreementReport<'a> {
    let mut alerts = duplicate_alerts.to_vec();
    alerts.extend(alerts_without_truths(combined, agreement));
    AgreementReport::new(agreement, alerts, &enhancers::rows(&combined.runs))
}

/// The text of a report for standard output. `list` has the same runs as `runs`, for JSON.
fn stdout_text(
    report: &AgreementReport<'_>,
    runs: &[(&RunManifest, &Path)],
    list: SummaryRuns<'_>,
    show: StdoutFormat,
) -> Result<String> {
    match show.syntax {
        Syntax::Text => Ok(text(report, runs, show.length)),
        Syntax::Markdown => Ok(markdown(report, runs, show.length)),
        Syntax::Json => summary(report, list, show.length),
    }
}

fn markdown(report: &AgreementReport<'_>, runs: &[(&RunManifest, &Path)], length: ReportLength) -> String {
    let names = runs.iter().map(|(_, folder)| run_name(folder)).collect();
    MarkdownReport::for_own_answers(report, names, length).text()
}

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
