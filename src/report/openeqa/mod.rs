//! What a run of open questions leaves: [`products`], [`summary_json`], and what stands at its end: [`render`].

mod coverage;
mod figure;
mod open_report;
mod page;
mod tables;
mod upstream;

use std::fmt::Write;
use std::path::Path;

use serde::Serialize;

pub(crate) use open_report::{OpenReport, ReportedAnswer};
pub(crate) use tables::tables;

use self::coverage::coverage;
use crate::error::Result;
use crate::report::products::{PAGE, numbers};
use crate::report::table::Table;
use crate::report::{chart, json, terminal};
use crate::types::manifest::RunManifest;

/// The files of a run by name: the numbers as CSV, the table as LaTeX, the figures as SVG, answers and marks as upstream's own
/// files, and the page.
///
/// # Errors
/// If one cannot be made.
pub(crate) fn products(
    report: &OpenReport<'_>,
    tables: &[Table],
) -> Result<Vec<(String, Vec<u8>)>> {
    let figures = figure::figures(report)?;
    let page = page::page(report, tables, &figures)?;
    let mut made = numbers(tables, "Table")?;
    made.extend(chart::files(figures));
    made.extend(upstream::files(report)?);
    made.push((PAGE.to_owned(), page.into_bytes()));
    Ok(made)
}

/// What stands above the rows of `summary.json`.
#[derive(Serialize)]
struct Head<'a> {
    schema: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    folder: Option<&'a Path>,
    run: &'a RunManifest,
    judge: Option<&'a str>,
    protocol: String,
    clustered_by: &'static str,
    clusters: usize,
}

/// The summary as JSON: the run's manifest, who marked and how, and the rows of the CSV; with the folder if it is not itself in
/// there.
///
/// # Errors
/// If it cannot be written.
pub(crate) fn summary_json(
    report: &OpenReport<'_>,
    tables: &[Table],
    folder: Option<&Path>,
) -> Result<String> {
    let head = Head {
        schema: "darkqa.openeqa-summary/1",
        folder,
        run: report.manifest,
        judge: report.judge,
        protocol: report.protocol.to_string(),
        clustered_by: report.summary.unit,
        clusters: report.summary.clusters,
    };
    json::document(head, &tables[0])
}

/// What stands at the end of a run: how far it has come if it is not complete, scores by level, by split and by category, what they
/// rest on, and where it lies.
#[must_use]
pub(crate) fn render(report: &OpenReport<'_>, tables: &[Table], folder: &Path) -> String {
    let mut text = terminal::progress(report.manifest, "answers and marks there");
    match report.judge {
        Some(_) => text += &terminal::render(tables),
        None => text += "Nothing is marked: --judge NAME has the answers marked\n",
    }
    for line in coverage(report) {
        let _ = writeln!(text, "{line}");
    }
    let _ = writeln!(text, "run: {}", folder.display());
    let _ = writeln!(text, "report: {}", folder.join(PAGE).display());
    text
}
