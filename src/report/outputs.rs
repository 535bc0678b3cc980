//! The forms of a report: printed as text, Markdown or JSON ([`printed`]), and written as files with an HTML page
//! ([`files`]).

use std::fmt::Write;
use std::path::Path;

use crate::charts::chart;
use crate::charts::samples::{self, samples_of};
use crate::content::Report;
use crate::finding_groups::FindingGroups;
use crate::json::SummaryRuns;
use crate::markdown::markdown;
use crate::page::{PageInputs, page};
use crate::short::head_and_findings;
use crate::tables::{FLIPS, write_flips};
use crate::text::latex;
use crate::text::table;
use crate::text::terminal::{render, wrapped};
use darkqa_base::error::Result;
use darkqa_base::files::write_with;
use darkqa_runs::outcome::{ReportLength, StdoutFormat, Syntax};

/// File name of the HTML page.
pub const PAGE: &str = "report.html";

/// Name of the file with the summary.
const SUMMARY_JSON: &str = "summary.json";

/// The HTML page alone.
///
/// # Errors
/// If a figure or the page cannot be made.
pub fn html_page(report: &Report<'_>, inputs: &PageInputs<'_>) -> Result<String> {
    page(report, &report.measure.figures()?, inputs)
}

/// Files of the report by name: numbers as CSV, the main tables as LaTeX, figures as SVG, and the HTML page.
///
/// # Errors
/// If a file cannot be made.
pub fn products(report: &Report<'_>, inputs: &PageInputs<'_>) -> Result<Vec<(String, Vec<u8>)>> {
    let figures = report.measure.figures()?;
    let page = page(report, &figures, inputs)?;
    let mut files = table::files(&report.tables)?;
    let findings: Vec<String> =
        report.sentences.iter().map(|sentence| format!("{} ({})", sentence.text, sentence.detail)).collect();
    let tables = latex::tables(report.measure.latex_title(), &findings, &report.tables);
    files.push(("tables.tex".to_owned(), tables.into_bytes()));
    files.extend(chart::svg_files(figures));
    for samples in samples_of(inputs.thumbnails) {
        files.push((format!("figures/{}.svg", samples.name), samples::figure(&samples).into_bytes()));
    }
    files.extend(report.measure.files()?);
    files.push((PAGE.to_owned(), page.into_bytes()));
    Ok(files)
}

/// All files of the report by name: those of [`products`] and the summary as JSON.
///
/// # Errors
/// If a file cannot be made.
pub fn files(report: &Report<'_>, runs: SummaryRuns<'_>, inputs: &PageInputs<'_>) -> Result<Vec<(String, Vec<u8>)>> {
    let mut files = products(report, inputs)?;
    let summary = report.measure.json(report, runs, ReportLength::Summary)?;
    files.push((SUMMARY_JSON.to_owned(), summary.into_bytes()));
    Ok(files)
}

/// Name and contents of the file with one row for each item and curve; `None` without such rows.
///
/// # Errors
/// If the rows cannot be written.
pub fn first_failures(report: &Report<'_>) -> Result<Option<(String, Vec<u8>)>> {
    let Some(findings) = report.measure.first_failures() else {
        return Ok(None);
    };
    let mut rows = Vec::new();
    write_flips(findings, &mut rows)?;
    Ok(Some((FLIPS.to_owned(), rows)))
}

/// Writes the file with one row for each item and curve into a folder, and returns its name; `None` without such rows.
///
/// # Errors
/// If the file cannot be written.
pub fn write_first_failures(report: &Report<'_>, folder: &Path) -> Result<Option<&'static str>> {
    let Some(findings) = report.measure.first_failures() else {
        return Ok(None);
    };
    write_with(&folder.join(FLIPS), |out| write_flips(findings, out))?;
    Ok(Some(FLIPS))
}

/// The report for standard output. `folders` are those of its runs.
///
/// # Errors
/// If the summary cannot be serialized.
pub fn printed(report: &Report<'_>, runs: SummaryRuns<'_>, folders: &[&Path], show: StdoutFormat) -> Result<String> {
    match show.syntax {
        Syntax::Text => Ok(text(report, folders, show.length)),
        Syntax::Markdown => Ok(markdown(report, folders, show.length)),
        Syntax::Json => report.measure.json(report, runs, show.length),
    }
}

/// The report as text: findings, tables and folders of the runs.
fn text(report: &Report<'_>, folders: &[&Path], length: ReportLength) -> String {
    let groups = FindingGroups::new(&report.sentences);
    // Without findings, the facts are what a reader came for, and each has a line.
    let head = if report.measure.has_findings() { vec![report.head()] } else { report.facts.clone() };
    let mut text = head_and_findings(&head, &report.alerts, &groups, length, &report.how_to_read);
    match length {
        ReportLength::Findings if report.measure.has_findings() => return text,
        ReportLength::Full => text += &render(&report.tables),
        ReportLength::Findings | ReportLength::Summary => text += &report.measure.short_tables(report),
    }
    if let Some(question) = report.measure.profiles().open_question() {
        text += &wrapped(" ", &question, " ");
    }
    for folder in folders {
        let _ = writeln!(text, "run: {}", folder.display());
    }
    text
}
