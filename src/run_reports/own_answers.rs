//! The report of runs whose questions have no true answers: each model against its own answers at L0.

use std::path::Path;

use super::alerts::alerts_without_truths;
use super::combine::{Combined, ties};
use super::enhancers;
use super::report_folder::ReportFolder;
use super::whole_report::{WholeReport, with_summary};
use crate::error::Result;
use crate::report::json::SummaryRuns;
use crate::report::markdown::MarkdownReport;
use crate::report::products::PAGE;
use crate::report::report_length::ReportLength;
use crate::report::self_agreement::{AgreementReport, products, summary, text};
use crate::runs::stored::name;
use crate::runs::{StdoutFormat, Syntax};
use crate::text::alert::Alert;
use crate::types::ChoiceDetail;
use crate::types::manifests::RunManifest;
use darkqa_score::comparisons::self_agreement::SelfAgreement;

/// The files of a report by name, and its text for standard output.
pub(super) struct ReportOutput {
    pub(super) files: Vec<(String, Vec<u8>)>,
    pub(super) text: String,
}

/// Writes the report and the manifest of a run into its folder; returns the text for standard output.
pub(super) fn in_its_folder(
    target: &ReportFolder<'_, ChoiceDetail>,
    manifest: &RunManifest,
    combined: &Combined,
    show: StdoutFormat,
) -> Result<String> {
    let found = found(combined);
    let report = report(combined, &found, &[]);
    let files = files(&report, combined, SummaryRuns::One(manifest, None))?;
    target.write(&files, manifest)?;
    let folder = target.path();
    let list = SummaryRuns::One(manifest, Some(folder));
    let text = shown(&report, &[(manifest, folder)], list, show)?;
    if show.is_document() {
        return Ok(text);
    }
    let page = folder.join(PAGE);
    Ok(text + &format!("report: {}\n", page.display()))
}

/// The report of several runs, or of one that is not written into its folder. The files are made only if they are `wanted`.
pub(super) fn compared(
    combined: &Combined,
    again: &[Alert],
    show: StdoutFormat,
    wanted: bool,
) -> Result<ReportOutput> {
    let found = found(combined);
    let report = report(combined, &found, again);
    let runs = combined.manifests();
    let list = SummaryRuns::Several(&runs);
    let files = if wanted {
        files(&report, combined, list)?
    } else {
        Vec::new()
    };
    let text = shown(&report, &runs, list, show)?;
    Ok(ReportOutput { files, text })
}

/// The whole report of one run.
pub(super) fn whole(combined: &Combined) -> Result<WholeReport> {
    let found = found(combined);
    let report = report(combined, &found, &[]);
    let runs = combined.manifests();
    Ok(WholeReport {
        files: files(&report, combined, SummaryRuns::One(runs[0].0, None))?,
        markdown: markdown(&report, &runs, ReportLength::Summary),
    })
}

/// The files of a report by name.
fn files(
    report: &AgreementReport<'_>,
    combined: &Combined,
    runs: SummaryRuns<'_>,
) -> Result<Vec<(String, Vec<u8>)>> {
    let products = products(report, &combined.shown())?;
    let summary = summary(report, runs, ReportLength::Summary)?;
    Ok(with_summary(products, summary))
}

fn found(combined: &Combined) -> SelfAgreement<'_> {
    SelfAgreement::new(
        &combined.trials,
        &ties(&combined.questions),
        &combined.questions,
        &combined.listing,
    )
    .with_set(combined.set())
}

fn report<'a>(
    combined: &Combined,
    found: &'a SelfAgreement<'a>,
    again: &[Alert],
) -> AgreementReport<'a> {
    let mut above = again.to_vec();
    above.extend(alerts_without_truths(combined, found));
    AgreementReport::new(found, above, &enhancers::rows(&combined.runs))
}

/// The text of a report for standard output; `list` are the same runs for JSON.
fn shown(
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

fn markdown(
    report: &AgreementReport<'_>,
    runs: &[(&RunManifest, &Path)],
    length: ReportLength,
) -> String {
    let names = runs.iter().map(|(_, folder)| name(folder)).collect();
    MarkdownReport::for_own_answers(report, names, length).text()
}
