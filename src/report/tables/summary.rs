//! Every accuracy: `summary.csv` and the rows of `summary.json`.

use crate::report::table::Kind::{Count, Share, Text};
use crate::report::table::{Cell, Layout, Table};
use crate::score::accuracy::Summary;
use crate::score::choice::Mode;
use crate::score::subject::Subject;

/// The name of the table.
pub(in crate::report) const SUMMARY: &str = "summary";

pub(super) fn summary(summary: &Summary) -> Table {
    let layout = Layout::new(SUMMARY, &summary.cells)
        .subject(|cell| &cell.subject, |variant| variant.word().to_owned())
        .family(|cell| cell.family.as_ref())
        .column(Text, "csv mode", |cell| match cell.mode {
            Mode::Strict => "strict",
            Mode::Lenient => "lenient",
        })
        .column(Count, "csv n", |cell| cell.replies())
        .column(Count, "csv right", |cell| {
            cell.subject.view.map(|_| cell.right)
        })
        .column(Count, "csv unparsed", |cell| cell.unparsed)
        .column(Count, "csv failed", |cell| cell.failed)
        .column(Share, "csv value low high", |cell| cell.accuracy);
    let layout = if summary.cells.iter().any(|cell| cell.always.is_some()) {
        layout.column(Share, "csv always", |cell| cell.always)
    } else {
        layout
    };
    layout
        .column(Text, "csv reading", |cell| reading(&cell.subject))
        .made()
}

/// The light reading of a subject.
pub(in crate::report) fn reading(subject: &Subject) -> Cell {
    Cell::from(subject.variant.reading.as_ref().map(ToString::to_string))
}
