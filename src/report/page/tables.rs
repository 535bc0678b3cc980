//! Tables as a page shows them: [`page_tables`].

use serde::Serialize;

use crate::report::table::{ColumnKind, Table, TableCell, TableFormat};
use crate::report::words::{ends, interval, words};
use crate::score::significance::Significance;

/// Maximum number of rows of a table that is not folded.
const MAX_OPEN_ROWS: usize = 60;

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
    let in_section = tables.iter().filter(|table| table.section == section);
    let tables = in_section.map(|table| {
        let head = table.columns.iter();
        let rows = table.headed_rows_in(TableFormat::Page);
        let rows = rows.map(|(heading, row)| {
            let cells = table.cells(row);
            let cells = cells.filter(|(column, _)| column.heads.page.is_some());
            let cells = cells.map(|(column, cell)| text(column.kind, cell));
            PageRow {
                heading,
                cells: cells.collect(),
            }
        });
        let rows: Vec<PageRow<'_>> = rows.collect();
        PageTable {
            caption: &table.caption,
            folded: table.is_folded || rows.len() > MAX_OPEN_ROWS,
            foot: table.foot.as_deref(),
            head: head
                .filter_map(|column| column.heads.page.as_deref())
                .collect(),
            rows,
        }
    });
    tables.filter(|table| !table.rows.is_empty()).collect()
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
