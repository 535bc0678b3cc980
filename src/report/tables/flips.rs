//! File of first failing levels, with a row for each item and curve: [`write_flips`]. The table can be large, so it is
//! written in parts.

use std::io::Write;
use std::ops::Range;

use crate::error::Result;
use crate::report::text::csv;
use crate::report::text::table::ColumnKind::{Count, Text};
use crate::report::text::table::{Table, TableBuilder};
use darkqa_score::accuracies::FirstFailure;
use darkqa_score::findings::Findings;

/// Name of the file.
pub(crate) const FLIPS: &str = "flips.csv";

/// Number of rows in a part (chosen): small enough for memory, large enough for speed.
const PART_ROWS: usize = 4096;

/// Writes the first failing levels. The level is empty if the item never fails or if an earlier level has no reply.
///
/// # Errors
/// If the output cannot be written.
pub(crate) fn write_flips(findings: &Findings<'_>, out: &mut dyn Write) -> Result<()> {
    let items = findings.grid.items.len();
    let parts = findings.first_failures.iter().flat_map(|failure| {
        (0..items).step_by(PART_ROWS).map(move |start| part(findings, failure, start..items.min(start + PART_ROWS)))
    });
    csv::write(out, parts)
}

/// Part of the file: the rows of one curve for some items.
fn part(findings: &Findings<'_>, failure: &FirstFailure, items: Range<usize>) -> Table {
    let grid = &findings.grid;
    let rows = items.map(|item| (grid.items[item].asked, failure.first(grid, item)));
    let curve = &failure.curve;
    TableBuilder::new("flips", rows)
        .column(Text, "csv question", |(asked, _)| asked.question.to_string())
        .column(Text, "csv frame", |(asked, _)| asked.frame.to_string())
        .family(|(asked, _)| Some(&*asked.family))
        .column(Count, "csv repeat", |(asked, _)| asked.repeat as usize)
        .curve(|_| (&curve.model, &curve.variant, curve.enhancer.as_ref()))
        .column(Text, "csv first_failing", |(_, first)| first.map(|level| level.to_string()))
        .build()
}
