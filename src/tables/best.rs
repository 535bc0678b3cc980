//! The table of the models by mean accuracy in the dark: each less each other, with its test.

use crate::sentences::dark_levels;
use crate::text::table::ColumnKind::{Number, P, Percent, Points, Significance, Text};
use crate::text::table::{Table, TableBuilder};
use crate::text::words::{light, points};
use darkqa_score::comparisons::{BestInTheDark, DarkAccuracy, DarkPair};
use darkqa_score::findings::Findings;

/// Empty if there are fewer than two models.
pub(super) fn best(findings: &Findings<'_>) -> Table {
    let pairs = findings
        .best
        .iter()
        .flat_map(|best| best.pairs.iter().map(move |pair| (best, pair)));
    let variant = findings
        .best
        .as_ref()
        .map(|best| light(&best.variant, None));
    let levels = findings.best.as_ref().map(dark_levels);
    let caption = format!(
        "Mean accuracy over the dark levels ({}), {}: model less model, on shared items",
        levels.unwrap_or_default(),
        variant.unwrap_or_default()
    );
    let mut table = TableBuilder::new("best", pairs)
        .page("thresholds", &caption)
        .column(Text, "csv model | page model", |(_, pair)| {
            pair.first.clone()
        })
        .column(Text, "csv against_model | page against", |(_, pair)| {
            pair.second.clone()
        })
        .column(Text, "csv variant", |(best, _)| best.variant.to_string())
        .column(Number, "csv first", |row| {
            accuracy(row, first).map(|model| model.mean.value)
        })
        .column(Number, "csv second", |row| {
            accuracy(row, second).map(|model| model.mean.value)
        })
        .column(Percent, "page first", |row| {
            accuracy(row, first).map(|model| model.mean.value)
        })
        .column(Percent, "page second", |row| {
            accuracy(row, second).map(|model| model.mean.value)
        })
        .column(Text, "page first less L0", |row| loss(row, first))
        .column(Text, "page second less L0", |row| loss(row, second))
        .column(
            Points,
            "csv difference low high n | page difference [95 %]",
            |(_, pair)| pair.difference,
        )
        .column(P, "csv p | page p", |(_, pair)| pair.p)
        .column(Text, "csv p_by", |(_, pair)| pair.p_by.to_string())
        .column(P, "csv p_holm | page p (Holm)", |(_, pair)| pair.holm)
        .column(Significance, "page", |(_, pair)| pair.significance)
        .column(Text, "csv verdict", |(_, pair)| pair.significance.word())
        .column(Text, "csv shown", |(_, pair)| {
            pair.significance.is_shown().to_string()
        })
        .column(Text, "csv levels", |(best, _)| {
            best.levels
                .iter()
                .map(ToString::to_string)
                .collect::<Vec<_>>()
                .join(";")
        })
        .build();
    table.is_folded = true;
    table
}

fn first(pair: &DarkPair) -> &str {
    &pair.first
}

fn second(pair: &DarkPair) -> &str {
    &pair.second
}

fn accuracy<'b>(
    (best, pair): &(&'b BestInTheDark, &DarkPair),
    side: fn(&DarkPair) -> &str,
) -> Option<&'b DarkAccuracy> {
    best.models.iter().find(|model| model.model == side(pair))
}

/// The mean less the accuracy at L0; empty if that is not above chance.
fn loss(row: &(&BestInTheDark, &DarkPair), side: fn(&DarkPair) -> &str) -> Option<String> {
    let loss = accuracy(row, side)?.loss?;
    Some(points(loss.value))
}
