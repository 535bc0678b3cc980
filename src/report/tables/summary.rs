//! Table of all accuracies: `summary.csv`, and the rows of `summary.json`.

use crate::report::text::table::ColumnKind::{Count, Number, Share, Text};
use crate::report::text::table::{SUMMARY, Table, TableBuilder, TableCell};
use crate::types::{ModelListing, PairDark, RunGroup};
use darkqa_score::accuracies::{AccuracyCell, AccuracySummary};
use darkqa_score::choice::ParsingMode;
use darkqa_score::model_in_condition::ModelInCondition;

/// Builds the table, with a row for each model in a condition, family and way of parsing.
pub(crate) fn summary(summary: &AccuracySummary, listing: &ModelListing) -> Table {
    let builder = TableBuilder::new(SUMMARY, &summary.cells)
        .subject(|cell| &cell.subject, |variant| variant.word().into_owned())
        .family(|cell| cell.family.as_ref())
        .column(Text, "csv mode", |cell| match cell.mode {
            ParsingMode::Strict => "strict",
            ParsingMode::Lenient => "lenient",
        })
        .column(Count, "csv n", |cell| cell.replies())
        .column(Count, "csv right", |cell| cell.subject.view.map(|_| cell.right))
        .column(Count, "csv unparsed", |cell| cell.unparsed)
        .column(Count, "csv failed", |cell| cell.failed)
        .column(Share, "csv value low high", |cell| cell.accuracy);
    let builder = if summary.cells.iter().any(|cell| cell.always.is_some()) {
        builder.column(Share, "csv always", |cell| cell.always)
    } else {
        builder
    };
    let builder = if summary.unbalanced.is_empty() {
        builder
    } else {
        builder.column(Number, "csv balanced", |cell| cell.balanced)
    };
    let builder = if summary.cells.iter().any(|cell| cell.bounds().is_some()) {
        builder
            .column(Number, "csv if_wrong", |cell| Some(cell.bounds()?[0]))
            .column(Number, "csv if_right", |cell| Some(cell.bounds()?[1]))
    } else {
        builder
    };
    let builder =
        builder.column(Text, "csv reading", |cell| reading(&cell.subject)).model_facts(listing, |cell| &cell.subject);
    if summary.cells.iter().any(|cell| run_group(cell).is_some()) {
        // Runs have different images of the same condition, so each row states its run group.
        return builder.column(Text, "csv light", |cell| run_group(cell)).build();
    }
    builder.build()
}

/// Name of a cell's run group; `None` if it has none.
fn run_group(cell: &AccuracyCell) -> Option<&str> {
    cell.subject.variant.group.as_ref().map(RunGroup::name)
}

/// Cell with the noise profile ("reading") of a subject, if it has one.
pub(crate) fn reading(subject: &ModelInCondition) -> TableCell {
    let variant = &subject.variant;
    let pair_reading = variant.pair.as_ref().and_then(PairDark::reading);
    let reading = variant.reading.as_ref().or(pair_reading);
    TableCell::from(reading.map(ToString::to_string))
}
