//! Tables as CSV: [`files`], and [`safe`] texts in them. Numbers are written with all their digits.

use std::borrow::{Borrow, Cow};
use std::io::Write;

use serde::{Serialize, Serializer};

use crate::error::{Error, Result};
use crate::text::table::{SUMMARY, Table, TableCell};
use crate::types::text::{escape_where, is_hidden};

/// One field of a row. A number has as many digits as are needed to read it back without loss.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(untagged)]
pub(crate) enum CsvField<'a> {
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
pub(crate) fn fields(cell: &TableCell, names: usize) -> impl Iterator<Item = CsvField<'_>> {
    let mut fields = [CsvField::None; 4];
    match cell {
        TableCell::Blank | TableCell::Absent | TableCell::Missing | TableCell::Unknown(_) => {}
        TableCell::Text(text) => fields[0] = CsvField::Text(text),
        TableCell::Count(count) => fields[0] = CsvField::Count(*count),
        TableCell::Number(number) => fields[0] = CsvField::Number(*number),
        TableCell::Significance(verdict) => {
            // `tied` stays for one release; the column `shown` states what it means.
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
        | TableCell::Changed(e, _)
        | TableCell::Effect(e, _) => {
            fields = [e.value, e.low, e.high, 0.0].map(CsvField::Number);
            fields[3] = CsvField::Count(e.n);
        }
    }
    fields.into_iter().take(names)
}

/// A text as it stands in a cell of a CSV file, so that no spreadsheet runs it as a formula.
///
/// A spreadsheet takes what begins with `=`, `+`, `-`, `@`, a tab or a carriage return for a formula, also after spaces, and also where the
/// cell is quoted (OWASP, “CSV Injection”). Such a text gets an apostrophe in front, and so does one that begins with apostrophes and such a
/// letter, so that taking one apostrophe away gives the text back. A number is no formula and stays. Tabs and hidden characters are
/// written as `⟨U+001B⟩`; line breaks stay.
pub(crate) fn safe(text: &str) -> Cow<'_, str> {
    // A tab within a cell moves some readers to the next.
    let shown = escape_where(text, |c| c == '\t' || is_hidden(c));
    if begins_formula(text) {
        Cow::Owned(format!("'{shown}"))
    } else {
        shown
    }
}

/// Whether a spreadsheet may run a text as a formula, with or without apostrophes before it.
fn begins_formula(text: &str) -> bool {
    let begins = text.trim_start_matches([' ', '\u{a0}', '\u{3000}', '\n', '\'']);
    let is_sign = |c: char| {
        let full_width = ['＝', '＋', '－', '＠'];
        ['=', '+', '-', '@', '\t', '\r'].contains(&c) || full_width.contains(&c)
    };
    begins.starts_with(is_sign) && !is_number(text)
}

/// Whether a text is a number in digits: neither a name for one, such as `-inf`, nor a sum.
fn is_number(text: &str) -> bool {
    let is_digit = |c: char| c.is_ascii_digit() || ".eE+-".contains(c);
    text.chars().all(is_digit) && text.parse::<f64>().is_ok()
}

/// CSV files by name, of all tables that have CSV columns and at least one row. Tables of one name share one file.
///
/// # Errors
/// If one cannot be written.
pub(crate) fn files(tables: &[Table]) -> Result<Vec<(String, Vec<u8>)>> {
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
pub(crate) fn csv(parts: &[Table]) -> Result<Vec<u8>> {
    let mut file = Vec::new();
    write(&mut file, parts)?;
    Ok(file)
}

/// Writes tables with the same columns one by one: a header and rows.
///
/// # Errors
/// If they cannot be written.
pub(crate) fn write<T: Borrow<Table>>(
    out: impl Write,
    parts: impl IntoIterator<Item = T>,
) -> Result<()> {
    let failed = |e: ::csv::Error| Error::data("CSV", e);
    let mut file = ::csv::Writer::from_writer(out);
    let mut has_header = false;
    for table in parts {
        let table = table.borrow();
        let names = table.columns.iter().flat_map(|column| &column.heads.csv);
        for row in &table.rows {
            if names.clone().next().is_none() {
                break;
            }
            if !has_header {
                let names = names.clone().map(|name| safe(name).into_owned());
                file.write_record(names).map_err(failed)?;
                has_header = true;
            }
            let cells = table.cells(row);
            let cells: Vec<CsvField<'_>> = cells
                .flat_map(|(column, cell)| fields(cell, column.heads.csv.len()))
                .collect();
            let texts: Vec<Cow<'_, str>> = cells.iter().map(safe_text).collect();
            let row: Vec<CsvField<'_>> = cells
                .iter()
                .zip(&texts)
                .map(|(field, text)| match *field {
                    CsvField::Text(_) => CsvField::Text(text),
                    // `summary.csv` and `summary.json` write numbers in the same way.
                    CsvField::Number(number) if table.name != SUMMARY => CsvField::Plain(number),
                    field => field,
                })
                .collect();
            file.serialize(row).map_err(failed)?;
        }
    }
    file.flush().map_err(|e| Error::data("CSV", e))
}

/// The text of a field as [`safe`] writes it; empty for a number.
fn safe_text<'a>(field: &CsvField<'a>) -> Cow<'a, str> {
    match *field {
        CsvField::Text(text) => safe(text),
        _ => Cow::Borrowed(""),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::table::ColumnKind::{Number, Text};
    use crate::text::table::TableBuilder;

    #[test]
    fn a_text_that_a_spreadsheet_would_run_gets_an_apostrophe() {
        for formula in [
            "=HYPERLINK(\"http://x\",\"y\")",
            "=1+1",
            "+1+1",
            "-1+1",
            "@SUM(A1)",
            "  =1",
            "\n=1",
            "＝1",
            "-inf",
            "-",
            "'=1",
            "''@x",
        ] {
            let safe = safe(formula);
            assert_eq!(safe.strip_prefix('\''), Some(formula), "{safe}");
        }
        assert_eq!(safe("\t=1"), "'⟨U+0009⟩=1");
        assert_eq!(safe("\r=1"), "'⟨U+000D⟩=1");
        assert_eq!(safe("a\u{1b}[1m\r"), "a⟨U+001B⟩[1m⟨U+000D⟩");
    }

    #[test]
    fn other_texts_and_numbers_stay() {
        for plain in [
            "", "a=1", "-4.8", "+3", "-1e-7", "'quoted'", "it's", "−4.8", "L3-noise", "a\nb",
        ] {
            assert_eq!(safe(plain), plain);
        }
    }

    #[test]
    fn cells_and_heads_of_a_file_are_safe_and_numbers_stay_numbers() -> Result<()> {
        let table = TableBuilder::new("t", [("=cmd|' /C calc'!A0", -0.048), ("fine", 1.0)])
            .column(Text, "csv =name", |row| row.0)
            .column(Number, "csv n", |row| row.1)
            .build();
        let file = String::from_utf8_lossy(&csv(&[table])?).into_owned();
        assert_eq!(file, "'=name,n\n'=cmd|' /C calc'!A0,-0.048\nfine,1\n");
        Ok(())
    }
}
