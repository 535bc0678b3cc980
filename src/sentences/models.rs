//! Sentences about single models and families: the best model in the dark, and the family with the largest loss.

use std::cmp::Ordering;

use super::lights::Topic;
use super::sample::listed;
use super::sentence::{Numbers, Sentence, Tone, capitalised, level_runs};
use crate::text::words::family;
use crate::types::Variant;
use crate::types::degradations::{Axis, Kind};
use darkqa_score::comparisons::{BestInTheDark, Claim, Crossing, PooledFinding, PooledKind};
use darkqa_score::findings::Findings;
use darkqa_score::significance::Significance;

/// The model with the highest mean accuracy in the dark, and the models that it was not detected to be better than; or all models that
/// share that accuracy. If the order of the two leading models changes with the level, the sentence reports that change instead.
pub(super) fn best(findings: &Findings<'_>) -> Option<Sentence> {
    let best = findings.best.as_ref().filter(|best| best.is_possible())?;
    let lenient = findings.lenient_best.as_ref()?;
    let (leader, second) = (best.leader(), best.models.get(1)?);
    let mut numbers = Numbers::new(findings.unit);
    let over = dark_levels(best);
    let axis = best.variant.kind.map_or(Axis::LIGHT, Kind::axis);
    let place = axis.place;
    let leaders = leaders(best);
    let is_same = lenient.is_detected() && lenient.leader().model == leader.model;
    let (tone, text) = if let Some(crossing) = crossing(best, lenient) {
        let ((before, last), (after, first)) = (&crossing.before, &crossing.after);
        let text = format!("{before} is better to {last}, {after} from {first}.");
        (Tone::Note, text)
    } else if best.is_detected() && is_same {
        let text = format!("{} sees best {place} ({over}).", leader.model);
        (Tone::Better, text)
    } else if leaders.len() > 1 {
        let models = listed(&leaders);
        let text = format!("{models} share the highest mean accuracy {place} ({over}).");
        (Tone::NotShown, text)
    } else {
        let others = match &best.not_shown_better_than[..] {
            [] => "the others".to_owned(),
            others => others.join(", "),
        };
        let text = format!(
            "{} has the highest mean accuracy {place} ({over}), but was not detected to be better than {others}.",
            leader.model
        );
        (Tone::NotShown, text)
    };
    let value = numbers.percent("mean", leader.mean.value);
    let low = numbers.percent("mean_low", leader.mean.low);
    let high = numbers.percent("mean_high", leader.mean.high);
    let loss = leader.loss.map_or_else(String::new, |loss| {
        let loss = numbers.difference("_from_L0", loss);
        format!(", {loss} points from L0")
    });
    let test = if let Some(crossing) = crossing(best, lenient) {
        let lead = numbers.difference("_before", crossing.lead);
        let lag = numbers.difference("_after", crossing.lag);
        let p = numbers.p("p", crossing.p_report.unwrap_or(crossing.p));
        format!(
            "{} less {}: {lead} to {}, {lag} from {}, {p}",
            crossing.before.0, crossing.after.0, crossing.before.1, crossing.after.1
        )
    } else {
        let pair = best
            .pairs
            .iter()
            .find(|pair| pair.first == leader.model && pair.second == second.model)?;
        let difference = numbers.difference("", pair.difference);
        let p = numbers.p("p", best.p_report.unwrap_or(pair.holm));
        let parsing = if best.is_detected() && !is_same {
            ", detected in the strict parsing alone"
        } else {
            ""
        };
        format!("{difference} against {}, {p}{parsing}", second.model)
    };
    let items = numbers.count("n", best.items);
    let clusters = numbers.clusters(best.clusters);
    let without = match &best.without[..] {
        [] => String::new(),
        models => format!("; without {}, which answered less", models.join(", ")),
    };
    let detail = format!(
        "{} over {over}: {value} % [{low}, {high}]{loss}; {test}; n = {items} in {clusters}{without}",
        leader.model
    );
    let sentence = numbers.sentence("best", tone, text, detail);
    let topics = Topic::all(findings);
    Some(match topics.first() {
        Some(main) => main.add_light(&best.variant, sentence),
        None => sentence,
    })
}

/// The models with the highest mean accuracy in the dark: the leader, and those with the same accuracy.
fn leaders(best: &BestInTheDark) -> Vec<String> {
    let highest = best.leader().mean.value;
    best.models
        .iter()
        .filter(|other| highest - other.mean.value < ROUNDING)
        .map(|other| other.model.clone())
        .collect()
}

/// Maximum rounding error of equal means (chosen).
const ROUNDING: f64 = 1e-9;

/// The change of order of two models, if it is detected in both parsings.
fn crossing<'b>(best: &'b BestInTheDark, lenient: &BestInTheDark) -> Option<&'b Crossing> {
    let strict = best.crossing.as_ref().filter(|found| found.is_detected())?;
    let lenient = lenient
        .crossing
        .as_ref()
        .filter(|found| found.is_detected())?;
    let is_same = strict.before.0 == lenient.before.0 && strict.after.0 == lenient.after.0;
    is_same.then_some(strict)
}

/// The dark levels over which models are compared, as `L3–L5`.
pub(crate) fn dark_levels(best: &BestInTheDark) -> String {
    level_runs(&best.levels, &best.asked)
}

/// The families with the largest and the smallest loss at the darkest level, if a loss over all families is detected there and the two
/// intervals do not overlap. This is a description without a test, because the data chose the two families.
pub(super) fn families(findings: &Findings<'_>, variant: &Variant) -> Option<Sentence> {
    let of_families = findings.pooled.iter().filter(|finding| {
        finding.kind == PooledKind::Darkness
            && finding.family.is_some()
            && finding.variant == *variant
    });
    let darkest = of_families.clone().map(|finding| finding.level).max()?;
    let of_families: Vec<&PooledFinding> = of_families
        .filter(|finding| finding.level == darkest)
        .collect();
    let most = of_families.iter().min_by(|a, b| compare_values(a, b))?;
    let least = of_families.iter().max_by(|a, b| compare_values(a, b))?;
    let has_loss = findings.pooled.iter().any(|finding| {
        finding.kind == PooledKind::Darkness
            && finding.family.is_none()
            && finding.variant == *variant
            && finding.level == darkest
            && finding.claim() == Claim::Detected(Significance::Worse)
    });
    let (of_most, of_least) = (most.strict.difference, least.strict.difference);
    if !has_loss || most.strict.verdict != Significance::Worse || of_most.high >= of_least.low {
        return None;
    }
    let mut numbers = Numbers::new(findings.unit);
    let text = format!(
        "{} costs more in {} ({} points at {darkest}) than in {} ({}).",
        capitalised(darkest.axis().unwrap_or(Axis::LIGHT).cause),
        family(most.family.as_ref()),
        numbers.points("effect_most", of_most.value),
        family(least.family.as_ref()),
        numbers.points("effect_least", of_least.value)
    );
    let [of_most, of_least] = [("_most", of_most), ("_least", of_least)]
        .map(|(at, difference)| numbers.difference(at, difference));
    let sample = [("n_most", most), ("n_least", least)]
        .map(|(name, finding)| numbers.count(name, finding.items));
    let p = numbers.p("p", most.strict.holm);
    let detail = format!(
        "{of_most}, n = {}, against {of_least}, n = {}: the two intervals do not meet, which is no test; {p} is that of the loss in {}",
        sample[0],
        sample[1],
        family(most.family.as_ref())
    );
    Some(numbers.sentence("families", Tone::Note, text, detail))
}

fn compare_values(a: &PooledFinding, b: &PooledFinding) -> Ordering {
    let [a, b] = [a, b].map(|finding| finding.strict.difference.value);
    a.total_cmp(&b)
}
