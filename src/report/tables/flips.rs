//! The table of first failing levels, with a row for each item and curve. The level is empty if the item never fails
//! or if an earlier level has no reply.

use crate::report::table::ColumnKind::{Count, Text};
use crate::report::table::{Table, TableBuilder};
use crate::score::findings::Findings;

pub(super) fn flips(findings: &Findings<'_>) -> Table {
    let items = &findings.grid.items;
    let rows = findings.first_failures.iter().flat_map(|failure| {
        let items = items.iter().zip(&failure.first);
        items.map(move |(item, first)| (failure, item.asked, *first))
    });
    TableBuilder::new("flips", rows)
        .column(Text, "csv question", |(_, asked, _)| {
            asked.question.to_string()
        })
        .column(Text, "csv frame", |(_, asked, _)| asked.frame.to_string())
        .family(|(_, asked, _)| Some(&*asked.family))
        .column(Count, "csv repeat", |(_, asked, _)| asked.repeat as usize)
        .line(|(failure, _, _)| (&failure.model, &failure.variant, failure.enhancer.as_ref()))
        .column(Text, "csv first_failing", |(_, _, first)| {
            first.map(|level| level.to_string())
        })
        .build()
}
