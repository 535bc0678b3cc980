//! The accuracy of every subject with its interval and counts.

use crate::report::table::Kind::{Count, Percent, Share, Text};
use crate::report::table::{Cell, Layout, Table};
use crate::score::accuracy::Summary;
use crate::score::choice::Mode;

pub(super) fn subjects(summary: &Summary) -> Table {
    let mut table = Layout::new("subjects", summary.of(None, Mode::Strict))
        .page(
            "accuracy",
            "Accuracy of every subject, all families together",
        )
        .column(Text, "page model", |cell| cell.subject.model.clone())
        .column(Text, "page condition", |cell| match cell.subject.view {
            None => "guessing".to_owned(),
            Some(_) => cell.subject.condition(),
        })
        .column(Share, "page accuracy in % [95 %]", |cell| {
            match (cell.subject.view, cell.accuracy) {
                (None, Some(chance)) => Cell::Guess(chance),
                (_, accuracy) => Cell::from(accuracy),
            }
        })
        .column(Percent, "page lenient", |cell| {
            summary.cell(&cell.subject, None, Mode::Lenient)?.accuracy
        })
        .column(Count, "page n", |cell| cell.replies())
        .column(Count, "page not readable", |cell| cell.unparsed)
        .column(Count, "page failed", |cell| cell.failed)
        .made();
    table.is_folded = true;
    table
}
