//! Every file of a report: [`products`].

use super::figures::figures;
use super::page::{Shown, page};
use super::samples::{figure, samples};
use super::{csv, files, latex};
use crate::error::Result;
use crate::score::findings::Findings;

/// The files of a report by name: the numbers as CSV, the main tables as LaTeX, the figures as SVG, and the page.
///
/// # Errors
/// Where one cannot be made.
pub fn products<'a>(
    findings: &'a Findings<'a>,
    shown: &Shown<'a>,
) -> Result<Vec<(String, Vec<u8>)>> {
    let figures = figures(findings)?;
    let page = page(findings, &figures, shown)?;
    let mut files = vec![("summary.csv".to_owned(), files::csv(&findings.summary)?)];
    let tables = csv::tables(findings)?.into_iter();
    files.extend(tables.map(|(name, table)| (name.to_owned(), table)));
    files.push((
        "tables.tex".to_owned(),
        latex::tables(findings).into_bytes(),
    ));
    let drawn = figures.into_iter();
    files.extend(drawn.map(|figure| {
        (
            format!("figures/{}.svg", figure.name),
            figure.svg.into_bytes(),
        )
    }));
    if let Some(samples) = samples(shown.thumbnails) {
        files.push((
            "figures/samples.svg".to_owned(),
            figure(&samples).into_bytes(),
        ));
    }
    files.push((PAGE.to_owned(), page.into_bytes()));
    Ok(files)
}

/// The name of the page.
pub const PAGE: &str = "report.html";
