//! How far models agree in each condition.

use crate::report::table::Kind::{Count, Ratio, Share, Text};
use crate::report::table::{Layout, Table, heads};
use crate::score::agreement::Agreement;

pub(super) fn agreement(agreements: &[Agreement]) -> Table {
    Layout::new("agreement", agreements)
        .page("agreement", "Agreement in each condition")
        .column(Text, heads().csv(&["condition"]).page("condition"), |one| {
            one.first.condition()
        })
        .column(Text, heads().csv(&["model"]).page("model"), |one| {
            one.first.model.clone()
        })
        .column(Text, heads().csv(&["against"]).page("and"), |one| {
            one.second.model.clone()
        })
        .column(Count, heads().csv(&["n"]), |one| one.same.n)
        .column(
            Share,
            heads()
                .csv(&["same_answer", "same_low", "same_high"])
                .page("same answer in % [95 %]"),
            |one| one.same,
        )
        .column(
            Ratio,
            heads()
                .csv(&["kappa", "kappa_low", "kappa_high"])
                .page("κ [95 %]"),
            |one| one.kappa,
        )
        .column(Count, heads().page("n"), |one| one.same.n)
        .made()
}
