//! One table of a report: [`Table`], its [`Column`]s and [`TableCell`]s. Cells contain unformatted numbers, which each
//! output formats: the modules `csv`, `latex` and `terminal`, and the JSON and the page of a report.

use darkqa_score::estimate::Estimate;
use darkqa_score::significance::Significance;
use darkqa_score::threshold::Threshold;

/// Name of the table of all accuracies, whose numbers are written with all their digits.
pub(crate) const SUMMARY: &str = "summary";

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
    Significance,
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
    Effect(Estimate, Significance),
    /// A threshold, and the exposure drop of the darkest level, in EV.
    Threshold(Threshold, f64),
    /// Result of a significance test.
    Significance(Significance),
}

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

cell_from! {
    &str => Text,
    String => Text,
    usize => Count,
    f64 => Number,
    Estimate => Estimate,
    Significance => Significance,
}

impl TableCell {
    /// The verdict of a comparison; blank if no sentence is about it.
    pub(crate) fn verdict(verdict: Option<Significance>) -> Self {
        verdict.map_or(Self::Blank, Self::Significance)
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
pub(crate) struct TableBuilder<T> {
    table: Table,
    items: Vec<T>,
}

impl<T> TableBuilder<T> {
    pub(crate) fn new(name: &'static str, items: impl IntoIterator<Item = T>) -> Self {
        let items: Vec<T> = items.into_iter().collect();
        let table = Table { name, rows: items.iter().map(|_| TableRow::with_capacity()).collect(), ..Table::default() };
        Self { table, items }
    }

    /// Sets the section of the page and the caption there.
    pub(crate) fn page(mut self, section: &'static str, caption: &str) -> Self {
        self.table.section = section;
        caption.clone_into(&mut self.table.caption);
        self
    }

    /// Adds a column; `cell` computes the cell of an item.
    pub(crate) fn column<C: Into<TableCell>>(
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
    pub(crate) fn group(mut self, heading: impl Fn(&T) -> Option<String>) -> Self {
        for (row, item) in self.table.rows.iter_mut().zip(&self.items) {
            row.group = heading(item);
        }
        self
    }

    /// Sets the footnote that explains the marks.
    pub(crate) fn foot(mut self, foot: Option<String>) -> Self {
        self.table.foot = foot;
        self
    }

    /// Hides the rows of some items in a format.
    pub(crate) fn hide(mut self, format: TableFormat, is_hidden: impl Fn(&T) -> bool) -> Self {
        for (row, item) in self.table.rows.iter_mut().zip(&self.items) {
            if is_hidden(item) {
                row.hidden_in.push(format);
            }
        }
        self
    }

    /// The table with all its columns.
    pub(crate) fn build(self) -> Table {
        self.table
    }
}

impl Table {
    /// Restricts the table to its CSV file: it is not printed, nor shown on the page or in LaTeX.
    pub(crate) fn in_files_only(mut self) -> Self {
        (self.section, self.heading, self.latex) = ("", None, None);
        self
    }

    /// True if the table is written to a CSV file.
    pub(crate) fn has_file(&self) -> bool {
        self.columns.iter().any(|column| !column.heads.csv.is_empty())
    }

    /// Removes the CSV columns, so that the table is not written to a file.
    pub(crate) fn without_file(mut self) -> Self {
        for column in &mut self.columns {
            column.heads.csv.clear();
        }
        self
    }

    /// The rows that a format shows.
    pub(crate) fn rows_in(&self, format: TableFormat) -> impl Iterator<Item = &TableRow> {
        self.rows.iter().filter(move |row| !row.hidden_in.contains(&format))
    }

    /// The rows that a format shows. The first row of a group has its heading, and the first row after a group an empty
    /// heading; all other rows have `None`.
    pub(crate) fn headed_rows_in(&self, format: TableFormat) -> impl Iterator<Item = (Option<&str>, &TableRow)> {
        let mut above: Option<&str> = None;
        self.rows_in(format).map(move |row| {
            let group = row.group.as_deref();
            let heading = (group != above).then(|| group.unwrap_or_default());
            above = group;
            (heading, row)
        })
    }

    /// The cells of a row with their columns.
    pub(crate) fn cells<'t>(&'t self, row: &'t TableRow) -> impl Iterator<Item = (&'t Column, &'t TableCell)> + Clone {
        self.columns.iter().zip(&row.cells)
    }
}

#[cfg(test)]
mod tests {
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
}
