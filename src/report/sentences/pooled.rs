//! Sentences about all models together: noise and enhancers.

use super::format::format_alone;
use super::sentence::{Numbers, Sentence, Tone, level_runs, models};
use crate::score::claim::Claim;
use crate::score::cluster::ClusterUnit;
use crate::score::pooled::PooledFinding;
use crate::score::significance::Significance;
use crate::score::subject;
use crate::types::AxisLevel;

/// Largest number of sentences about one enhancer.
const MAX_PER_ENHANCER: usize = 3;

/// How accuracy with noise differs from that by the exposure drop alone: a sentence for each verdict, at the level where it differs
/// most. The two variants differ in contrast, too, so this is no effect of noise alone.
pub(super) fn noise(levels: &[&PooledFinding], unit: ClusterUnit) -> Vec<Sentence> {
    let verdicts = [
        (Significance::Worse, "lower"),
        (Significance::Better, "higher"),
    ];
    let shown = verdicts.into_iter().filter_map(|(verdict, word)| {
        let shown = of_verdict(levels, verdict);
        let largest = PooledFinding::largest(&shown)?;
        let mut numbers = Numbers::of(unit);
        let limit = if shown.len() > 1 { "up to " } else { "" };
        let text = format!(
            "With noise, accuracy is {limit}{} points {word} than by the exposure drop alone ({}).",
            numbers.size("effect", largest.strict.difference.value),
            largest.level
        );
        let more = format!("; shown at {}", runs(&shown, levels));
        let detail = detail(largest, &mut numbers, &more);
        Some(numbers.sentence("noise", verdict.into(), text, detail))
    });
    let shown: Vec<Sentence> = shown.collect();
    let unshown = of_verdict(levels, Significance::NotShown);
    match PooledFinding::largest(&unshown) {
        Some(largest) if shown.is_empty() => {
            if let Some(format) = format_alone(levels, unit) {
                return vec![format];
            }
            let mut numbers = Numbers::of(unit);
            let text =
                "No difference in accuracy between noise and the exposure drop alone was detected.";
            let more = format!(
                "; largest at {}{}",
                largest.level,
                reserved(largest, &mut numbers)
            );
            let detail = detail(largest, &mut numbers, &more);
            vec![numbers.sentence("noise", Tone::NotShown, text.to_owned(), detail)]
        }
        _ => shown,
    }
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
    let largest = PooledFinding::largest(&of_verdict)?;
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
            let size = numbers.size("effect", largest.strict.difference.value);
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
        _ => {
            if let Some(format) = format_alone(&of_verdict, unit) {
                return Some(format);
            }
            (
                format!("{name} at {at}: no effect detected."),
                format!("; largest at {}", largest.level),
            )
        }
    };
    let more = more + &reserved(largest, &mut numbers);
    let detail = detail(largest, &mut numbers, &more);
    Some(numbers.sentence("enhancer", verdict.into(), text, detail))
}

/// Whether a finding is about the observer alone. It has its own words: what it does not confirm need not be lost.
fn is_observer(finding: &PooledFinding) -> bool {
    matches!(&finding.models[..], [one] if subject::is_observer(one))
}

/// Why a finding is not among those detected although its own test or its interval says so; empty otherwise.
pub(super) fn reserved(finding: &PooledFinding, numbers: &mut Numbers) -> String {
    let strict = &finding.strict;
    let difference = strict.difference;
    match finding.claim() {
        Claim::Detected(_) | Claim::Impossible => String::new(),
        Claim::StrictOnly(_) => ", detected in the strict parsing alone".to_owned(),
        Claim::InOwnSet => format!(
            ", detected only if no other finding is counted ({})",
            numbers.p("own_p", strict.holm)
        ),
        Claim::Open if difference.low <= 0.0 && difference.high >= 0.0 => String::new(),
        Claim::Open => format!(
            ", not detected after correction (uncorrected {})",
            numbers.p("uncorrected_p", strict.p)
        ),
    }
}

/// The findings with a verdict in both parsings and after the correction over all sentences; those without one are
/// [`Significance::NotShown`].
pub(super) fn of_verdict<'f>(
    levels: &[&'f PooledFinding],
    verdict: Significance,
) -> Vec<&'f PooledFinding> {
    let has = |finding: &&PooledFinding| match finding.claim() {
        Claim::Detected(found) => found == verdict,
        Claim::Impossible => false,
        _ => verdict == Significance::NotShown,
    };
    levels.iter().copied().filter(has).collect()
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
    let strict = &finding.strict;
    let difference = numbers.difference("", strict.difference);
    let p = numbers.p("p", strict.p_report.unwrap_or(strict.holm));
    let sample = numbers.sample(finding);
    format!("{who}: {difference}, {p}{more}; {sample}")
}
