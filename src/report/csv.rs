//! Tables as CSV: [`files`]. Numbers are written with all their digits.

use serde::{Serialize, Serializer};

use super::table::{Table, TableCell};
use super::tables::SUMMARY;
use crate::error::{Error, Result};

/// One field of a row. A number has as many digits as are needed to read it back without loss.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(untagged)]
pub(super) enum CsvField<'a> {
    None,
    Text(&'a str),
    Count(usize),
    /// A number as JSON writes it: `1.0`.
    Number(f64),
    /// A number without a decimal point if it is an integer: `1`. Infinity is `inf`.
    #[serde(serialize_with = "plain")]
    Plain(f64),
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "what serde calls it with"
)]
fn plain<S: Serializer>(number: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(number)
}

/// The fields of a cell: one for each name of its column.
pub(super) fn fields(cell: &TableCell, names: usize) -> impl Iterator<Item = CsvField<'_>> {
    let mut fields = [CsvField::None; 4];
    match cell {
        TableCell::Blank | TableCell::Absent | TableCell::Missing | TableCell::Unknown(_) => {}
        TableCell::Text(text) => fields[0] = CsvField::Text(text),
        TableCell::Count(count) => fields[0] = CsvField::Count(*count),
        TableCell::Number(number) => fields[0] = CsvField::Number(*number),
        TableCell::Significance(verdict) => {
            // `tied` stays for one release; the column `shown` says what it means.
            let word = if verdict.is_shown() {
                verdict.word()
            } else {
                "tied"
            };
            fields[0] = CsvField::Text(word);
            fields[1] = CsvField::Text(if verdict.is_shown() { "true" } else { "false" });
        }
        TableCell::Threshold(t, _) => {
            fields = [t.value, t.low, t.high, 0.0].map(CsvField::Number);
            fields[3] = CsvField::None;
        }
        TableCell::Estimate(e)
        | TableCell::Below(e)
        | TableCell::Guess(e)
        | TableCell::Strict(e, _)
        | TableCell::Changed(e, _) => {
            fields = [e.value, e.low, e.high, 0.0].map(CsvField::Number);
            fields[3] = CsvField::Count(e.n);
        }
    }
    fields.into_iter().take(names)
}

/// CSV files by name, of all tables that have CSV columns and at least one row. Tables of one name share one file.
///
/// # Errors
/// If one cannot be written.
pub(super) fn files(tables: &[Table]) -> Result<Vec<(String, Vec<u8>)>> {
    let mut files = Vec::new();
    for parts in tables.chunk_by(|table, next| table.name == next.name) {
        let table = csv(parts)?;
        if !table.is_empty() {
            files.push((format!("{}.csv", parts[0].name), table));
        }
    }
    Ok(files)
}

/// Tables with the same columns as one file: a header and rows. Empty if there is no row or no column.
///
/// # Errors
/// If the file cannot be written.
pub(super) fn csv(parts: &[Table]) -> Result<Vec<u8>> {
    let failed = |e: ::csv::Error| Error::data("CSV", e);
    let mut file = ::csv::Writer::from_writer(Vec::new());
    let mut has_header = false;
    for table in parts {
        let names = table.columns.iter().flat_map(|column| &column.heads.csv);
        for row in &table.rows {
            if names.clone().next().is_none() {
                break;
            }
            if !has_header {
                file.write_record(names.clone()).map_err(failed)?;
                has_header = true;
            }
            let cells = table.cells(row);
            let fields = cells.flat_map(|(column, cell)| fields(cell, column.heads.csv.len()));
            let fields = fields.map(|field| match field {
                // `summary.csv` and `summary.json` write numbers in the same way.
                CsvField::Number(number) if table.name != SUMMARY => CsvField::Plain(number),
                field => field,
            });
            let row: Vec<CsvField<'_>> = fields.collect();
            file.serialize(row).map_err(failed)?;
        }
    }
    file.into_inner().map_err(|e| Error::data("CSV", e))
}
