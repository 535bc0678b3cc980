//! Table of the agreement between models in each condition.

use crate::report::text::table::ColumnKind::{Count, Ratio, Share, Text};
use crate::report::text::table::{Table, TableBuilder};
use darkqa_score::comparisons::Agreement;

pub(super) fn agreement(agreements: &[Agreement]) -> Table {
    TableBuilder::new("agreement", agreements)
        .page("agreement", "Agreement in each condition")
        .column(Text, "csv condition | page condition", |agreement| agreement.first.condition())
        .column(Text, "csv model | page model", |agreement| agreement.first.model.clone())
        .column(Text, "csv against | page and", |agreement| agreement.second.model.clone())
        .column(Count, "csv n", |agreement| agreement.same.n)
        .column(Share, "csv same_answer same_low same_high | page same answer in % [95 %]", |agreement| agreement.same)
        .column(Ratio, "csv kappa kappa_low kappa_high | page κ [95 %]", |agreement| agreement.kappa)
        .column(Count, "page n", |agreement| agreement.same.n)
        .build()
}
