//! Tables of the page: [`page_tables`].

use serde::Serialize;

use crate::report::text::table::{ColumnKind, Table, TableCell, TableFormat, TableRow};
use crate::report::text::words::{ends, interval, words};
use darkqa_score::estimate::Estimate;
use darkqa_score::significance::Significance;

/// Maximum number of rows of a table that is not folded.
const MAX_OPEN_ROWS: usize = 60;

/// Minimum number of rows without a detected effect that are folded (chosen); fewer stay visible.
const MIN_FOLDED_ROWS: usize = 3;

/// Table for the template.
#[derive(Serialize)]
pub(crate) struct PageTable<'a> {
    caption: &'a str,
    /// True if the table is closed until the reader opens it.
    folded: bool,
    /// Line below the table; `None` without one.
    foot: Option<&'a str>,
    head: Vec<&'a str>,
    rows: Vec<PageRow<'a>>,
    /// Rows of tests without a detected effect, closed until the reader opens them; `None` without any.
    unshown: Option<FoldedRows<'a>>,
}

/// Rows of tests without a detected effect.
#[derive(Serialize)]
struct FoldedRows<'a> {
    /// Number of rows, and the largest effect among them.
    summary: String,
    rows: Vec<PageRow<'a>>,
}

#[derive(Serialize)]
struct PageRow<'a> {
    /// Heading above the row; `None` without one.
    heading: Option<&'a str>,
    cells: Vec<PageCell>,
}

#[derive(Serialize)]
struct PageCell {
    text: String,
    /// Both ends of the interval, shown below the text; empty without an interval.
    ends: String,
    class: &'static str,
}

/// Tables of a section that have rows.
pub(crate) fn page_tables<'a>(tables: &'a [Table], section: &str) -> Vec<PageTable<'a>> {
    tables
        .iter()
        .filter(|table| table.section == section)
        .map(|table| {
            let (mut folded, mut visible): (Vec<&TableRow>, Vec<&TableRow>) =
                table.rows_in(TableFormat::Page).partition(|row| is_undetected(row));
            if folded.len() < MIN_FOLDED_ROWS {
                folded.clear();
                visible = table.rows_in(TableFormat::Page).collect();
            }
            let rows = page_rows(table, &visible);
            PageTable {
                caption: &table.caption,
                folded: table.is_folded || rows.len() > MAX_OPEN_ROWS,
                unshown: (!folded.is_empty())
                    .then(|| FoldedRows { summary: summary(table, &folded), rows: page_rows(table, &folded) }),
                foot: table.foot.as_deref(),
                head: table
                    .columns
                    .iter()
                    .filter_map(|column| column.heads.page.as_deref())
                    // Columns of verdicts have no head; screen readers need one.
                    .map(|head| if head.is_empty() { "verdict" } else { head })
                    .collect(),
                rows,
            }
        })
        .filter(|table| !table.rows.is_empty() || table.unshown.is_some())
        .collect()
}

/// True for the row of a test that detected no effect.
fn is_undetected(row: &TableRow) -> bool {
    row.cells.iter().any(|cell| match cell {
        TableCell::Significance(significance) => !significance.is_shown(),
        _ => false,
    })
}

/// Rows for the template, with a heading where the group changes.
fn page_rows<'a>(table: &'a Table, rows: &[&'a TableRow]) -> Vec<PageRow<'a>> {
    let mut last_group: Option<&str> = None;
    rows.iter()
        .map(|row| {
            let group = row.group.as_deref();
            let heading = (group != last_group).then(|| group.unwrap_or_default());
            last_group = group;
            PageRow {
                heading,
                cells: table
                    .cells(row)
                    .filter(|(column, _)| column.heads.page.is_some())
                    .map(|(column, cell)| page_cell(column.kind, cell))
                    .collect(),
            }
        })
        .collect()
}

/// First difference in a row, with its text.
fn difference(table: &Table, row: &TableRow) -> Option<(Estimate, String)> {
    table.cells(row).find_map(|(column, cell)| match (column.kind, cell) {
        (ColumnKind::Points, TableCell::Estimate(difference)) => Some((*difference, words(column.kind, cell))),
        _ => None,
    })
}

/// Number of rows without a detected effect, and the largest difference among them with the names in its row.
fn summary(table: &Table, rows: &[&TableRow]) -> String {
    let count = match rows.len() {
        1 => "1 row in which nothing is shown".to_owned(),
        count => format!("{count} rows in which nothing is shown"),
    };
    let largest = rows
        .iter()
        .filter_map(|row| Some((row, difference(table, row)?)))
        .max_by(|(_, (a, _)), (_, (b, _))| a.value.abs().total_cmp(&b.value.abs()));
    let Some((row, (_, text))) = largest else {
        return count;
    };
    let names: Vec<String> = table
        .cells(row)
        .filter(|(column, _)| column.heads.page.is_some())
        .map_while(|(column, cell)| match (column.kind, cell) {
            (ColumnKind::Text, cell) => Some(words(column.kind, cell)),
            _ => None,
        })
        .filter(|name| !name.is_empty())
        .collect();
    format!("{count}; the largest difference is {text} ({})", names.join(", "))
}

/// Cell for the template.
fn page_cell(kind: ColumnKind, cell: &TableCell) -> PageCell {
    let class = match (kind, cell) {
        (_, TableCell::Below(_)) => "below",
        (_, TableCell::Significance(Significance::Better)) => "better",
        (_, TableCell::Significance(Significance::Worse)) | (ColumnKind::Failures, TableCell::Count(1..)) => "worse",
        (_, TableCell::Significance(_)) => "unshown",
        (ColumnKind::Text, _) => "text",
        _ => "",
    };
    PageCell { text: words(kind, cell), ends: interval(kind, cell).map(ends).unwrap_or_default(), class }
}
