//! Report on open questions: its files ([`products`], [`summary_json`]) and its text for the terminal ([`render`]).

mod coverage;
mod figure;
mod items;
mod open_report;
mod page;
mod tables;
mod upstream;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use serde::Serialize;

pub(crate) use open_report::{OpenReport, ReportedAnswer};
pub(crate) use tables::tables;

pub(super) use self::coverage::coverage;
use crate::error::Result;
use crate::report::charts::chart;
use crate::report::json;
use crate::report::products::{PAGE, table_files};
use crate::report::text::alert::{Alert, lines};
use crate::report::text::noise_profiles::NoiseProfiles;
use crate::report::text::table::Table;
use crate::report::text::terminal;
use crate::report::text::wrapped::wrapped;
use crate::runs::report_length::ReportLength;
use crate::types::manifests::RunManifest;

/// Files of a run by name: numbers as CSV, the table as LaTeX, figures as SVG, answers and marks in upstream's format,
/// and the HTML page.
///
/// # Errors
/// If a file cannot be made.
pub(crate) fn products(report: &OpenReport<'_>, tables: &[Table]) -> Result<Vec<(String, Vec<u8>)>> {
    let figures = figure::figures(report)?;
    let page = page::page(report, tables, &figures)?;
    let mut files = table_files(tables, &[], "Table")?;
    files.extend(chart::svg_files(figures));
    files.extend(upstream::files(report)?);
    files.push((PAGE.to_owned(), page.into_bytes()));
    Ok(files)
}

/// Head of `summary.json`.
#[derive(Serialize)]
struct Head<'a> {
    schema: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    folder: Option<&'a Path>,
    run: &'a RunManifest,
    /// Further runs of the report, by name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    joined: BTreeMap<&'a str, &'a RunManifest>,
    judge: Option<&'a str>,
    protocol: String,
    clustered_by: &'static str,
    clusters: usize,
    /// Noise profiles of the noisy images.
    readings: NoiseProfiles,
    alerts: &'a [Alert],
}

/// Serializes the summary as JSON: manifest of the run, judge, protocol, and the rows of the CSV file. `folder` is the
/// run's folder if the summary is stored elsewhere.
///
/// # Errors
/// If the summary cannot be serialized.
pub(crate) fn summary_json(
    report: &OpenReport<'_>,
    tables: &[Table],
    folder: Option<&Path>,
    length: ReportLength,
) -> Result<String> {
    let head = Head {
        schema: "darkqa.openeqa-summary/1",
        folder,
        run: report.manifest,
        joined: report.runs.iter().skip(1).copied().collect(),
        judge: report.judge,
        protocol: report.protocol.to_string(),
        clustered_by: report.summary.unit,
        clusters: report.summary.clusters,
        readings: report.noise_profiles(),
        alerts: report.alerts,
    };
    json::document(head, &tables[0], tables, length)
}

/// Text of the report for the terminal: progress of an incomplete run, scores by level, split and category, number of
/// scored answers, and folders of the runs.
#[must_use]
pub(crate) fn render(report: &OpenReport<'_>, tables: &[Table], folders: &[&Path]) -> String {
    let mut text = lines(report.alerts);
    text += &terminal::progress(report.manifest, "answers and marks stored");
    match report.judge {
        Some(_) => text += &terminal::render(tables),
        None => text += "No answer is marked: name a judge with --judge NAME\n",
    }
    let open = report.noise_profiles().open_question();
    for line in coverage(report).into_iter().chain(open) {
        text += &wrapped("", &line, " ");
    }
    for folder in folders {
        let _ = writeln!(text, "run: {}", folder.display());
    }
    text
}
