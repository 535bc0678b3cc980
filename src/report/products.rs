//! Files of a report: [`products`].

use crate::error::Result;
use crate::report::charts::chart::{self, Figure};
use crate::report::charts::figures::{DisplayNames, figure_specs};
use crate::report::charts::paper::figure;
use crate::report::charts::samples::{self, samples_of};
use crate::report::charts::views;
use crate::report::choice_report::ChoiceReport;
use crate::report::page::{PageInputs, page};
use crate::report::sentences::Sentence;
use crate::report::text::latex;
use crate::report::text::table::{self, Table};

/// Files of a report by name: numbers as CSV, the main tables as LaTeX, figures as SVG, and the HTML page.
///
/// # Errors
/// If a file cannot be made.
pub fn products<'a>(report: &'a ChoiceReport<'a>, inputs: &PageInputs<'a>) -> Result<Vec<(String, Vec<u8>)>> {
    let figures: Vec<Figure> = figure_specs(report.findings, &DisplayNames::default())
        .into_iter()
        .chain(views::figure_specs(report.findings))
        .map(|spec| figure(spec.name, &spec.caption, &spec.chart))
        .collect::<Result<_>>()?;
    let page = page(report, &figures, inputs)?;
    files(&report.tables, &report.sentences, figures, page, inputs)
}

/// Files of tables, figures, sample images and the page.
pub(super) fn files(
    tables: &[Table],
    sentences: &[Sentence],
    figures: Vec<Figure>,
    page: String,
    inputs: &PageInputs<'_>,
) -> Result<Vec<(String, Vec<u8>)>> {
    let mut files = table_files(tables, sentences, "Findings and tables")?;
    files.extend(chart::svg_files(figures));
    for samples in samples_of(inputs.thumbnails) {
        let name = format!("figures/{}.svg", samples.name);
        files.push((name, samples::figure(&samples).into_bytes()));
    }
    files.push((PAGE.to_owned(), page.into_bytes()));
    Ok(files)
}

/// Tables as CSV files, and as one LaTeX file that starts with the findings; `head` is the title of the LaTeX file.
pub(super) fn table_files(tables: &[Table], sentences: &[Sentence], head: &str) -> Result<Vec<(String, Vec<u8>)>> {
    let mut files = table::files(tables)?;
    let findings: Vec<String> =
        sentences.iter().map(|sentence| format!("{} ({})", sentence.text, sentence.detail)).collect();
    let tables = latex::tables(head, &findings, tables);
    files.push(("tables.tex".to_owned(), tables.into_bytes()));
    Ok(files)
}

/// File name of the HTML page.
pub(crate) const PAGE: &str = "report.html";
