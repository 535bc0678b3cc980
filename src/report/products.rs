//! Every file of a report: [`products`].

use super::figures::figures;
use super::page::{PageInputs, page};
use super::samples::{figure, samples};
use super::table::Table;
use super::{chart, csv, latex};
use crate::error::Result;
use crate::score::findings::Findings;

/// The files of a report by name: the numbers as CSV, the main tables as LaTeX, the figures as SVG, and the page.
///
/// # Errors
/// If one cannot be made.
pub fn products<'a>(
    findings: &'a Findings<'a>,
    tables: &[Table],
    shown: &PageInputs<'a>,
) -> Result<Vec<(String, Vec<u8>)>> {
    let figures = figures(findings)?;
    let page = page(findings, tables, &figures, shown)?;
    let mut files = numbers(tables, "Tables")?;
    files.extend(chart::files(figures));
    if let Some(samples) = samples(shown.thumbnails) {
        files.push((
            "figures/samples.svg".to_owned(),
            figure(&samples).into_bytes(),
        ));
    }
    files.push((PAGE.to_owned(), page.into_bytes()));
    Ok(files)
}

/// The tables as CSV and LaTeX.
pub(super) fn numbers(tables: &[Table], head: &str) -> Result<Vec<(String, Vec<u8>)>> {
    let mut files = csv::files(tables)?;
    let tables = latex::tables(head, tables);
    files.push(("tables.tex".to_owned(), tables.into_bytes()));
    Ok(files)
}

/// The name of the page.
pub(crate) const PAGE: &str = "report.html";
