//! Sentences about what darkness costs all models together, with each variant.

use super::format::format_alone;
use super::lights::{Topic, findings_of_kind, means_of_set};
use super::pooled::{
    UNCONFIRMED, detail, is_unconfirmed, lower_or_higher, mean_levels, reserved, runs, with_verdict,
};
use super::sample::WIDE;
use super::sentence::{Numbers, Sentence, Tone, capitalised};
use crate::text::words::light;
use crate::types::degradations::{Axis, Kind};
use crate::types::{RunGroup, Variant};
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::{Claim, PooledFinding, PooledKind};
use darkqa_score::findings::Findings;
use darkqa_score::significance::Significance;

/// The cost of darkness, or of another cause, in each topic.
pub(super) fn darkness(findings: &Findings<'_>) -> Vec<Sentence> {
    let topics = Topic::all(findings);
    topics
        .iter()
        .flat_map(|topic| topic_sentences(findings, topic))
        .collect()
}

/// The cost of darkness with the last kind of degradation, in each of its lights; then with another kind, if the last
/// does not show it. If the two differ, both are named.
fn topic_sentences(findings: &Findings<'_>, topic: &Topic<'_>) -> Vec<Sentence> {
    let Topic { lights, others, .. } = topic;
    let levels = |variant: &Variant| findings_of_kind(findings, PooledKind::Darkness, variant);
    let mean = |variant: &Variant| {
        let means = means_of_set(findings, PooledKind::Darkness, variant);
        means.into_iter().next()
    };
    let verdict_with = |variant: &Variant| {
        let (levels, mean) = (levels(variant), mean(variant));
        verdict(&levels).map(|found| match mean.and_then(mean_verdict) {
            Some(of_mean) if !found.is_shown() => of_mean,
            _ => found,
        })
    };
    let is_of_runs =
        |one: &Variant, other: &Variant| RunGroup::meet(one.group.as_ref(), other.group.as_ref());
    let mut sentences = Vec::new();
    for variant in lights {
        let mut beside = others.iter().filter(|other| is_of_runs(other, variant));
        let found = verdict_with(variant);
        let differs = beside.any(|other| verdict_with(other).is_some_and(|of| Some(of) != found));
        let name = (differs && lights.len() == 1).then(|| name(variant));
        let sentence = with_variant(
            &levels(variant),
            mean(variant),
            name.as_deref(),
            findings.unit,
        );
        sentences.extend(sentence.map(|sentence| topic.named(variant, sentence)));
    }
    for other in others {
        let found = verdict_with(other);
        let is_said = lights
            .iter()
            .filter(|variant| is_of_runs(other, variant))
            .any(|variant| verdict_with(variant) == found);
        if !is_said && found.is_some_and(Significance::is_shown) {
            let name = name(other);
            let sentence = with_variant(&levels(other), mean(other), Some(&name), findings.unit);
            sentences.extend(sentence);
        }
    }
    sentences
}

/// The verdict over all levels: a loss, else a gain, else nothing; `None` without a verdict.
fn verdict(levels: &[&PooledFinding]) -> Option<Significance> {
    [
        Significance::Worse,
        Significance::Better,
        Significance::NotShown,
    ]
    .into_iter()
    .find(|verdict| !with_verdict(levels, *verdict).is_empty())
}

/// The verdict over several levels together; `None` if nothing is detected.
fn mean_verdict(mean: &PooledFinding) -> Option<Significance> {
    match mean.claim() {
        Claim::Detected(verdict) => Some(verdict),
        _ => None,
    }
}

/// A variant at the beginning of a sentence.
fn name(variant: &Variant) -> String {
    match variant.kind {
        Some(Kind::Exposure) => format!("By the exposure drop alone{}", variant.group_suffix()),
        _ => capitalised(&light(variant, None)),
    }
}

/// The cost of darkness with one variant, at the darkest level where it is shown; else over the darker levels together, if it is shown
/// there; else that nothing is shown at the darkest level. The sentence begins with `name`.
pub(super) fn with_variant(
    levels: &[&PooledFinding],
    mean: Option<&PooledFinding>,
    name: Option<&str>,
    unit: ClusterUnit,
) -> Option<Sentence> {
    let mut numbers = Numbers::new(unit);
    let verdict = verdict(levels)?;
    let shown_mean = mean.and_then(|mean| Some((mean, mean_verdict(mean)?)));
    if let (Some((mean, of_mean)), false) = (shown_mean, verdict.is_shown()) {
        return Some(over_levels(mean, levels, of_mean, name, numbers));
    }
    let found = with_verdict(levels, verdict);
    let darkest = found.last()?;
    let size = darkest.strict.difference.value;
    let cause = darkest.level.axis().unwrap_or(Axis::LIGHT).cause;
    let (text, more) = match verdict {
        Significance::Worse => (
            format!(
                "{cause} costs {} points at {}, from {} % at L0.",
                numbers.size("cost", size),
                darkest.level,
                numbers.percent("L0", darkest.strict.second)
            ),
            format!("; a loss is shown at {}", runs(&found, levels)),
        ),
        Significance::Better => (
            format!(
                "at {} accuracy is {} points higher than at L0.",
                darkest.level,
                numbers.size("gain", size)
            ),
            format!("; at {}", darkest.level),
        ),
        _ => {
            if let Some(format) = format_alone(levels, unit) {
                return Some(format);
            }
            let text = if is_unconfirmed(darkest) {
                format!(
                    "at {} accuracy is {} points {} than at L0{UNCONFIRMED}.",
                    darkest.level,
                    numbers.size("effect", size),
                    lower_or_higher(size),
                )
            } else {
                format!(
                    "no loss by {cause} was detected at any level{}.",
                    not_ruled_out(&found, &mut numbers)
                )
            };
            let reserved = reserved(darkest, &mut numbers);
            (text, format!("; at {}{reserved}", darkest.level))
        }
    };
    let text = named(&text, name);
    let detail = detail(darkest, &mut numbers, &more);
    Some(numbers.sentence("darkness", Tone::from(verdict), text, detail))
}

/// A sentence with the variant before it.
fn named(text: &str, name: Option<&str>) -> String {
    match name {
        None => capitalised(text),
        Some(name) => format!("{name}, {text}"),
    }
}

/// The cost of darkness over several levels together, none of which shows it alone.
fn over_levels(
    mean: &PooledFinding,
    levels: &[&PooledFinding],
    verdict: Significance,
    name: Option<&str>,
    mut numbers: Numbers,
) -> Sentence {
    let size = mean.strict.difference.value;
    let cause = mean.level.axis().unwrap_or(Axis::LIGHT).cause;
    let at = mean_levels(mean, levels);
    let text = if verdict == Significance::Worse {
        format!(
            "{cause} costs {} points on average over {at}, from {} % at L0.",
            numbers.size("cost", size),
            numbers.percent("L0", mean.strict.second)
        )
    } else {
        format!(
            "over {at} accuracy is {} points higher on average than at L0.",
            numbers.size("gain", size)
        )
    };
    let more = format!("; mean of {at}, no level alone is shown");
    let detail = detail(mean, &mut numbers, &more);
    numbers.sentence("darkness", verdict.into(), named(&text, name), detail)
}

/// The largest loss that the intervals leave open, if it is large: so that nobody takes too few images for eyes that see in the dark.
fn not_ruled_out(levels: &[&PooledFinding], numbers: &mut Numbers) -> String {
    let lowest = |a: &&&PooledFinding, b: &&&PooledFinding| {
        let low = |of: &PooledFinding| of.strict.difference.low;
        low(a).total_cmp(&low(b))
    };
    let Some(finding) = levels.iter().min_by(lowest) else {
        return String::new();
    };
    let largest = -finding.strict.difference.low;
    if largest <= WIDE {
        return String::new();
    }
    let points = numbers.number("possible loss", 100.0 * largest, 0);
    let level = finding.level;
    format!("; a loss of up to {points} points at {level} cannot be excluded")
}
