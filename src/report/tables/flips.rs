//! A row an item and curve: the level at which it is first not answered rightly; empty if it never fails.

use crate::report::table::Kind::{Count, Text};
use crate::report::table::{Layout, Table, heads};
use crate::score::findings::Findings;

pub(super) fn flips(findings: &Findings<'_>) -> Table {
    let items = &findings.grid.items;
    let rows = findings.falls.iter().flat_map(|fall| {
        let items = items.iter().zip(&fall.first);
        items.map(move |(item, first)| (fall, item.record, *first))
    });
    Layout::new("flips", rows)
        .column(Text, heads().csv(&["question"]), |(_, record, _)| {
            record.question.to_string()
        })
        .column(Text, heads().csv(&["frame"]), |(_, record, _)| {
            record.detail.frame.to_string()
        })
        .column(Text, heads().csv(&["family"]), |(_, record, _)| {
            record.detail.family.to_string()
        })
        .column(Count, heads().csv(&["repeat"]), |(_, record, _)| {
            record.detail.repeat as usize
        })
        .column(Text, heads().csv(&["model"]), |(fall, _, _)| {
            fall.model.clone()
        })
        .column(Text, heads().csv(&["variant"]), |(fall, _, _)| {
            fall.variant.to_string()
        })
        .column(Text, heads().csv(&["enhancer"]), |(fall, _, _)| {
            fall.enhancer.as_ref().map(ToString::to_string)
        })
        .column(Text, heads().csv(&["first_failing"]), |(_, _, first)| {
            first.map(|level| level.to_string())
        })
        .made()
}
