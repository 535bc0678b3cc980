//! Tables on photographs in the dark: how dark they are, and how often answers agree between two lights.

use super::sections::REAL;
use crate::report::text::table::ColumnKind::{Count, Number, Ratio, Share, Text};
use crate::report::text::table::{Table, TableBuilder};
use darkqa_score::comparisons::Agreement;
use darkqa_score::photographs::pair_darkness::PairDarkness;

/// Exposure drop of the photographs relative to their frames, with a row for each named set.
pub(super) fn darkness(pairs: &[PairDarkness]) -> Table {
    let mut table = TableBuilder::new("pairs", pairs)
        .page(REAL, "How much darker the photographs are than their frames")
        .column(Text, "csv name | terminal photographs | page photographs", |pair| pair.name.to_string())
        .column(Count, "csv frames | terminal frames | page frames", |pair| pair.frames)
        .column(Number, "csv ev_low_quartile", |pair| Some(pair.ev[0]))
        .column(Number, "csv ev", |pair| Some(pair.ev[1]))
        .column(Number, "csv ev_high_quartile", |pair| Some(pair.ev[2]))
        .column(Text, "terminal EV (quartiles) | page EV (quartiles)", |pair| pair.long())
        .column(Text, "csv lower_bound", |pair| pair.is_lower_bound.to_string())
        .column(Count, "csv stated", |pair| pair.stated)
        .column(Count, "csv unknown", |pair| pair.unknown)
        .column(Count, "csv not_darker", |pair| pair.brighter)
        .column(Number, "csv ev_of_pixels", |pair| pair.mean_and_median.map(|[_, median]| median))
        .column(Number, "csv ev_of_synthesis", |pair| Some(pair.synthesis))
        .build();
    table.heading = (!pairs.is_empty()).then(|| "Photographed in the dark".to_owned());
    table.notes = pairs.iter().flat_map(PairDarkness::warnings).collect();
    table
}

/// Agreement of each model with itself in two lights.
pub(super) fn light_agreement(agreements: &[Agreement]) -> Table {
    let mut table = TableBuilder::new("light_agreement", agreements)
        .page(REAL, "The same answers in two lights")
        .column(Text, "csv model | terminal model | page model", |agreement| agreement.first.model.clone())
        .column(Text, "csv condition | terminal condition | page condition", |agreement| agreement.first.condition())
        .column(Text, "csv against_condition | terminal and | page and", |agreement| agreement.second.condition())
        .column(Count, "csv n | terminal n", |agreement| agreement.same.n)
        .column(
            Share,
            "csv same_answer same_low same_high | terminal same answer in % | page same answer in % [95 %]",
            |agreement| agreement.same,
        )
        .column(Ratio, "csv kappa kappa_low kappa_high | terminal κ | page κ [95 %]", |agreement| agreement.kappa)
        .column(Count, "page n", |agreement| agreement.same.n)
        .build();
    table.heading =
        (!agreements.is_empty()).then(|| "The same answers in two lights, with κ of being right".to_owned());
    table
}
