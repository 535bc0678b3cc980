//! How far models agree in each condition.

use crate::report::table::ColumnKind::{Count, Ratio, Share, Text};
use crate::report::table::{Table, TableBuilder};
use crate::score::agreement::Agreement;

pub(super) fn agreement(agreements: &[Agreement]) -> Table {
    TableBuilder::new("agreement", agreements)
        .page("agreement", "Agreement in each condition")
        .column(Text, "csv condition | page condition", |one| {
            one.first.condition()
        })
        .column(Text, "csv model | page model", |one| {
            one.first.model.clone()
        })
        .column(Text, "csv against | page and", |one| {
            one.second.model.clone()
        })
        .column(Count, "csv n", |one| one.same.n)
        .column(
            Share,
            "csv same_answer same_low same_high | page same answer in % [95 %]",
            |one| one.same,
        )
        .column(
            Ratio,
            "csv kappa kappa_low kappa_high | page κ [95 %]",
            |one| one.kappa,
        )
        .column(Count, "page n", |one| one.same.n)
        .made()
}
