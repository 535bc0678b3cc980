//! Tables on a page: [`shown`].

use serde::Serialize;

use crate::report::table::{ColumnKind, Table, TableCell, TableFormat};
use crate::report::words::words;

/// The most rows that are shown without being asked for.
const MOST: usize = 60;

/// A table as the template reads it.
#[derive(Serialize)]
pub(in crate::report) struct PageTable<'a> {
    caption: &'a str,
    /// Whether it is shown when it is asked for.
    folded: bool,
    head: Vec<&'a str>,
    rows: Vec<Vec<PageCell>>,
}

#[derive(Serialize)]
struct PageCell {
    text: String,
    class: &'static str,
}

/// The tables of a section that have a row.
pub(in crate::report) fn shown<'a>(tables: &'a [Table], section: &str) -> Vec<PageTable<'a>> {
    let here = tables.iter().filter(|table| table.section == section);
    let shown = here.map(|table| {
        let head = table.columns.iter();
        let rows = table.rows_in(TableFormat::Page).map(|row| {
            let cells = table.cells(row);
            let cells = cells.filter(|(column, _)| column.heads.page.is_some());
            cells
                .map(|(column, cell)| text(column.kind, cell))
                .collect()
        });
        let rows: Vec<Vec<PageCell>> = rows.collect();
        PageTable {
            caption: &table.caption,
            folded: table.is_folded || rows.len() > MOST,
            head: head
                .filter_map(|column| column.heads.page.as_deref())
                .collect(),
            rows,
        }
    });
    shown.filter(|table| !table.rows.is_empty()).collect()
}

fn text(kind: ColumnKind, cell: &TableCell) -> PageCell {
    let class = match (kind, cell) {
        (_, TableCell::Below(_)) => "below",
        (_, TableCell::Significance(verdict)) => verdict.word(),
        (ColumnKind::Failures, TableCell::Count(1..)) => "worse",
        (ColumnKind::Text, _) => "text",
        _ => "",
    };
    let text = words(kind, cell);
    PageCell { text, class }
}
