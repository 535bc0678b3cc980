//! Sentences about single models and single families: which model sees best, and which family loses most.

use super::sentence::{Numbers, Sentence, Tone};
use crate::report::words::family;
use crate::score::findings::Findings;
use crate::score::pooled::PooledFinding;
use crate::score::pooled_kind::PooledKind;
use crate::score::significance::Significance;
use crate::types::KindReading;

/// The model that sees best over all levels, and those that it is not shown to be better than.
pub(super) fn best(findings: &Findings<'_>) -> Option<Sentence> {
    let best = findings.best.as_ref()?;
    let (leader, second) = (best.leader(), best.models.get(1)?);
    let mut numbers = Numbers::of(findings.unit);
    let (tone, text) = if best.is_shown() {
        (
            Tone::Better,
            format!("{} sees best in the dark.", leader.model),
        )
    } else {
        let others = best.not_shown_better_than.join(", ");
        let text = format!(
            "{} sees best in the dark by its mean, but is not shown to be better than {others}.",
            leader.model
        );
        (Tone::NotShown, text)
    };
    let percent = |numbers: &mut Numbers, name: &str, share: f64| numbers.percent(name, share);
    let value = percent(&mut numbers, "area", leader.area.value);
    let low = percent(&mut numbers, "area_low", leader.area.low);
    let high = percent(&mut numbers, "area_high", leader.area.high);
    let loss = leader.loss.map(|loss| {
        let loss = numbers.difference("_from_L0", loss);
        format!(", {loss} points from L0")
    });
    let loss = loss.unwrap_or_default();
    let pair = best
        .pairs
        .iter()
        .find(|pair| pair.first == leader.model && pair.second == second.model)?;
    let difference = numbers.difference("", pair.difference);
    let p = numbers.p("p", pair.holm);
    let items = numbers.count("n", best.items);
    let clusters = numbers.clusters(best.clusters);
    let detail = format!(
        "mean accuracy over EV {value} % [{low}, {high}]{loss}; {difference} against {}, {p}; n = {items} in {clusters}",
        second.model
    );
    Some(numbers.sentence("best", tone, text, detail))
}

/// The families that lose most and least at the darkest level, if their intervals do not meet.
pub(super) fn families(findings: &Findings<'_>, variant: &KindReading) -> Option<Sentence> {
    let pooled = findings.pooled.iter();
    let of_families = pooled.filter(|finding| {
        finding.kind == PooledKind::Darkness
            && finding.family.is_some()
            && finding.variant == *variant
    });
    let darkest = of_families.clone().map(|finding| finding.level).max()?;
    let of_families: Vec<&PooledFinding> = of_families
        .filter(|finding| finding.level == darkest)
        .collect();
    let by_value = |a: &&&PooledFinding, b: &&&PooledFinding| {
        a.difference.value.total_cmp(&b.difference.value)
    };
    let most = of_families.iter().min_by(by_value)?;
    let least = of_families.iter().max_by(by_value)?;
    if most.verdict != Significance::Worse || most.difference.high >= least.difference.low {
        return None;
    }
    let mut numbers = Numbers::of(findings.unit);
    let text = format!(
        "Darkness costs most in {} ({} points at {darkest}), least in {}.",
        family(most.family.as_ref()),
        numbers.number("effect", 100.0 * most.difference.value, 1),
        family(least.family.as_ref())
    );
    let [of_most, of_least] = [("_most", most), ("_least", least)]
        .map(|(at, finding)| numbers.difference(at, finding.difference));
    let sample = [("n_most", most), ("n_least", least)]
        .map(|(name, finding)| numbers.count(name, finding.items));
    let p = numbers.p("p", most.holm);
    let detail = format!(
        "{of_most}, {p}, n = {}; against {of_least}, n = {}; the two intervals do not meet",
        sample[0], sample[1]
    );
    Some(numbers.sentence("families", Tone::Worse, text, detail))
}
