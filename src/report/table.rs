//! One table of a report: [`Table`], its [`Column`]s and [`TableCell`]s. It holds numbers; how they look is the work of what
//! writes it: `csv`, `json`, `latex`, `page` and `terminal`.

use crate::score::comparison::Significance;
use crate::score::curve::Threshold;
use crate::score::estimate::Estimate;

/// A table. What it has no title for, it does not stand in.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// The name of its CSV file without the ending. Tables of one name are parts of one file.
    pub name: &'static str,
    /// The section of the page in which it stands.
    pub section: &'static str,
    /// The caption on the page.
    pub caption: String,
    /// Whether the page shows it on request only. Long tables always are so.
    pub is_folded: bool,
    /// The line above it in the terminal; empty for none. Tables of one name and heading are printed as one.
    pub heading: Option<String>,
    /// Lines below it in the terminal.
    pub notes: Vec<String>,
    /// The caption in LaTeX, as LaTeX.
    pub latex: Option<String>,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows.
    pub rows: Vec<TableRow>,
}

/// A row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TableRow {
    /// A cell for each column.
    pub cells: Vec<TableCell>,
    /// What leaves it out.
    pub hidden_in: Vec<TableFormat>,
}

impl TableRow {
    /// A row with room for the cells of any table.
    fn wide() -> Self {
        Self {
            cells: Vec::with_capacity(12),
            hidden_in: Vec::new(),
        }
    }
}

/// What a row can be left out of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableFormat {
    /// The table at the end of a run.
    Terminal,
    /// The HTML page.
    Page,
    /// `tables.tex`.
    Latex,
}

/// A column: what it holds, and its name in each format.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// What it holds.
    pub kind: ColumnKind,
    /// Its names.
    pub heads: ColumnHeads,
}

/// The names of a column. A format for which it has none leaves it out.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ColumnHeads {
    /// In CSV and JSON. Of several names an estimate fills the first with its value, then the ends of its interval, then n.
    pub csv: Vec<String>,
    /// In the terminal. Of two names a difference fills the first with its value and the second with its interval.
    pub terminal: Vec<String>,
    /// On the page.
    pub page: Option<String>,
    /// In LaTeX, as LaTeX.
    pub latex: Option<String>,
}

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnKind {
    /// Words.
    Text,
    /// A number of things.
    Count,
    /// A number of things that should not be.
    Failures,
    /// A plain number; two digits where it is shown to people.
    Number,
    /// A share in percent.
    Percent,
    /// A share in percent with its interval.
    Share,
    /// A share in percent with half of its interval.
    Accuracy,
    /// A difference of shares in percentage points with its interval.
    Points,
    /// A number with its interval, two digits.
    Ratio,
    /// A darkness threshold in EV with its interval.
    Threshold,
    /// A p-value.
    P,
    /// What a comparison shows.
    Significance,
}

/// What stands in a cell.
#[derive(Debug, Clone, PartialEq)]
pub enum TableCell {
    /// Nothing belongs here.
    Blank,
    /// What the cell is about was not asked.
    Absent,
    /// There is no number: nothing came that can be counted.
    Missing,
    /// Words.
    Text(String),
    /// A number of things.
    Count(usize),
    /// A plain number.
    Number(f64),
    /// A number with its interval.
    Estimate(Estimate),
    /// One that is below that of a model without images.
    Below(Estimate),
    /// What guessing comes to.
    Guess(Estimate),
    /// One in the strict reading, and its value in the lenient one.
    Strict(Estimate, f64),
    /// One and by how much it differs from that on the lit frames, if that is known.
    Changed(Estimate, Option<f64>),
    /// A threshold, and the drop of the darkest level.
    Threshold(Threshold, f64),
    /// What a comparison shows.
    Significance(Significance),
}

/// Makes a cell of what a variant holds.
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

impl<C: Into<Self>> From<Option<C>> for TableCell {
    fn from(cell: Option<C>) -> Self {
        cell.map_or(Self::Missing, C::into)
    }
}

/// Names by format, as `csv low high | terminal difference, 95 % interval | page difference [95 %]`: those of CSV are parted
/// by a space, those of the terminal by a comma.
impl From<&str> for ColumnHeads {
    fn from(names: &str) -> Self {
        let mut heads = Self::default();
        for part in names.split(" | ") {
            let (format, name) = part.split_once(' ').unwrap_or((part, ""));
            let parted = |by: &str| name.split(by).map(str::to_owned).collect();
            match format {
                "csv" => heads.csv = parted(" "),
                "terminal" => heads.terminal = parted(", "),
                "page" => heads.page = Some(name.to_owned()),
                _ => heads.latex = Some(name.to_owned()),
            }
        }
        heads
    }
}

/// A table in the making: columns are added one by one, and each makes its cells from the items, one a row.
pub(super) struct TableBuilder<T> {
    table: Table,
    items: Vec<T>,
}

impl<T> TableBuilder<T> {
    pub(super) fn new(name: &'static str, items: impl IntoIterator<Item = T>) -> Self {
        let items: Vec<T> = items.into_iter().collect();
        let table = Table {
            name,
            section: "",
            caption: String::new(),
            is_folded: false,
            heading: None,
            notes: Vec::new(),
            latex: None,
            columns: Vec::new(),
            rows: items.iter().map(|_| TableRow::wide()).collect(),
        };
        Self { table, items }
    }

    /// Puts it in a section of the page.
    pub(super) fn page(mut self, section: &'static str, caption: &str) -> Self {
        self.table.section = section;
        caption.clone_into(&mut self.table.caption);
        self
    }

    /// Adds a column.
    pub(super) fn column<C: Into<TableCell>>(
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

    /// Leaves rows out of a format.
    pub(super) fn hide(mut self, format: TableFormat, is_hidden: impl Fn(&T) -> bool) -> Self {
        for (row, item) in self.table.rows.iter_mut().zip(&self.items) {
            if is_hidden(item) {
                row.hidden_in.push(format);
            }
        }
        self
    }

    /// The table with all its columns.
    pub(super) fn made(self) -> Table {
        self.table
    }
}

impl Table {
    /// The rows of a format.
    pub(super) fn rows_in(&self, format: TableFormat) -> impl Iterator<Item = &TableRow> {
        let rows = self.rows.iter();
        rows.filter(move |row| !row.hidden_in.contains(&format))
    }

    /// The cells of a row with their columns.
    pub(super) fn cells<'t>(
        &'t self,
        row: &'t TableRow,
    ) -> impl Iterator<Item = (&'t Column, &'t TableCell)> {
        self.columns.iter().zip(&row.cells)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_has_a_name_in_each_format() {
        let heads = ColumnHeads::from(
            "csv d low high | terminal difference, 95 % interval | page | latex $d$",
        );
        assert_eq!(heads.csv, ["d", "low", "high"]);
        assert_eq!(heads.terminal, ["difference", "95 % interval"]);
        assert_eq!(heads.page.as_deref(), Some(""));
        assert_eq!(heads.latex.as_deref(), Some("$d$"));
        assert_eq!(ColumnHeads::from("csv n").page, None);
    }

    #[test]
    fn cells_stand_below_their_columns_and_rows_can_be_left_out() {
        let table = TableBuilder::new("t", [1_usize, 2])
            .column(ColumnKind::Count, "csv n", |n| *n)
            .column(ColumnKind::Text, "page word", |n| {
                (*n == 1).then_some("one")
            })
            .hide(TableFormat::Page, |n| *n == 2)
            .made();
        assert_eq!(
            table.rows[0].cells,
            [TableCell::Count(1), TableCell::from("one")]
        );
        assert_eq!(
            table.rows[1].cells,
            [TableCell::Count(2), TableCell::Missing]
        );
        assert_eq!(table.rows_in(TableFormat::Page).count(), 1);
        assert_eq!(table.rows_in(TableFormat::Terminal).count(), 2);
    }
}
