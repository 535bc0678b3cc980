//! The report on runs without true answers, which compares each model with its own answers at L0.

use std::path::Path;

use super::alerts::alerts_without_truths;
use super::combine::{Combined, frame_ties};
use super::enhancers;
use super::report_folder::ReportFolder;
use super::whole_report::{WholeReport, with_summary};
use crate::error::Result;
use crate::report::json::SummaryRuns;
use crate::report::markdown::MarkdownReport;
use crate::report::products::PAGE;
use crate::report::self_agreement::{AgreementReport, products, summary, text};
use crate::report::text::alert::Alert;
use crate::runs::report_length::ReportLength;
use crate::runs::stored::run_name;
use crate::runs::{StdoutFormat, Syntax};
use crate::types::ChoiceDetail;
use crate::types::manifests::RunManifest;
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
    combined: &Combined,
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
    combined: &Combined,
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
pub(super) fn whole_report(combined: &Combined) -> Result<WholeReport> {
    let agreement = self_agreement(combined);
    let report = report(combined, &agreement, &[]);
    let runs = combined.manifests();
    Ok(WholeReport {
        files: files(&report, combined, SummaryRuns::One(runs[0].0, None))?,
        markdown: markdown(&report, &runs, ReportLength::Summary),
    })
}

/// The files of a report, by name.
fn files(report: &AgreementReport<'_>, combined: &Combined, runs: SummaryRuns<'_>) -> Result<Vec<(String, Vec<u8>)>> {
    let products = products(report, &combined.page_inputs())?;
    let summary = summary(report, runs, ReportLength::Summary)?;
    Ok(with_summary(products, summary))
}

fn self_agreement(combined: &Combined) -> SelfAgreement<'_> {
    SelfAgreement::new(&combined.trials, &frame_ties(&combined.questions), &combined.questions, &combined.listing)
        .with_set(combined.photographed_set())
}

fn report<'a>(
    combined: &Combined,
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
