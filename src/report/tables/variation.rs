//! Tables of a run that asked in several wordings, orders or draws: where the variation comes from, and whether each
//! difference holds in all of them.

use crate::text::table::ColumnKind::{Count, P, Percent, Points, Share, Text};
use crate::text::table::{Table, TableBuilder, TableCell};
use crate::text::words::name;
use darkqa_base::types::questions::letter;
use darkqa_score::findings::Findings;
use darkqa_score::variation::{AccuracyVariation, Facet, FacetRange, RunVariation, Source};

/// Id of the section on the page.
pub(super) const VARIATION: &str = "variation";

/// Builds the tables; none if every question was asked in one wording, one order and one draw.
pub(super) fn variation(findings: &Findings<'_>) -> Vec<Table> {
    let Some(found) = &findings.variation else {
        return Vec::new();
    };
    vec![components(found), differences(found), positions(found), plans(found)]
}

/// Designs of a further run, with what each needs.
fn plans(found: &RunVariation) -> Table {
    let mut table =
        TableBuilder::new("design", &found.plans)
            .page(VARIATION, "What a further run needs to detect a change of 5 points from L0, fewest requests first")
            .subject(|plan| &plan.subject, ToString::to_string)
            .column(Text, "terminal model", |plan| plan.subject.model.clone())
            .column(Text, "terminal condition", |plan| plan.subject.condition())
            .column(Count, "csv wordings | terminal wordings | page wordings", |plan| plan.design.wordings)
            .column(Count, "csv orders | terminal orders | page orders", |plan| plan.design.orders)
            .column(Count, "csv draws | terminal draws | page draws", |plan| plan.design.draws)
            .column(Text, "csv design | terminal design | page design", |plan| {
                if plan.design.is_half { "half" } else { "all" }
            })
            .column(Count, "csv scenes", |plan| plan.asked.map(|needed| needed.scenes))
            .column(Count, "csv questions | terminal questions | page questions", |plan| {
                plan.asked.map(|needed| needed.questions)
            })
            .column(Count, "csv requests | terminal requests | page requests", |plan| {
                plan.asked.map(|needed| needed.requests)
            })
            .column(Count, "csv others_questions | page questions, others too", |plan| {
                plan.others.map(|needed| needed.questions)
            })
            .column(Count, "csv others_requests | terminal others too | page requests, others too", |plan| {
                plan.others.map(|needed| needed.requests)
            })
            .build();
    table.foot = Some(
        "With 80 % power, about this level and L0, by the variation found here. Others too: the change also exceeds what other wordings, orders and \
         draws would move it, of which few levels say little; empty: no number of questions suffices"
            .to_owned(),
    );
    table.heading = Some("What a further run needs to detect a change of 5 points from L0".to_owned());
    table
}

/// The position of the choices that each subject prefers.
fn positions(found: &RunVariation) -> Table {
    let excess = "csv excess excess_low excess_high | terminal excess, 95 % interval | page excess [95 %]";
    let change = "csv change change_low change_high | terminal less L0, 95 % interval | page given less L0 [95 %]";
    let mut table = TableBuilder::new("positions", &found.positions)
        .page(VARIATION, "The letter that each model prefers: given more often than it is right, over all orders")
        .subject(|row| &row.subject, ToString::to_string)
        .column(Text, "terminal model", |row| row.subject.model.clone())
        .column(Text, "terminal condition", |row| row.subject.condition())
        .column(Text, "csv letter | terminal letter | page letter", |row| letter(row.position).to_string())
        .column(Percent, "csv given | terminal given | page given in %", |row| row.given)
        .column(Percent, "csv truth | terminal right | page right in %", |row| row.truth)
        .column(Points, excess, |row| row.excess)
        .column(P, "csv p | terminal p | page p", |row| row.p)
        .column(Points, change, |row| row.change)
        .column(P, "csv change_p | page p of the change", |row| row.change_p)
        .column(Count, "csv n | page n", |row| row.excess.n)
        .build();
    table.foot = Some("p: corrected over the letters of a row".to_owned());
    table.heading = Some("The letter that each model prefers, over all orders of the choices".to_owned());
    table
}

/// Standard deviations by source, with a row for each subject.
fn components(found: &RunVariation) -> Table {
    let caption = "Where the variation comes from: standard deviation of a reply by source";
    let mut table = TableBuilder::new("variation", &found.accuracies)
        .page(VARIATION, caption)
        .subject(|row| &row.subject, ToString::to_string)
        .column(Text, "terminal model", |row| row.subject.model.clone())
        .column(Text, "terminal condition", |row| row.subject.condition());
    // The page has room for eight sources, or for seven and one range.
    let has_room = Facet::ALL.into_iter().any(|facet| found.levels(facet) < 2);
    for source in Source::ALL {
        let name = source.name();
        let stem = name.replace(" × ", "_");
        let shown = match source {
            Source::Facet(facet) if found.levels(facet) > 1 => format!(" | terminal {name} | page {name} [95 %]"),
            Source::QuestionFacet(facet) if found.levels(facet) > 1 => format!(" | page {name}"),
            Source::Scene if has_room => format!(" | page {name}"),
            Source::Question | Source::Rest => format!(" | terminal {name} | page {name}"),
            Source::Scene | Source::Facet(_) | Source::QuestionFacet(_) | Source::Combination => String::new(),
        };
        let heads = format!("csv {stem} {stem}_low {stem}_high{shown}");
        table = table.column(Share, &*heads, move |row| row.components.deviation(source));
    }
    let widest = Facet::ALL.into_iter().find(|facet| found.levels(*facet) > 1);
    for facet in Facet::ALL {
        let name = facet.name();
        let shown = match widest {
            Some(widest) if widest == facet && has_room => {
                format!(" | terminal best less worst {name}, 95 % interval | page best less worst {name} [95 %]")
            }
            Some(widest) if widest == facet => format!(" | terminal best less worst {name}, 95 % interval"),
            _ => String::new(),
        };
        let heads = format!("csv {name}_range {name}_range_low {name}_range_high{shown}");
        table = table.column(Points, &*heads, move |row| range(row, facet));
    }
    let mut table = table.build();
    table.heading = Some(format!("Where the variation comes from ({}), in % of accuracy", found.asked()));
    table
}

fn range(row: &AccuracyVariation, facet: Facet) -> TableCell {
    row.ranges.iter().find(|range: &&FacetRange| range.facet == facet).map(|range| range.range).into()
}

/// Differences with intervals for other wordings, orders and draws, and the combinations in which they hold.
fn differences(found: &RunVariation) -> Table {
    let difference = "csv difference low high | terminal difference, 95 % interval | page difference [95 %]";
    let mut table = TableBuilder::new("variation_differences", &found.differences)
        .page(VARIATION, "Does each difference hold in other wordings, orders and draws?")
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
    table.heading = Some("Differences, with intervals for other wordings, orders and draws too".to_owned());
    if let Some(ranks) = found.ranks {
        let [value, low, high] = [ranks.value, ranks.low, ranks.high].map(|value| format!("{value:.2}"));
        table.foot = Some(format!(
            "Order of the models at the darkest level: Kendall’s W {value} [{low}, {high}] over the wordings; 1: the same in all"
        ));
    }
    table
}
