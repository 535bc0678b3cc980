//! Tables of a run that asked in several wordings or orders: where the variation comes from, and whether each
//! difference holds in all of them.

use crate::report::text::table::ColumnKind::{Count, Points, Share, Text};
use crate::report::text::table::{Table, TableBuilder, TableCell};
use crate::report::text::words::name;
use darkqa_score::findings::Findings;
use darkqa_score::variation::{AccuracyVariation, Facet, FacetRange, RunVariation, Source};

/// Id of the section on the page.
pub(super) const VARIATION: &str = "variation";

/// Builds the tables; none if every question was asked in one wording and one order.
pub(super) fn variation(findings: &Findings<'_>) -> Vec<Table> {
    let Some(found) = &findings.variation else {
        return Vec::new();
    };
    vec![components(found), differences(found)]
}

/// Standard deviations by source, with a row for each subject.
fn components(found: &RunVariation) -> Table {
    let caption = "Where the variation comes from: standard deviation of a reply by source";
    let mut table = TableBuilder::new("variation", &found.accuracies)
        .page(VARIATION, caption)
        .subject(|row| &row.subject, ToString::to_string)
        .column(Text, "terminal model", |row| row.subject.model.clone())
        .column(Text, "terminal condition", |row| row.subject.condition());
    let sources = [
        ("csv scene scene_low scene_high | page scene", Source::Scene),
        ("csv question question_low question_high | terminal question | page question", Source::Question),
        (
            "csv wording wording_low wording_high | terminal wording | page wording [95 %]",
            Source::Facet(Facet::Wording),
        ),
        ("csv order order_low order_high | terminal order | page order [95 %]", Source::Facet(Facet::Order)),
        (
            "csv question_wording question_wording_low question_wording_high | page question × wording",
            Source::QuestionFacet(Facet::Wording),
        ),
        (
            "csv question_order question_order_low question_order_high | page question × order",
            Source::QuestionFacet(Facet::Order),
        ),
        ("csv combination combination_low combination_high", Source::Combination),
        ("csv rest rest_low rest_high | terminal rest | page rest", Source::Rest),
    ];
    for (heads, source) in sources {
        table = table.column(Share, heads, move |row| row.components.deviation(source));
    }
    let wording = "csv wording_range wording_range_low wording_range_high \
                   | terminal best less worst wording, 95 % interval | page best less worst wording [95 %]";
    // The page has room for one of the two.
    let order = if found.wordings.is_empty() {
        "csv order_range order_range_low order_range_high | page best less worst order [95 %]"
    } else {
        "csv order_range order_range_low order_range_high"
    };
    let table = table
        .column(Points, wording, |row| range(row, Facet::Wording))
        .column(Points, order, |row| range(row, Facet::Order));
    let mut table = table.build();
    table.heading = Some(format!("Where the variation comes from ({}), in % of accuracy", found.asked()));
    table
}

fn range(row: &AccuracyVariation, facet: Facet) -> TableCell {
    row.ranges.iter().find(|range: &&FacetRange| range.facet == facet).map(|range| range.range).into()
}

/// Differences with intervals for other wordings and orders, and the combinations in which they hold.
fn differences(found: &RunVariation) -> Table {
    let difference = "csv difference low high | terminal difference, 95 % interval | page difference [95 %]";
    let mut table = TableBuilder::new("variation_differences", &found.differences)
        .page(VARIATION, "Does each difference hold in other wordings and orders?")
        .column(Text, "csv kind | page kind", |row| row.kind.name())
        .column(Text, "csv model | terminal model | page model", |row| row.first.model.clone())
        .column(Text, "csv condition | terminal condition | page condition", |row| row.first.condition())
        .column(Text, "csv against_model", |row| row.second.model.clone())
        .column(Text, "csv against_condition", |row| row.second.condition())
        .column(Text, "terminal less | page less", |row| name(&row.second))
        .column(Count, "csv n | page n", |row| row.found.difference.n)
        .column(Points, difference, |row| row.found.difference)
        .column(Points, "csv least_by_wording | page least by wording", |row| row.by_wording().map(|ends| ends[0]))
        .column(Points, "csv most_by_wording | page most by wording", |row| row.by_wording().map(|ends| ends[1]))
        .column(Count, "csv same_sign", |row| row.found.signs.same)
        .column(Count, "csv combinations", |row| row.found.signs.of)
        .column(Text, "terminal same sign | page same sign", |row| {
            format!("{} of {}", row.found.signs.same, row.found.signs.of)
        })
        .build();
    table.heading = Some("Differences, with intervals for other wordings and orders too".to_owned());
    if let Some(ranks) = found.ranks {
        let [value, low, high] = [ranks.value, ranks.low, ranks.high].map(|value| format!("{value:.2}"));
        table.foot = Some(format!(
            "Order of the models at the darkest level: Kendall’s W {value} [{low}, {high}] over the wordings; 1: the same in all"
        ));
    }
    table
}
