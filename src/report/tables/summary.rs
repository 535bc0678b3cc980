//! Every accuracy: `summary.csv` and the rows of `summary.json`.

use crate::report::table::ColumnKind::{Count, Share, Text};
use crate::report::table::{Table, TableBuilder, TableCell};
use crate::score::accuracy::AccuracySummary;
use crate::score::choice::ReadingMode;
use crate::score::subject::Subject;

/// The name of the table.
pub(in crate::report) const SUMMARY: &str = "summary";

pub(super) fn summary(summary: &AccuracySummary) -> Table {
    let layout = TableBuilder::new(SUMMARY, &summary.cells)
        .subject(|cell| &cell.subject, |variant| variant.word().to_owned())
        .family(|cell| cell.family.as_ref())
        .column(Text, "csv mode", |cell| match cell.mode {
            ReadingMode::Strict => "strict",
            ReadingMode::Lenient => "lenient",
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
pub(in crate::report) fn reading(subject: &Subject) -> TableCell {
    TableCell::from(subject.variant.reading.as_ref().map(ToString::to_string))
}
