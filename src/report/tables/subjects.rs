//! Table of the accuracy of each model in each condition, with intervals and counts.

use crate::report::text::table::ColumnKind::{Count, Percent, Share, Text};
use crate::report::text::table::{Table, TableBuilder, TableCell};
use crate::report::text::words::percent;
use darkqa_score::accuracies::AccuracySummary;
use darkqa_score::choice::ParsingMode;

pub(super) fn subjects(summary: &AccuracySummary) -> Table {
    let builder = TableBuilder::new("subjects", summary.family_cells(None, ParsingMode::Strict))
        .page("accuracy", "Accuracy of every subject, all families together")
        .column(Text, "page model", |cell| cell.subject.model.clone())
        .column(Text, "page condition", |cell| match cell.subject.view {
            None => "guessing".to_owned(),
            Some(_) => cell.subject.condition(),
        })
        .column(Share, "page accuracy in % [95 %]", |cell| match (cell.subject.view, cell.accuracy) {
            (None, Some(chance)) => TableCell::Guess(chance),
            (_, accuracy) => TableCell::from(accuracy),
        })
        .column(Percent, "page lenient", |cell| summary.cell(&cell.subject, None, ParsingMode::Lenient)?.accuracy)
        .column(Count, "page n", |cell| cell.replies())
        .column(Count, "page not readable", |cell| cell.unparsed)
        .column(Count, "page failed", |cell| cell.failed);
    let has_bounds = summary.cells.iter().any(|cell| cell.bounds().is_some());
    let builder = if has_bounds {
        builder.column(Text, "page if failed are wrong–right", |cell| {
            let [wrong, right] = cell.bounds()?.map(percent);
            Some(format!("{wrong}–{right}"))
        })
    } else {
        builder
    };
    let mut table = builder.build();
    table.is_folded = true;
    table
}
