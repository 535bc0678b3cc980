//! The sentence about wordings, orders and draws: whether the change in the dark holds in all of them ([`variation`]).

use super::sentence::{EffectDirection, NamedNumbers, Sentence};
use darkqa_score::findings::Findings;
use darkqa_score::variation::{DifferenceVariation, Facet, RunVariation};

/// The change from L0 at the darkest level of the main variant: the number of combinations of wording, order and draw with
/// its sign, and its range over the wordings. Of several models, it is about the one whose change depends most on them.
/// `None` if every question was asked in one wording, one order and one draw.
pub(super) fn variation(findings: &Findings<'_>) -> Option<Sentence> {
    let found = findings.variation.as_ref()?;
    let main = findings.grid.main_variant()?;
    let models = findings.models_of(&main);
    let change = found
        .darkest_changes(&findings.grid)
        .into_iter()
        .filter(|row| models.contains(&&*row.first.model))
        .reduce(|most, next| if dependence(next) > dependence(most) { next } else { most })?;
    let mut numbers = NamedNumbers::new(findings.unit);
    let level = change.first.level.map_or_else(String::new, |level| level.to_string());
    numbers.at(&level);
    let of_model = if models.len() > 1 { format!(" of {}", change.first.model) } else { String::new() };
    let points = numbers.points("change", change.found.difference.value);
    let signs = change.found.signs;
    let same = numbers.count("same_sign", signs.same);
    let all = numbers.count("combinations", signs.of);
    let range = change.by_wording().map_or_else(String::new, |[least, most]| {
        let [least, most] = [("least", least), ("most", most)].map(|(name, value)| numbers.points(name, value));
        format!(", {least} to {most} by wording")
    });
    let text = format!(
        "At {level} the change{of_model} from L0, {points} points, has the same sign in {same} of {all} combinations of {}{range}.",
        found.asked()
    );
    let interval = numbers.difference("", change.found.difference);
    let at_light = wording_range(found, change).map_or_else(String::new, |wording| {
        format!("; at L0 the best wording is {} points above the worst", numbers.size("wording_at_L0", wording))
    });
    let detail = format!("{interval} for other wordings, orders and draws, too{at_light}");
    Some(numbers.sentence("variation", EffectDirection::Note, text, detail))
}

/// How much a change depends on wordings, orders and draws: the share of combinations with another sign, then the range over
/// the wordings.
fn dependence(row: &DifferenceVariation) -> (f64, f64) {
    let signs = row.found.signs;
    let other = 1.0 - signs.same as f64 / signs.of.max(1) as f64;
    (other, row.by_wording().map_or(0.0, |[least, most]| most - least))
}

/// How far wordings move the accuracy of the second side of a change; `None` with one wording.
fn wording_range(found: &RunVariation, change: &DifferenceVariation) -> Option<f64> {
    let row = found.accuracies.iter().find(|row| row.subject == change.second)?;
    row.ranges.iter().find(|range| range.facet == Facet::Wording).map(|range| range.range.value)
}
