//! Tables on a page: [`shown`].

use serde::Serialize;

use crate::report::table::{Cell, Format, Kind, Table};
use crate::report::words::words;

/// The most rows that are shown without being asked for.
const MOST: usize = 60;

/// A table as the template reads it.
#[derive(Serialize)]
pub(in crate::report) struct Shown<'a> {
    caption: &'a str,
    /// Whether it is shown when it is asked for.
    folded: bool,
    head: Vec<&'a str>,
    rows: Vec<Vec<Text>>,
}

#[derive(Serialize)]
struct Text {
    text: String,
    class: &'static str,
}

/// The tables of a section that have a row.
pub(in crate::report) fn shown<'a>(tables: &'a [Table], section: &str) -> Vec<Shown<'a>> {
    let here = tables.iter().filter(|table| table.section == section);
    let shown = here.map(|table| {
        let head = table.columns.iter();
        let rows = table.rows_in(Format::Page).map(|row| {
            let cells = table.cells(row);
            let cells = cells.filter(|(column, _)| column.heads.page.is_some());
            cells
                .map(|(column, cell)| text(column.kind, cell))
                .collect()
        });
        let rows: Vec<Vec<Text>> = rows.collect();
        Shown {
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

fn text(kind: Kind, cell: &Cell) -> Text {
    let class = match (kind, cell) {
        (_, Cell::Below(_)) => "below",
        (_, Cell::Verdict(verdict)) => verdict.word(),
        (Kind::Failures, Cell::Count(1..)) => "worse",
        (Kind::Text, _) => "text",
        _ => "",
    };
    let text = words(kind, cell);
    Text { text, class }
}
