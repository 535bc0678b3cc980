//! Sentences about all models together: darkness, noise, enhancers, and what so few clusters can show.

use super::sentence::{Numbers, Sentence, Tone, level_runs, models};
use crate::score::cluster::ClusterUnit;
use crate::score::findings::Findings;
use crate::score::pooled::PooledFinding;
use crate::score::significance::Significance;
use crate::types::AxisLevel;
use crate::types::control::OBSERVER;

/// Largest number of sentences about one enhancer.
const MAX_PER_ENHANCER: usize = 3;

/// Half-width of an interval in points above which the sample is called small.
const WIDE: f64 = 0.05;

/// What darkness costs, at the darkest level where it is shown; else that nothing is shown at the darkest level.
pub(super) fn darkness(levels: &[&PooledFinding], unit: ClusterUnit) -> Option<Sentence> {
    let darkest = levels.last()?;
    let shown = of_verdict(levels, Significance::Worse);
    let mut numbers = Numbers::of(unit);
    let Some(worst) = shown.last() else {
        let better = of_verdict(levels, Significance::Better);
        let (at, text) = if let Some(better) = better.last() {
            let gain = numbers.size("gain", better.difference.value);
            let text = format!(
                "At {} accuracy is {gain} points higher than at L0.",
                better.level
            );
            (better, text)
        } else {
            let text = "It is not shown that darkness costs anything at any level.";
            (darkest, text.to_owned())
        };
        let detail = detail(at, &mut numbers, &format!("; at {}", at.level));
        return Some(numbers.sentence("darkness", at.verdict.into(), text, detail));
    };
    let text = format!(
        "Darkness costs {} points at {}, from {} % at L0.",
        numbers.size("cost", worst.difference.value),
        worst.level,
        numbers.percent("L0", worst.second)
    );
    let more = format!("; a loss is shown at {}", runs(&shown, levels));
    let detail = detail(worst, &mut numbers, &more);
    Some(numbers.sentence("darkness", Tone::Worse, text, detail))
}

/// What sensor noise costs beyond the exposure drop, at the level where it costs most.
pub(super) fn noise(levels: &[&PooledFinding], unit: ClusterUnit) -> Option<Sentence> {
    let mut numbers = Numbers::of(unit);
    for (verdict, verb) in [
        (Significance::Worse, "costs"),
        (Significance::Better, "adds"),
    ] {
        let shown = of_verdict(levels, verdict);
        let Some(largest) = largest(&shown) else {
            continue;
        };
        let limit = if shown.len() > 1 { "up to " } else { "" };
        let text = format!(
            "Sensor noise {verb} {limit}{} points beyond the exposure drop ({}).",
            numbers.size("effect", largest.difference.value),
            largest.level
        );
        let more = format!("; shown at {}", runs(&shown, levels));
        let detail = detail(largest, &mut numbers, &more);
        return Some(numbers.sentence("noise", verdict.into(), text, detail));
    }
    let largest = largest(levels)?;
    let text =
        "It is not shown that sensor noise costs anything beyond the exposure drop.".to_owned();
    let detail = detail(
        largest,
        &mut numbers,
        &format!("; largest at {}", largest.level),
    );
    Some(numbers.sentence("noise", Tone::NotShown, text, detail))
}

/// What each enhancer does: a sentence for each verdict, with its levels.
pub(super) fn enhancers(all: &[&PooledFinding], unit: ClusterUnit) -> Vec<Sentence> {
    let mut sentences = Vec::new();
    for levels in all.chunk_by(|a, b| a.enhancer == b.enhancer) {
        let of_one = [
            Significance::Worse,
            Significance::Better,
            Significance::NotShown,
        ]
        .map(|verdict| enhancer(levels, verdict, unit));
        sentences.extend(of_one.into_iter().flatten().take(MAX_PER_ENHANCER));
    }
    sentences
}

fn enhancer(
    levels: &[&PooledFinding],
    verdict: Significance,
    unit: ClusterUnit,
) -> Option<Sentence> {
    let of_verdict = of_verdict(levels, verdict);
    let largest = largest(&of_verdict)?;
    let name = largest.enhancer.as_ref()?;
    let at = runs(&of_verdict, levels);
    let mut numbers = Numbers::of(unit);
    let (text, more) = match verdict {
        Significance::Worse | Significance::Better => {
            let verb = if verdict == Significance::Worse {
                "harms"
            } else {
                "helps"
            };
            let size = numbers.size("effect", largest.difference.value);
            let limit = if of_verdict.len() > 1 { "up to " } else { "" };
            if is_observer(largest) {
                let more = if verdict == Significance::Better {
                    "more"
                } else {
                    "less"
                };
                (
                    format!(
                        "With {name} the observer confirms {more} at {at}, by {limit}{size} points."
                    ),
                    format!(
                        "; at {}; local tone and sharpening count as noise, so this does not show that evidence is lost",
                        largest.level
                    ),
                )
            } else {
                (
                    format!("{name} {verb} at {at}, by {limit}{size} points."),
                    format!("; at {}", largest.level),
                )
            }
        }
        _ => (
            format!("{name} at {at}: neither help nor harm is shown."),
            format!("; largest at {}", largest.level),
        ),
    };
    let more = more + &uncorrected(largest, &mut numbers);
    let detail = detail(largest, &mut numbers, &more);
    Some(numbers.sentence("enhancer", verdict.into(), text, detail))
}

/// Whether a finding is about the observer alone. It has its own words: what it does not confirm need not be lost.
fn is_observer(finding: &PooledFinding) -> bool {
    finding.models == [OBSERVER]
}

/// An interval that leaves out 0 although nothing is shown needs a word.
fn uncorrected(finding: &PooledFinding, numbers: &mut Numbers) -> String {
    let difference = finding.difference;
    if finding.verdict != Significance::NotShown
        || (difference.low <= 0.0 && difference.high >= 0.0)
    {
        return String::new();
    }
    let (p, levels) = (
        numbers.p("uncorrected_p", finding.p),
        numbers.count("levels", finding.levels),
    );
    format!(", not shown after correction for {levels} levels (uncorrected {p})")
}

/// That no verdict is possible with so few clusters; `None` if one is possible for some finding.
pub(super) fn impossible(findings: &Findings<'_>) -> Option<Sentence> {
    let whole = findings
        .pooled
        .iter()
        .filter(|finding| finding.family.is_none());
    let possible = |finding: &&PooledFinding| finding.verdict != Significance::TooFewClusters;
    let best = whole
        .clone()
        .min_by(|a, b| a.least_holm.total_cmp(&b.least_holm))?;
    if whole.clone().any(|finding| possible(&finding)) {
        return None;
    }
    let mut numbers = Numbers::of(findings.unit);
    let text = format!(
        "With {} no difference can be shown here, however large it is.",
        numbers.clusters(best.clusters)
    );
    let least = numbers.p("least_p", best.least_holm);
    let detail = format!(
        "the smallest possible {least}; take more {}s",
        findings.unit
    );
    Some(numbers.sentence("power", Tone::Note, text, detail))
}

/// That only large effects can be shown, if the widest interval is wide. How large differs by finding: the narrowest and the widest
/// interval say it.
pub(super) fn power(all: &[PooledFinding], unit: ClusterUnit) -> Option<Sentence> {
    let whole = all.iter().filter(|finding| {
        finding.family.is_none() && finding.verdict != Significance::TooFewClusters
    });
    let half = |finding: &PooledFinding| (finding.difference.high - finding.difference.low) / 2.0;
    let by_width = |a: &&PooledFinding, b: &&PooledFinding| half(a).total_cmp(&half(b));
    let narrowest = half(whole.clone().min_by(by_width)?);
    let widest = whole.max_by(by_width)?;
    if half(widest) <= WIDE {
        return None;
    }
    let mut numbers = Numbers::of(unit);
    let mut points = |name, half: f64| numbers.number(name, 100.0 * half, 0);
    let [least, most] = [
        points("narrowest", narrowest),
        points("widest", half(widest)),
    ];
    let (range, detail) = if least == most {
        (most, "half of the widest interval")
    } else {
        let range = format!("{least} to {most}");
        (range, "half of the narrowest and of the widest interval")
    };
    let text = format!(
        "With {} an effect must be larger than about {range} points to be shown here.",
        numbers.clusters(widest.clusters)
    );
    let detail = format!("{detail} of the findings over all families");
    Some(numbers.sentence("power", Tone::Note, text, detail))
}

/// The findings with a verdict.
pub(super) fn of_verdict<'f>(
    levels: &[&'f PooledFinding],
    verdict: Significance,
) -> Vec<&'f PooledFinding> {
    let levels = levels.iter().copied();
    levels
        .filter(|finding| finding.verdict == verdict)
        .collect()
}

/// The finding with the largest difference in either direction; of several, the first.
pub(super) fn largest<'f>(levels: &[&'f PooledFinding]) -> Option<&'f PooledFinding> {
    let size = |finding: &PooledFinding| finding.difference.value.abs();
    levels.iter().copied().reduce(|largest, next| {
        if size(next) > size(largest) {
            next
        } else {
            largest
        }
    })
}

/// The levels of some findings among all of a set.
pub(super) fn runs(some: &[&PooledFinding], all: &[&PooledFinding]) -> String {
    let [some, all] = [some, all].map(|findings| {
        let levels = findings.iter().map(|finding| finding.level);
        levels.collect::<Vec<AxisLevel>>()
    });
    level_runs(&some, &all)
}

/// Effect, interval, p and n of a finding, with `more` before n.
pub(super) fn detail(finding: &PooledFinding, numbers: &mut Numbers, more: &str) -> String {
    let who = models(&finding.models, numbers);
    let difference = numbers.difference("", finding.difference);
    let p = numbers.p("p", finding.holm);
    let sample = numbers.sample(finding);
    format!("{who}: {difference}, {p}{more}; {sample}")
}
