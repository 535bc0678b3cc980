//! A row an item and curve: the level at which it is first not answered rightly; empty if it never fails.

use crate::report::table::ColumnKind::{Count, Text};
use crate::report::table::{Table, TableBuilder};
use crate::score::findings::Findings;

pub(super) fn flips(findings: &Findings<'_>) -> Table {
    let items = &findings.grid.items;
    let rows = findings.falls.iter().flat_map(|fall| {
        let items = items.iter().zip(&fall.first);
        items.map(move |(item, first)| (fall, item.record, *first))
    });
    TableBuilder::new("flips", rows)
        .column(Text, "csv question", |(_, record, _)| {
            record.question.to_string()
        })
        .column(Text, "csv frame", |(_, record, _)| {
            record.detail.frame.to_string()
        })
        .family(|(_, record, _)| Some(&record.detail.family))
        .column(Count, "csv repeat", |(_, record, _)| {
            record.detail.repeat as usize
        })
        .line(|(fall, _, _)| (&fall.model, &fall.variant, fall.enhancer.as_ref()))
        .column(Text, "csv first_failing", |(_, _, first)| {
            first.map(|level| level.to_string())
        })
        .made()
}
