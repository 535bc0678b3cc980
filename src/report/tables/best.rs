//! Table of pairwise differences between models in mean accuracy in the dark, with tests.

use crate::report::sentences::dark_levels;
use crate::report::text::table::ColumnKind::{Number, P, Percent, Points, Significance, Text};
use crate::report::text::table::{Table, TableBuilder, TableCell};
use crate::report::text::words::{light, points};
use darkqa_score::comparisons::{BestInTheDark, DarkAccuracy, DarkPair};
use darkqa_score::findings::Findings;

/// Two models with the comparison that they belong to.
struct PairRow<'b> {
    best: &'b BestInTheDark,
    pair: &'b DarkPair,
}

impl<'b> PairRow<'b> {
    /// Accuracy of the first model over the dark levels.
    fn first(&self) -> Option<&'b DarkAccuracy> {
        self.accuracy(&self.pair.first)
    }

    /// Accuracy of the second model over the dark levels.
    fn second(&self) -> Option<&'b DarkAccuracy> {
        self.accuracy(&self.pair.second)
    }

    fn accuracy(&self, model: &str) -> Option<&'b DarkAccuracy> {
        self.best.models.iter().find(|row| row.model == model)
    }
}

/// Difference of a model from its accuracy at L0; `None` if that is not above chance.
fn loss(accuracy: Option<&DarkAccuracy>) -> Option<String> {
    Some(points(accuracy?.loss?.value))
}

/// Builds the table; it has no rows if there are fewer than two models.
pub(super) fn best(findings: &Findings<'_>) -> Table {
    let is_detected = findings.detected_best().is_some();
    let pairs = findings.best.iter().flat_map(|best| best.pairs.iter().map(move |pair| PairRow { best, pair }));
    let variant = findings.best.as_ref().map(|best| light(&best.variant, None));
    let levels = findings.best.as_ref().map(dark_levels);
    let caption = format!(
        "Mean accuracy over the dark levels ({}), {}: model less model, on shared items",
        levels.unwrap_or_default(),
        variant.unwrap_or_default()
    );
    let mut table = TableBuilder::new("best", pairs)
        .page("thresholds", &caption)
        .column(Text, "csv model | page model", |row| row.pair.first.clone())
        .column(Text, "csv against_model | page against", |row| row.pair.second.clone())
        .column(Text, "csv variant", |row| row.best.variant.to_string())
        .column(Number, "csv first", |row| row.first().map(|model| model.mean.value))
        .column(Number, "csv second", |row| row.second().map(|model| model.mean.value))
        .column(Percent, "page first", |row| row.first().map(|model| model.mean.value))
        .column(Percent, "page second", |row| row.second().map(|model| model.mean.value))
        .column(Text, "page first less L0", |row| loss(row.first()))
        .column(Text, "page second less L0", |row| loss(row.second()))
        .column(Points, "csv difference low high n | page difference [95 %]", |row| row.pair.difference)
        .column(P, "csv p | page p", |row| row.pair.p)
        .column(Text, "csv p_by", |row| row.pair.p_by.to_string())
        .column(P, "csv p_holm | page p (Holm)", |row| row.pair.holm)
        .column(Significance, "page", |row| TableCell::verdict(row.best.verdict(row.pair, is_detected)))
        .column(Text, "csv verdict", |row| {
            let verdict = row.best.verdict(row.pair, is_detected);
            verdict.map_or("", |verdict| verdict.word())
        })
        .column(Text, "csv shown", |row| {
            let verdict = row.best.verdict(row.pair, is_detected);
            verdict.is_some_and(darkqa_score::significance::Significance::is_shown).to_string()
        })
        .column(Text, "csv levels", |row| row.best.levels.iter().map(ToString::to_string).collect::<Vec<_>>().join(";"))
        .build();
    table.is_folded = true;
    table
}
