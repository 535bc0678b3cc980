//! One table of a report: [`Table`], its [`Column`]s and [`TableCell`]s. Cells contain unformatted numbers, which each
//! output formats: the modules `csv`, `latex` and `terminal`, and the JSON and the page of a report.
//!
//! Tables as CSV ([`files`]), with texts that spreadsheets do not run as formulas ([`escape_formula`]). Numbers have
//! all their digits.

use std::borrow::{Borrow, Cow};
use std::io::Write;

use serde::{Serialize, Serializer};

use darkqa_base::error::{Error, Result};
use darkqa_base::types::PairDark;
use darkqa_base::types::text::{escape_where, is_hidden};
use darkqa_score::estimate::Estimate;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::significance::Verdict;
use darkqa_score::threshold::Threshold;

/// Implements `From` for values that have a cell type.
macro_rules! cell_from {
    ($($type:ty => $variant:ident,)*) => {$(
        impl From<$type> for TableCell {
            fn from(value: $type) -> Self {
                Self::$variant(value.into())
            }
        }
    )*};
}

/// Name of the table of all accuracies, whose numbers are written with all their digits.
pub const SUMMARY: &str = "summary";

/// A table of numbers. An output leaves the table out if the table has no title for it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Name of its CSV file without the extension. Tables with the same name are parts of one file.
    pub name: &'static str,
    /// Id of its section of the page; empty if the page does not show it.
    pub section: &'static str,
    /// Caption on the page.
    pub caption: String,
    /// True if the page shows the table folded. Long tables are always folded.
    pub is_folded: bool,
    /// Line above it in the terminal, which may be empty; `None` if it is not printed. Tables with the same name and
    /// heading are printed as one.
    pub heading: Option<String>,
    /// Lines below it in the terminal.
    pub notes: Vec<String>,
    /// A line below it in the terminal, on the page and in LaTeX that explains its marks; `None` without marks.
    pub foot: Option<String>,
    /// Caption in LaTeX syntax; `None` if it is not written as LaTeX.
    pub latex: Option<String>,
    pub columns: Vec<Column>,
    pub rows: Vec<TableRow>,
}

/// A row of a table.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TableRow {
    /// A cell for each column.
    pub cells: Vec<TableCell>,
    /// The heading of the group of rows that the row belongs to; `None` without a heading.
    pub group: Option<String>,
    /// True if the model is detected to be better than every other; its name is bold in tables for papers.
    pub is_best: bool,
    /// Formats that leave the row out.
    pub hidden_in: Vec<TableFormat>,
}

impl TableRow {
    /// An empty row with capacity for the cells of any table.
    fn with_capacity() -> Self {
        Self { cells: Vec::with_capacity(12), ..Self::default() }
    }
}

/// A format that can leave rows out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableFormat {
    Terminal,
    Page,
    Latex,
}

/// A column: kind of its cells, and its names in each format.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    pub kind: ColumnKind,
    pub heads: ColumnHeads,
}

/// The names of a column by format. A format without a name leaves the column out.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ColumnHeads {
    /// Names in CSV and JSON. With several names, an estimate fills them with its value, the ends of its interval, and
    /// n.
    pub csv: Vec<String>,
    /// Names in the terminal. With two names, a difference fills them with its value and its interval.
    pub terminal: Vec<String>,
    /// Name on the page, which may be empty.
    pub page: Option<String>,
    /// Name in LaTeX syntax.
    pub latex: Option<String>,
}

/// Kind of the cells of a column. It decides how numbers are formatted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnKind {
    /// Text, left aligned.
    Text,
    /// A count.
    Count,
    /// A count of failures, which the page highlights if it is not 0.
    Failures,
    /// A plain number; two decimals except in files.
    Number,
    /// A share in percent.
    Percent,
    /// A share in percent with its interval.
    Share,
    /// A share in percent with half of its interval.
    Accuracy,
    /// A difference of shares in percentage points with its interval.
    Points,
    /// A number with its interval, with two decimals.
    Ratio,
    /// A darkness threshold in EV with its interval.
    Threshold,
    /// A p-value with three decimals.
    P,
    /// Result of a significance test.
    Verdict,
}

/// Content of a cell.
#[derive(Debug, Clone, PartialEq)]
pub enum TableCell {
    /// The cell has no content by design.
    Blank,
    /// The question of the cell was not asked.
    Absent,
    /// No number, because no reply can be counted.
    Missing,
    /// The number is not known; the text states why.
    Unknown(String),
    /// Text of any length.
    Text(String),
    /// A count.
    Count(usize),
    /// A number without an interval.
    Number(f64),
    /// A number with its interval.
    Estimate(Estimate),
    /// An accuracy that is detected to be below that of a model without images.
    Below(Estimate),
    /// Expected accuracy of guessing.
    Guess(Estimate),
    /// Accuracy in the strict parsing, and its value in the lenient parsing.
    Strict(Estimate, f64),
    /// A score, and its difference from the score on the clean frames, if that is known.
    Changed(Estimate, Option<f64>),
    /// A difference of shares, and the result of its test.
    Effect(Estimate, Verdict),
    /// A threshold, and the exposure drop of the darkest level, in EV.
    Threshold(Threshold, f64),
    /// Result of a significance test.
    Verdict(Verdict),
}

cell_from! {
    &str => Text,
    String => Text,
    usize => Count,
    f64 => Number,
    Estimate => Estimate,
    Verdict => Verdict,
}

impl TableCell {
    /// The noise profile of a subject, if it has one; the column `reading` of files.
    pub fn profile(subject: &ModelInCondition) -> Self {
        let variant = &subject.variant;
        let of_pair = variant.pair.as_ref().and_then(PairDark::reading);
        let profile = variant.reading.as_ref().or(of_pair);
        Self::from(profile.map(ToString::to_string))
    }

    /// The verdict of a comparison; blank if no sentence is about it.
    pub fn verdict(verdict: Option<Verdict>) -> Self {
        verdict.map_or(Self::Blank, Self::Verdict)
    }
}

impl<C: Into<Self>> From<Option<C>> for TableCell {
    fn from(cell: Option<C>) -> Self {
        cell.map_or(Self::Missing, C::into)
    }
}

/// Names by format, for example `csv low high | terminal difference, 95 % interval | page difference [95 %]`. Names for
/// CSV are separated by a space, names for the terminal by a comma.
impl From<&str> for ColumnHeads {
    fn from(names: &str) -> Self {
        let mut heads = Self::default();
        for part in names.split(" | ") {
            let (format, name) = part.split_once(' ').unwrap_or((part, ""));
            match format {
                "csv" => heads.csv = name.split(' ').map(str::to_owned).collect(),
                "terminal" => heads.terminal = name.split(", ").map(str::to_owned).collect(),
                "page" => heads.page = Some(name.to_owned()),
                _ => heads.latex = Some(name.to_owned()),
            }
        }
        heads
    }
}

/// Builder of a table from items, one for each row. Columns are added one by one, and each computes its cells from the
/// items.
pub struct TableBuilder<T> {
    table: Table,
    items: Vec<T>,
}

impl<T> TableBuilder<T> {
    pub fn new(name: &'static str, items: impl IntoIterator<Item = T>) -> Self {
        let items: Vec<T> = items.into_iter().collect();
        let table = Table { name, rows: items.iter().map(|_| TableRow::with_capacity()).collect(), ..Table::default() };
        Self { table, items }
    }

    /// Sets the section of the page and the caption there.
    #[must_use]
    pub fn page(mut self, section: &'static str, caption: &str) -> Self {
        self.table.section = section;
        caption.clone_into(&mut self.table.caption);
        self
    }

    /// Adds a column; `cell` computes the cell of an item.
    #[must_use]
    pub fn column<C: Into<TableCell>>(
        mut self,
        kind: ColumnKind,
        heads: impl Into<ColumnHeads>,
        cell: impl Fn(&T) -> C,
    ) -> Self {
        for (row, item) in self.table.rows.iter_mut().zip(&self.items) {
            row.cells.push(cell(item).into());
        }
        let heads = heads.into();
        self.table.columns.push(Column { kind, heads });
        self
    }

    /// Groups the rows by the headings of their items.
    #[must_use]
    pub fn group(mut self, heading: impl Fn(&T) -> Option<String>) -> Self {
        for (row, item) in self.table.rows.iter_mut().zip(&self.items) {
            row.group = heading(item);
        }
        self
    }

    /// Sets the footnote that explains the marks.
    #[must_use]
    pub fn foot(mut self, foot: Option<String>) -> Self {
        self.table.foot = foot;
        self
    }

    /// Hides the rows of some items in a format.
    #[must_use]
    pub fn hide(mut self, format: TableFormat, is_hidden: impl Fn(&T) -> bool) -> Self {
        for (row, item) in self.table.rows.iter_mut().zip(&self.items) {
            if is_hidden(item) {
                row.hidden_in.push(format);
            }
        }
        self
    }

    /// The table with all its columns.
    pub fn build(self) -> Table {
        self.table
    }
}

impl Table {
    /// Restricts the table to its CSV file: it is not printed, nor shown on the page or in LaTeX.
    #[must_use]
    pub fn in_files_only(mut self) -> Self {
        (self.section, self.heading, self.latex) = ("", None, None);
        self
    }

    /// True if the table is written to a CSV file.
    pub fn has_file(&self) -> bool {
        self.columns.iter().any(|column| !column.heads.csv.is_empty())
    }

    /// Removes the CSV columns, so that the table is not written to a file.
    #[must_use]
    pub fn without_file(mut self) -> Self {
        for column in &mut self.columns {
            column.heads.csv.clear();
        }
        self
    }

    /// The rows that a format shows.
    pub fn rows_in(&self, format: TableFormat) -> impl Iterator<Item = &TableRow> {
        self.rows.iter().filter(move |row| !row.hidden_in.contains(&format))
    }

    /// The rows that a format shows. The first row of a group has its heading, and the first row after a group an empty
    /// heading; all other rows have `None`.
    pub fn headed_rows_in(&self, format: TableFormat) -> impl Iterator<Item = (Option<&str>, &TableRow)> {
        let mut above: Option<&str> = None;
        self.rows_in(format).map(move |row| {
            let group = row.group.as_deref();
            let heading = (group != above).then(|| group.unwrap_or_default());
            above = group;
            (heading, row)
        })
    }

    /// The cells of a row with their columns.
    pub fn cells<'t>(&'t self, row: &'t TableRow) -> impl Iterator<Item = (&'t Column, &'t TableCell)> + Clone {
        self.columns.iter().zip(&row.cells)
    }
}

/// One field of a row. Numbers have enough digits to be parsed without loss.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(untagged)]
pub enum CsvField<'a> {
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
pub fn fields(cell: &TableCell, names: usize) -> impl Iterator<Item = CsvField<'_>> {
    let mut fields = [CsvField::None; 4];
    match cell {
        TableCell::Blank | TableCell::Absent | TableCell::Missing | TableCell::Unknown(_) => {}
        TableCell::Text(text) => fields[0] = CsvField::Text(text),
        TableCell::Count(count) => fields[0] = CsvField::Count(*count),
        TableCell::Number(number) => fields[0] = CsvField::Number(*number),
        TableCell::Verdict(verdict) => {
            // `tied` is kept for one release; the column `shown` states its meaning.
            let word = if verdict.is_shown() || *verdict == Verdict::Missing { verdict.word() } else { "tied" };
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
fn escape_formula(text: &str) -> Cow<'_, str> {
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
pub fn files(tables: &[Table]) -> Result<Vec<(String, Vec<u8>)>> {
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
pub fn csv(parts: &[Table]) -> Result<Vec<u8>> {
    let mut file = Vec::new();
    write(&mut file, parts)?;
    Ok(file)
}

/// Writes tables with the same columns one by one: a header and rows.
///
/// # Errors
/// If they cannot be written.
pub fn write<T: Borrow<Table>>(out: impl Write, parts: impl IntoIterator<Item = T>) -> Result<()> {
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
    use super::ColumnKind::{Number, Text};
    use super::*;

    #[test]
    fn a_column_has_a_name_in_each_format() {
        let heads = ColumnHeads::from("csv d low high | terminal difference, 95 % interval | page | latex $d$");
        assert_eq!(heads.csv, ["d", "low", "high"]);
        assert_eq!(heads.terminal, ["difference", "95 % interval"]);
        assert_eq!(heads.page.as_deref(), Some(""));
        assert_eq!(heads.latex.as_deref(), Some("$d$"));
        assert_eq!(ColumnHeads::from("csv n").page, None);
    }

    #[test]
    fn rows_can_be_hidden_in_a_format() {
        let table = TableBuilder::new("t", [1_usize, 2])
            .column(ColumnKind::Count, "csv n", |n| *n)
            .column(ColumnKind::Text, "page word", |n| (*n == 1).then_some("one"))
            .hide(TableFormat::Page, |n| *n == 2)
            .build();
        assert_eq!(table.rows[0].cells, [TableCell::Count(1), TableCell::from("one")]);
        assert_eq!(table.rows[1].cells, [TableCell::Count(2), TableCell::Missing]);
        assert_eq!(table.rows_in(TableFormat::Page).count(), 1);
        assert_eq!(table.rows_in(TableFormat::Terminal).count(), 2);
    }

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
