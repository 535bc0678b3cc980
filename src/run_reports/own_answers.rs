//! The report of runs whose questions have no true answers: each model against its own answers at L0.

use std::path::Path;

use super::alerts::alerts_without_truths;
use super::combine::{Combined, ties};
use super::enhancers;
use super::report_folder::ReportFolder;
use super::whole_report::{WholeReport, with_summary};
use crate::error::Result;
use crate::report::json::RunList;
use crate::report::markdown::MarkdownReport;
use crate::report::products::PAGE;
use crate::report::self_agreement::{AgreementReport, TextLength, products, summary, text};
use crate::runs::StdoutFormat;
use crate::runs::stored::name;
use crate::text::alert::Alert;
use crate::types::ChoiceDetail;
use crate::types::manifest::RunManifest;
use darkqa_score::self_agreement::SelfAgreement;

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
    let files = files(&report, combined, RunList::One(manifest, None))?;
    target.write(&files, manifest)?;
    let folder = target.path();
    let runs = [(manifest, folder)];
    Ok(match length(show) {
        None if show == StdoutFormat::Markdown => markdown(&report, &runs),
        None => summary(&report, RunList::One(manifest, Some(folder)))?,
        Some(length) => {
            let page = folder.join(PAGE);
            text(&report, &runs, length) + &format!("report: {}\n", page.display())
        }
    })
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
    let list = RunList::Several(&runs);
    let files = if wanted {
        files(&report, combined, list)?
    } else {
        Vec::new()
    };
    let text = match length(show) {
        None if show == StdoutFormat::Markdown => markdown(&report, &runs),
        None => summary(&report, list)?,
        Some(length) => text(&report, &runs, length),
    };
    Ok(ReportOutput { files, text })
}

/// The whole report of one run.
pub(super) fn whole(combined: &Combined) -> Result<WholeReport> {
    let found = found(combined);
    let report = report(combined, &found, &[]);
    let runs = combined.manifests();
    Ok(WholeReport {
        files: files(&report, combined, RunList::One(runs[0].0, None))?,
        markdown: markdown(&report, &runs),
    })
}

/// The files of a report by name.
fn files(
    report: &AgreementReport<'_>,
    combined: &Combined,
    runs: RunList<'_>,
) -> Result<Vec<(String, Vec<u8>)>> {
    let products = products(report, &combined.shown())?;
    Ok(with_summary(products, summary(report, runs)?))
}

fn found(combined: &Combined) -> SelfAgreement<'_> {
    SelfAgreement::new(
        &combined.trials,
        &ties(&combined.questions),
        &combined.questions,
        &combined.listing,
    )
    .for_set(combined.set())
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

fn markdown(report: &AgreementReport<'_>, runs: &[(&RunManifest, &Path)]) -> String {
    let names = runs.iter().map(|(_, folder)| name(folder)).collect();
    MarkdownReport::of_own_answers(report, names).text()
}

/// How much is printed; `None` for a document.
fn length(show: StdoutFormat) -> Option<TextLength> {
    match show {
        StdoutFormat::Findings => Some(TextLength::Findings),
        StdoutFormat::Short => Some(TextLength::Short),
        StdoutFormat::Full => Some(TextLength::Full),
        StdoutFormat::Markdown | StdoutFormat::Json => None,
    }
}
