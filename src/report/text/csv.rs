//! Tables as CSV ([`files`]), with texts that spreadsheets do not run as formulas ([`escape_formula`]). Numbers have
//! all their digits.

use std::borrow::{Borrow, Cow};
use std::io::Write;

use serde::{Serialize, Serializer};

use crate::error::{Error, Result};
use crate::report::text::table::{SUMMARY, Table, TableCell};
use crate::types::text::{escape_where, is_hidden};
use darkqa_score::significance::Significance;

/// One field of a row. Numbers have enough digits to be parsed without loss.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(untagged)]
pub(crate) enum CsvField<'a> {
    None,
    Text(&'a str),
    Count(usize),
    /// A number in the format of JSON: `1.0`.
    Number(f64),
    /// A number without a decimal point if it is an integer: `1`. Infinity is `inf`.
    #[serde(serialize_with = "plain")]
    Plain(f64),
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn plain<S: Serializer>(number: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(number)
}

/// The fields of a cell, one for each of the `names` CSV names of its column.
pub(crate) fn fields(cell: &TableCell, names: usize) -> impl Iterator<Item = CsvField<'_>> {
    let mut fields = [CsvField::None; 4];
    match cell {
        TableCell::Blank | TableCell::Absent | TableCell::Missing | TableCell::Unknown(_) => {}
        TableCell::Text(text) => fields[0] = CsvField::Text(text),
        TableCell::Count(count) => fields[0] = CsvField::Count(*count),
        TableCell::Number(number) => fields[0] = CsvField::Number(*number),
        TableCell::Significance(verdict) => {
            // `tied` is kept for one release; the column `shown` states its meaning.
            let word = if verdict.is_shown() || *verdict == Significance::Missing { verdict.word() } else { "tied" };
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

/// Escapes a text for a cell of a CSV file, so that no spreadsheet runs it as a formula.
///
/// Spreadsheets run text that begins with `=`, `+`, `-`, `@`, a tab or a carriage return as a formula, also after
/// spaces and in quoted cells (OWASP, “CSV Injection”). An apostrophe is put before such a text. The same is done if
/// apostrophes precede such a character, so that removing one apostrophe always restores the text. Numbers are not
/// changed. Tabs and hidden characters become codes such as `⟨U+001B⟩`; line breaks are kept.
pub(crate) fn escape_formula(text: &str) -> Cow<'_, str> {
    // Some readers interpret a tab within a cell as the end of the cell.
    let visible = escape_where(text, |c| c == '\t' || is_hidden(c));
    if begins_formula(text) { Cow::Owned(format!("'{visible}")) } else { visible }
}

/// True if a spreadsheet may run a text as a formula, with or without apostrophes before it.
fn begins_formula(text: &str) -> bool {
    const SIGNS: [char; 10] = ['=', '+', '-', '@', '\t', '\r', '＝', '＋', '－', '＠'];
    let trimmed = text.trim_start_matches([' ', '\u{a0}', '\u{3000}', '\n', '\'']);
    trimmed.starts_with(SIGNS) && !is_number(text)
}

/// True if a text is a number in digits, but not for `-inf` or a sum.
fn is_number(text: &str) -> bool {
    text.chars().all(|c| c.is_ascii_digit() || ".eE+-".contains(c)) && text.parse::<f64>().is_ok()
}

/// The names and contents of the CSV files of all tables with CSV columns and at least one row. Tables with the same
/// name share a file.
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

/// The content of one file with all these tables, which have the same columns: a header and rows. Empty without rows or
/// columns.
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
pub(crate) fn write<T: Borrow<Table>>(out: impl Write, parts: impl IntoIterator<Item = T>) -> Result<()> {
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
                let names = names.clone().map(|name| escape_formula(name).into_owned());
                file.write_record(names).map_err(|e| Error::data("CSV", e))?;
                has_header = true;
            }
            let cells: Vec<CsvField<'_>> =
                table.cells(row).flat_map(|(column, cell)| fields(cell, column.heads.csv.len())).collect();
            let texts: Vec<Cow<'_, str>> = cells.iter().map(safe_text).collect();
            let row: Vec<CsvField<'_>> = cells
                .iter()
                .zip(&texts)
                .map(|(field, text)| match *field {
                    CsvField::Text(_) => CsvField::Text(text),
                    // `summary.csv` has the number format of `summary.json`.
                    CsvField::Number(number) if table.name != SUMMARY => CsvField::Plain(number),
                    field => field,
                })
                .collect();
            file.serialize(row).map_err(|e| Error::data("CSV", e))?;
        }
    }
    file.flush().map_err(|e| Error::data("CSV", e))
}

/// The text of a field after [`escape_formula`]; empty for a number.
fn safe_text<'a>(field: &CsvField<'a>) -> Cow<'a, str> {
    match *field {
        CsvField::Text(text) => escape_formula(text),
        _ => Cow::Borrowed(""),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::text::table::ColumnKind::{Number, Text};
    use crate::report::text::table::TableBuilder;

    #[test]
    fn formulas_get_an_apostrophe() {
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
            let safe = escape_formula(formula);
            assert_eq!(safe.strip_prefix('\''), Some(formula), "{safe}");
        }
        assert_eq!(escape_formula("\t=1"), "'⟨U+0009⟩=1");
        assert_eq!(escape_formula("\r=1"), "'⟨U+000D⟩=1");
        assert_eq!(escape_formula("a\u{1b}[1m\r"), "a⟨U+001B⟩[1m⟨U+000D⟩");
    }

    #[test]
    fn other_texts_and_numbers_are_kept() {
        for plain in ["", "a=1", "-4.8", "+3", "-1e-7", "'quoted'", "it's", "−4.8", "L3-noise", "a\nb"] {
            assert_eq!(escape_formula(plain), plain);
        }
    }

    #[test]
    fn files_have_escaped_texts_and_plain_numbers() -> Result<()> {
        let table = TableBuilder::new("t", [("=cmd|' /C calc'!A0", -0.048), ("fine", 1.0)])
            .column(Text, "csv =name", |row| row.0)
            .column(Number, "csv n", |row| row.1)
            .build();
        let file = String::from_utf8_lossy(&csv(&[table])?).into_owned();
        assert_eq!(file, "'=name,n\n'=cmd|' /C calc'!A0,-0.048\nfine,1\n");
        Ok(())
    }
}
