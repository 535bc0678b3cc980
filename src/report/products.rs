//! All files of a report: [`products`].

use super::figures::figures;
use super::page::{PageInputs, page};
use super::samples::{figure, samples};
use super::table::Table;
use super::{chart, csv, latex};
use crate::error::Result;
use crate::score::findings::Findings;

/// Files of a report by name: numbers as CSV, the main tables as LaTeX, figures as SVG, and the HTML page.
///
/// # Errors
/// If a file cannot be made.
pub fn products<'a>(
    findings: &'a Findings<'a>,
    tables: &[Table],
    inputs: &PageInputs<'a>,
) -> Result<Vec<(String, Vec<u8>)>> {
    let figures = figures(findings.shown())?;
    let page = page(findings.shown(), tables, &figures, inputs)?;
    let mut files = table_files(tables, "Tables")?;
    files.extend(chart::files(figures));
    if let Some(samples) = samples(inputs.thumbnails) {
        files.push((
            "figures/samples.svg".to_owned(),
            figure(&samples).into_bytes(),
        ));
    }
    files.push((PAGE.to_owned(), page.into_bytes()));
    Ok(files)
}

/// The tables as CSV files and one LaTeX file; `head` names them in the latter.
pub(super) fn table_files(tables: &[Table], head: &str) -> Result<Vec<(String, Vec<u8>)>> {
    let mut files = csv::files(tables)?;
    let tables = latex::tables(head, tables);
    files.push(("tables.tex".to_owned(), tables.into_bytes()));
    Ok(files)
}

/// File name of the HTML page.
pub(crate) const PAGE: &str = "report.html";
