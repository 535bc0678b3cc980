//! Sentences about single models and single families: which model sees best, and which family loses most.

use super::lights::Topic;
use super::sentence::{Numbers, Sentence, Tone, capitalised, level_runs};
use crate::report::words::family;
use crate::score::best::BestInTheDark;
use crate::score::findings::Findings;
use crate::score::pooled::PooledFinding;
use crate::score::pooled_kind::PooledKind;
use crate::score::significance::Significance;
use crate::types::KindReading;
use crate::types::degradation::{Axis, Kind};

/// The model that sees best over all levels, and those that it is not shown to be better than.
pub(super) fn best(findings: &Findings<'_>) -> Option<Sentence> {
    let best = findings.best.as_ref().filter(|best| best.is_possible())?;
    let (leader, second) = (best.leader(), best.models.get(1)?);
    let mut numbers = Numbers::of(findings.unit);
    let over = over_levels(best).map_or(String::new(), |over| format!(" {over}"));
    let axis = best.variant.kind.map_or(Axis::LIGHT, Kind::axis);
    let (place, unit) = (axis.place, axis.unit);
    let (tone, text) = if best.is_shown() {
        (
            Tone::Better,
            format!("{} sees best {place}{over}.", leader.model),
        )
    } else {
        let others = best.not_shown_better_than.join(", ");
        let text = format!(
            "{} sees best {place} by its mean{over}, but is not shown to be better than {others}.",
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
    let without = match &best.without[..] {
        [] => String::new(),
        models => format!("; without {}, not asked in this way", models.join(", ")),
    };
    let detail = format!(
        "mean accuracy over {unit} {value} % [{low}, {high}]{loss}; {difference} against {}, {p}; n = {items} in {clusters}{without}",
        second.model
    );
    let sentence = numbers.sentence("best", tone, text, detail);
    let topics = Topic::all(findings);
    Some(match topics.first() {
        Some(main) => main.named(&best.variant, sentence),
        None => sentence,
    })
}

/// The levels that the comparison of areas rests on, as `over L0, L3`; `None` if they are all that some model was asked.
pub(in crate::report) fn over_levels(best: &BestInTheDark) -> Option<String> {
    let is_all = best.levels == best.asked;
    (!is_all).then(|| format!("over {}", level_runs(&best.levels, &best.asked)))
}

/// The families that lose most and least at the darkest level, one against the other, if their intervals do not meet.
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
        "{} costs more in {} ({} points at {darkest}) than in {} ({}).",
        capitalised(darkest.axis().unwrap_or(Axis::LIGHT).cause),
        family(most.family.as_ref()),
        numbers.points("effect_most", most.difference.value),
        family(least.family.as_ref()),
        numbers.points("effect_least", least.difference.value)
    );
    let [of_most, of_least] = [("_most", most), ("_least", least)]
        .map(|(at, finding)| numbers.difference(at, finding.difference));
    let sample = [("n_most", most), ("n_least", least)]
        .map(|(name, finding)| numbers.count(name, finding.items));
    let p = numbers.p("p", most.holm);
    let detail = format!(
        "{of_most}, n = {}, against {of_least}, n = {}: the two intervals do not meet; {p} is that of the loss in {}",
        sample[0],
        sample[1],
        family(most.family.as_ref())
    );
    Some(numbers.sentence("families", Tone::Worse, text, detail))
}
