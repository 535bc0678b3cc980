//! The table of the models by area: each less each other, with its test.

use crate::report::sentences::over_levels;
use crate::report::table::ColumnKind::{Number, P, Percent, Points, Significance, Text};
use crate::report::table::{Table, TableBuilder};
use crate::report::words::{light, points};
use crate::score::best::{AreaPair, BestInTheDark, ModelArea};
use crate::score::findings::Findings;

/// Empty if there are fewer than two models.
pub(super) fn best(findings: &Findings<'_>) -> Table {
    let pairs = findings.best.iter().flat_map(|best| {
        let pairs = best.pairs.iter();
        pairs.map(move |pair| (best, pair))
    });
    let variant = findings
        .best
        .as_ref()
        .map(|best| light(&best.variant, None));
    let levels = findings.best.as_ref().and_then(over_levels);
    let caption = format!(
        "Mean accuracy {}, {}: model less model, on shared items",
        levels.unwrap_or_else(|| "from L0 to the darkest level".to_owned()),
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
            area(row, first).map(|model| model.area.value)
        })
        .column(Number, "csv second", |row| {
            area(row, second).map(|model| model.area.value)
        })
        .column(Percent, "page first", |row| {
            area(row, first).map(|model| model.area.value)
        })
        .column(Percent, "page second", |row| {
            area(row, second).map(|model| model.area.value)
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
        .build();
    table.is_folded = true;
    table
}

fn first(pair: &AreaPair) -> &str {
    &pair.first
}

fn second(pair: &AreaPair) -> &str {
    &pair.second
}

fn area<'b>(
    (best, pair): &(&'b BestInTheDark, &AreaPair),
    side: fn(&AreaPair) -> &str,
) -> Option<&'b ModelArea> {
    let mut models = best.models.iter();
    models.find(|model| model.model == side(pair))
}

/// The area less the accuracy at L0; empty if that is not above chance.
fn loss(row: &(&BestInTheDark, &AreaPair), side: fn(&AreaPair) -> &str) -> Option<String> {
    let loss = area(row, side)?.loss?;
    Some(points(loss.value))
}
