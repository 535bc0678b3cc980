//! Tables as a page shows them: [`page_tables`].

use serde::Serialize;

use crate::text::table::{ColumnKind, Table, TableCell, TableFormat, TableRow};
use crate::text::words::{ends, interval, words};
use darkqa_score::significance::Significance;

/// Maximum number of rows of a table that is not folded.
const MAX_OPEN_ROWS: usize = 60;

/// Least number of rows in which nothing is shown that are folded: fewer are read faster than opened.
const LEAST_UNSHOWN: usize = 3;

/// A table as the template reads it.
#[derive(Serialize)]
pub(in crate::report) struct PageTable<'a> {
    caption: &'a str,
    /// Whether the table is closed until the reader opens it.
    folded: bool,
    /// The line below it; `None` without one.
    foot: Option<&'a str>,
    head: Vec<&'a str>,
    rows: Vec<PageRow<'a>>,
    /// Rows of tests in which nothing is shown, which are closed until the reader opens them; `None` without any.
    unshown: Option<UnshownRows<'a>>,
}

/// Rows of tests in which nothing is shown.
#[derive(Serialize)]
struct UnshownRows<'a> {
    /// Their number and the largest effect among them.
    summary: String,
    rows: Vec<PageRow<'a>>,
}

#[derive(Serialize)]
struct PageRow<'a> {
    /// The heading above the row; `None` without one.
    heading: Option<&'a str>,
    cells: Vec<PageCell>,
}

#[derive(Serialize)]
struct PageCell {
    text: String,
    /// Both ends of the interval, which stand beneath the text; empty if there are none.
    ends: String,
    class: &'static str,
}

/// The tables of a section that have a row.
pub(in crate::report) fn page_tables<'a>(tables: &'a [Table], section: &str) -> Vec<PageTable<'a>> {
    tables
        .iter()
        .filter(|table| table.section == section)
        .map(|table| {
            let head = table.columns.iter();
            let all = table.rows_in(TableFormat::Page);
            let (unshown, shown): (Vec<&TableRow>, Vec<&TableRow>) =
                all.partition(|row| is_unshown(row));
            let (unshown, shown) = match unshown.len() {
                0..LEAST_UNSHOWN => (Vec::new(), table.rows_in(TableFormat::Page).collect()),
                _ => (unshown, shown),
            };
            let rows = page_rows(table, &shown);
            PageTable {
                caption: &table.caption,
                folded: table.is_folded || rows.len() > MAX_OPEN_ROWS,
                unshown: (!unshown.is_empty()).then(|| UnshownRows {
                    summary: summary(table, &unshown),
                    rows: page_rows(table, &unshown),
                }),
                foot: table.foot.as_deref(),
                head: head
                    .filter_map(|column| column.heads.page.as_deref())
                    // A column without a head holds verdicts; whoever hears the table needs its name.
                    .map(|head| if head.is_empty() { "verdict" } else { head })
                    .collect(),
                rows,
            }
        })
        .filter(|table| !table.rows.is_empty() || table.unshown.is_some())
        .collect()
}

/// Whether a row is of a test in which nothing is shown.
fn is_unshown(row: &TableRow) -> bool {
    row.cells.iter().any(|cell| match cell {
        TableCell::Significance(significance) => !significance.is_shown(),
        _ => false,
    })
}

/// Rows as the template reads them, with a heading where a group begins or ends.
fn page_rows<'a>(table: &'a Table, rows: &[&'a TableRow]) -> Vec<PageRow<'a>> {
    let mut above: Option<&str> = None;
    rows.iter()
        .map(|row| {
            let group = row.group.as_deref();
            let heading = (group != above).then(|| group.unwrap_or_default());
            above = group;
            let cells = table.cells(row);
            let cells = cells
                .filter(|(column, _)| column.heads.page.is_some())
                .map(|(column, cell)| text(column.kind, cell));
            PageRow {
                heading,
                cells: cells.collect(),
            }
        })
        .collect()
}

/// The number of rows in which nothing is shown, and the largest difference among them with the texts that stand before it.
fn summary(table: &Table, rows: &[&TableRow]) -> String {
    let count = match rows.len() {
        1 => "1 row in which nothing is shown".to_owned(),
        count => format!("{count} rows in which nothing is shown"),
    };
    let difference = |row: &&TableRow| {
        let mut cells = table.cells(row);
        cells.find_map(|(column, cell)| match (column.kind, cell) {
            (ColumnKind::Points, TableCell::Estimate(found)) => {
                Some((*found, words(column.kind, cell)))
            }
            _ => None,
        })
    };
    let differences = rows.iter().filter_map(|row| Some((row, difference(row)?)));
    let largest =
        differences.max_by(|(_, (a, _)), (_, (b, _))| a.value.abs().total_cmp(&b.value.abs()));
    let Some((row, (_, text))) = largest else {
        return count;
    };
    let cells = table.cells(row);
    let cells = cells.filter(|(column, _)| column.heads.page.is_some());
    let names = cells.map_while(|(column, cell)| match (column.kind, cell) {
        (ColumnKind::Text, cell) => Some(words(column.kind, cell)),
        _ => None,
    });
    let names: Vec<String> = names.filter(|name| !name.is_empty()).collect();
    format!(
        "{count}; the largest difference is {text} ({})",
        names.join(", ")
    )
}

fn text(kind: ColumnKind, cell: &TableCell) -> PageCell {
    let class = match (kind, cell) {
        (_, TableCell::Below(_)) => "below",
        (_, TableCell::Significance(Significance::Better)) => "better",
        (_, TableCell::Significance(Significance::Worse))
        | (ColumnKind::Failures, TableCell::Count(1..)) => "worse",
        (_, TableCell::Significance(_)) => "unshown",
        (ColumnKind::Text, _) => "text",
        _ => "",
    };
    PageCell {
        text: words(kind, cell),
        ends: interval(kind, cell).map(ends).unwrap_or_default(),
        class,
    }
}
