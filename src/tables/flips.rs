//! The file of first failing levels, with a row for each item and curve: [`write_flips`]. It has as many rows as a run has items and
//! curves, so it is made row by row.

use std::io::Write;
use std::ops::Range;

use crate::error::Result;
use crate::text::csv;
use crate::text::table::ColumnKind::{Count, Text};
use crate::text::table::{Table, TableBuilder};
use darkqa_score::accuracies::FirstFailure;
use darkqa_score::findings::Findings;

/// The name of the file.
pub(crate) const FLIPS: &str = "flips.csv";

/// The rows that are made at once. Chosen: few enough to need no memory, and many enough to take no time.
const ROWS: usize = 4096;

/// Writes the first failing levels. The level is empty if the item never fails or if an earlier level has no reply.
///
/// # Errors
/// If they cannot be written.
pub(crate) fn write_flips(findings: &Findings<'_>, out: &mut dyn Write) -> Result<()> {
    let items = findings.grid.items.len();
    let parts = findings.first_failures.iter().flat_map(|failure| {
        let starts = (0..items).step_by(ROWS);
        starts.map(move |start| part(findings, failure, start..items.min(start + ROWS)))
    });
    csv::write(out, parts)
}

/// The rows of some items.
fn part(findings: &Findings<'_>, failure: &FirstFailure, items: Range<usize>) -> Table {
    let grid = &findings.grid;
    let rows = items.map(|item| (grid.items[item].asked, failure.first(grid, item)));
    let curve = &failure.curve;
    TableBuilder::new("flips", rows)
        .column(Text, "csv question", |(asked, _)| {
            asked.question.to_string()
        })
        .column(Text, "csv frame", |(asked, _)| asked.frame.to_string())
        .family(|(asked, _)| Some(&*asked.family))
        .column(Count, "csv repeat", |(asked, _)| asked.repeat as usize)
        .line(|_| (&curve.model, &curve.variant, curve.enhancer.as_ref()))
        .column(Text, "csv first_failing", |(_, first)| {
            first.map(|level| level.to_string())
        })
        .build()
}
