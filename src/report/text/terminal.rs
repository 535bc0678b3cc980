//! Tables as text for the terminal: [`render`].

mod fitted;

use self::fitted::{TextColumn, TextRow, TextTable};
use crate::report::text::table::{Column, ColumnKind, Table, TableCell, TableFormat};
use crate::report::text::width;
use crate::report::text::words::{interval, percent, points, reach, stops, widest_reach_of, with_interval, words};
use crate::report::text::wrapped::wrapped_to;
use crate::types::manifests::{Counts, RunManifest, Status};

/// The lenient number in brackets, ` (LENIENT)`, if it differs from the strict one; otherwise empty.
pub(crate) fn differing(strict: &str, lenient: &str) -> String {
    if strict == lenient { String::new() } else { format!(" ({lenient})") }
}

/// A cell as text for the terminal: one text for each name of its column.
pub(crate) fn texts(kind: ColumnKind, cell: &TableCell) -> Vec<String> {
    match (kind, cell) {
        (ColumnKind::Points, TableCell::Estimate(e)) => {
            let interval = format!("{} to {}", points(e.low), points(e.high));
            vec![points(e.value), interval]
        }
        (ColumnKind::Threshold, TableCell::Threshold(t, darkest)) => {
            vec![stops(t.value, *darkest), reach(t.low, t.high, *darkest)]
        }
        (ColumnKind::Threshold, TableCell::Unknown(_)) => vec!["–".to_owned(), words(kind, cell)],
        (ColumnKind::Share, TableCell::Estimate(share)) => vec![with_interval(*share)],
        (_, TableCell::Strict(strict, lenient)) => {
            let lenient = differing(&percent(strict.value), &percent(*lenient));
            vec![percent(strict.value) + &lenient]
        }
        _ => vec![words(kind, cell)],
    }
}

/// Wraps a text at the width of the terminal. The first line begins with `first`, the others with `rest`.
pub(crate) fn line(first: &str, text: &str, rest: &str) -> String {
    wrapped_to(width::columns(), first, text, rest)
}

/// All tables that have a heading, each with its heading and notes.
#[must_use]
pub(crate) fn render(tables: &[Table]) -> String {
    let mut text = String::new();
    for parts in tables.chunk_by(|table, next| (table.name, &table.heading) == (next.name, &next.heading)) {
        let Some(heading) = &parts[0].heading else {
            continue;
        };
        if !heading.is_empty() {
            text += &line("", heading, " ");
        }
        text += &table(parts);
        let notes = parts.iter().flat_map(|table| &table.notes);
        let foot = parts.iter().filter_map(|table| table.foot.as_ref()).take(1);
        for note in notes.chain(foot) {
            text += &line("", note, " ");
        }
    }
    text
}

/// Head of the column with the widest interval of a row.
const REACH: &str = "95 %";

/// Formats tables with the same columns as one table; empty without rows. A table of accuracies has a last column with
/// the widest interval of each row.
#[must_use]
pub(crate) fn table(parts: &[Table]) -> String {
    let columns = parts.iter().take(1).flat_map(|table| &table.columns);
    let has_reach = columns.clone().any(|column| column.kind == ColumnKind::Accuracy);
    let heads = columns.flat_map(|Column { kind, heads }| {
        heads.terminal.iter().map(|head| TextColumn { head: head.clone(), kind: *kind })
    });
    let reach = has_reach.then(|| TextColumn { head: REACH.to_owned(), kind: ColumnKind::Text });
    let mut rows = Vec::new();
    for table in parts {
        for (heading, row) in table.headed_rows_in(TableFormat::Terminal) {
            if let Some(heading) = heading.filter(|heading| !heading.is_empty()) {
                rows.push(TextRow::Heading(heading.to_owned()));
            }
            let cells = table.cells(row).filter(|(column, _)| !column.heads.terminal.is_empty());
            let reach = has_reach.then(|| widest_reach(cells.clone()));
            let texts = cells.flat_map(|(column, cell)| texts(column.kind, cell));
            rows.push(TextRow::Cells(texts.chain(reach).collect()));
        }
    }
    let table = TextTable { columns: heads.chain(reach).collect(), rows };
    table.format_to(width::columns())
}

/// The largest distances of these cells' estimates to the ends of their intervals, as `−7.7 +7.1`; empty if no cell has
/// an interval.
fn widest_reach<'t>(cells: impl Iterator<Item = (&'t Column, &'t TableCell)>) -> String {
    let accuracies = cells.filter(|(column, _)| column.kind == ColumnKind::Accuracy);
    widest_reach_of(accuracies.filter_map(|(column, cell)| interval(column.kind, cell)))
}

/// A line with the progress of a run; empty if the run is complete.
pub(crate) fn progress(run: &RunManifest, what: &str) -> String {
    let Counts { trials, answered, failed } = run.counts;
    match run.status {
        Status::Complete => String::new(),
        status => format!("{status}: {answered} of {trials} {what}, {failed} failed\n"),
    }
}
