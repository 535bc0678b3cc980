//! Sentences about all models together: noise and enhancers.

use super::format::format_alone;
use super::sentence::{Numbers, Sentence, Tone, level_runs, models};
use crate::types::AxisLevel;
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::{Claim, PooledFinding};
use darkqa_score::model_in_condition;
use darkqa_score::significance::Significance;

/// Largest number of sentences about one enhancer.
const MAX_PER_ENHANCER: usize = 3;

/// Findings with one verdict, and how sentences speak of them: the level where they are largest, or the mean of levels of which none is
/// detected alone.
struct Shown<'f> {
    largest: &'f PooledFinding,
    /// The levels.
    at: String,
    /// Whether there are several levels.
    are_several: bool,
}

impl<'f> Shown<'f> {
    /// The findings of levels with a verdict, if there are any.
    fn levels(levels: &[&'f PooledFinding], verdict: Significance) -> Option<Self> {
        let shown = with_verdict(levels, verdict);
        Some(Self {
            largest: PooledFinding::largest(&shown)?,
            at: runs(&shown, levels),
            are_several: shown.len() > 1,
        })
    }

    /// The findings of levels with a verdict, and each mean with that verdict of whose levels none has it.
    fn all(
        levels: &[&'f PooledFinding],
        means: &[&'f PooledFinding],
        verdict: Significance,
    ) -> Vec<Self> {
        let shown = with_verdict(levels, verdict);
        let is_alone = |mean: &&PooledFinding| {
            let mut shown = shown.iter();
            !shown.any(|finding| mean.mean_over.contains(&finding.level))
        };
        let means = with_verdict(means, verdict)
            .into_iter()
            .filter(is_alone)
            .map(|mean| Self {
                largest: mean,
                at: mean_levels(mean, levels),
                are_several: true,
            });
        let levels = Self::levels(levels, verdict);
        levels.into_iter().chain(means).collect()
    }

    /// `up to 5.0 points`, `5.0 points` of one level, or `5.0 points on average`.
    fn size(&self, numbers: &mut Numbers) -> String {
        let size = numbers.size("effect", self.largest.strict.difference.value);
        if self.is_mean() {
            format!("{size} points on average")
        } else if self.are_several {
            format!("up to {size} points")
        } else {
            format!("{size} points")
        }
    }

    fn is_mean(&self) -> bool {
        !self.largest.mean_over.is_empty()
    }

    /// The level, or the levels of the mean, as `; at L4` or `; mean of L4–L5`.
    fn place(&self) -> String {
        if self.is_mean() {
            format!("; mean of {}", self.at)
        } else {
            format!("; at {}", self.largest.level)
        }
    }
}

/// The levels of a mean among all of a set.
pub(super) fn mean_levels(mean: &PooledFinding, levels: &[&PooledFinding]) -> String {
    let all: Vec<AxisLevel> = levels.iter().map(|finding| finding.level).collect();
    level_runs(&mean.mean_over, &all)
}

/// The levels about which nothing is detected, alone or as a mean.
fn unshown<'f>(levels: &[&'f PooledFinding], means: &[&PooledFinding]) -> Vec<&'f PooledFinding> {
    let is_detected = |mean: &&PooledFinding| matches!(mean.claim(), Claim::Detected(_));
    let means: Vec<&PooledFinding> = means.iter().copied().filter(is_detected).collect();
    let mut unshown = with_verdict(levels, Significance::NotShown);
    unshown.retain(|finding| {
        !means
            .iter()
            .any(|mean| mean.mean_over.contains(&finding.level))
    });
    unshown
}

/// How accuracy with noise differs from that by the exposure drop alone: a sentence for each verdict, at the level where it differs
/// most, or over several. The two variants differ in contrast, too, so this is no effect of noise alone.
pub(super) fn noise(
    levels: &[&PooledFinding],
    means: &[&PooledFinding],
    unit: ClusterUnit,
) -> Vec<Sentence> {
    let mut sentences = Vec::new();
    for (verdict, word) in [
        (Significance::Worse, "lower"),
        (Significance::Better, "higher"),
    ] {
        for shown in Shown::all(levels, means, verdict) {
            let mut numbers = Numbers::new(unit);
            let size = shown
                .size(&mut numbers)
                .replace(" points", &format!(" points {word}"));
            let (at, more) = if shown.is_mean() {
                (shown.at.clone(), shown.place())
            } else {
                let at = shown.largest.level.to_string();
                (at, format!("; shown at {}", shown.at))
            };
            let text =
                format!("With noise, accuracy is {size} than by the exposure drop alone ({at}).");
            let detail = detail(shown.largest, &mut numbers, &more);
            sentences.push(numbers.sentence("noise", verdict.into(), text, detail));
        }
    }
    if !sentences.is_empty() {
        return sentences;
    }
    let Some(largest) = PooledFinding::largest(&unshown(levels, means)) else {
        return sentences;
    };
    if let Some(format) = format_alone(levels, unit) {
        return vec![format];
    }
    let mut numbers = Numbers::new(unit);
    let text = if is_unconfirmed(largest) {
        let difference = largest.strict.difference.value;
        format!(
            "With noise, accuracy is {} points {} than by the exposure drop alone ({}){UNCONFIRMED}.",
            numbers.size("effect", difference),
            lower_or_higher(difference),
            largest.level
        )
    } else {
        "No difference in accuracy between noise and the exposure drop alone was detected."
            .to_owned()
    };
    let more = format!(
        "; largest at {}{}",
        largest.level,
        reserved(largest, &mut numbers)
    );
    let detail = detail(largest, &mut numbers, &more);
    vec![numbers.sentence("noise", Tone::NotShown, text, detail)]
}

/// The effects of each enhancer: a sentence for each verdict, with its levels.
pub(super) fn enhancers(
    all: &[&PooledFinding],
    means: &[&PooledFinding],
    unit: ClusterUnit,
) -> Vec<Sentence> {
    let mut sentences = Vec::new();
    for levels in all.chunk_by(|a, b| a.enhancer == b.enhancer) {
        let own: Vec<&PooledFinding> = means
            .iter()
            .copied()
            .filter(|mean| mean.enhancer == levels[0].enhancer)
            .collect();
        let shown = [Significance::Worse, Significance::Better]
            .into_iter()
            .flat_map(|verdict| {
                let shown = Shown::all(levels, &own, verdict).into_iter();
                shown.filter_map(move |shown| enhancer(&shown, verdict, unit))
            });
        let unshown = unshown(levels, &own);
        let unshown = no_effect(&unshown, levels, unit);
        sentences.extend(shown.chain(unshown).take(MAX_PER_ENHANCER));
    }
    sentences
}

/// The detected effect of an enhancer.
fn enhancer(shown: &Shown<'_>, verdict: Significance, unit: ClusterUnit) -> Option<Sentence> {
    let name = shown.largest.enhancer.as_ref()?;
    let at = &shown.at;
    let mut numbers = Numbers::new(unit);
    numbers.about(name);
    let size = shown.size(&mut numbers);
    let is_better = verdict == Significance::Better;
    let (text, note) = if is_observer(shown.largest) {
        let more = if is_better { "more" } else { "less" };
        (
            format!("With {name} the observer confirms {more} at {at}, by {size}."),
            "; local tone and sharpening count as noise, so this does not show that evidence is lost",
        )
    } else {
        let verb = if is_better { "helps" } else { "harms" };
        (format!("{name} {verb} at {at}, by {size}."), "")
    };
    let more = shown.place() + note;
    let detail = detail(shown.largest, &mut numbers, &more);
    Some(numbers.sentence("enhancer", verdict.into(), text, detail))
}

/// The levels at which no effect of an enhancer is detected, among all of its levels.
fn no_effect(
    unshown: &[&PooledFinding],
    levels: &[&PooledFinding],
    unit: ClusterUnit,
) -> Option<Sentence> {
    let largest = PooledFinding::largest(unshown)?;
    let name = largest.enhancer.as_ref()?;
    if let Some(format) = format_alone(unshown, unit) {
        return Some(format);
    }
    let mut numbers = Numbers::new(unit);
    numbers.about(name);
    let at = runs(unshown, levels);
    let text = if is_unconfirmed(largest) {
        let difference = largest.strict.difference.value;
        let up_to = if unshown.len() > 1 { "up to " } else { "" };
        let size = numbers.size("effect", difference);
        let word = lower_or_higher(difference);
        format!("{name} at {at}: accuracy {up_to}{size} points {word}{UNCONFIRMED}.")
    } else {
        format!("{name} at {at}: no effect detected.")
    };
    let more = format!(
        "; largest at {}{}",
        largest.level,
        reserved(largest, &mut numbers)
    );
    let detail = detail(largest, &mut numbers, &more);
    Some(numbers.sentence("enhancer", Tone::NotShown, text, detail))
}

/// Whether a finding is about the observer alone. It has its own words: what it does not confirm need not be lost.
fn is_observer(finding: &PooledFinding) -> bool {
    matches!(&finding.models[..], [one] if model_in_condition::is_observer(one))
}

/// The end of a sentence about an effect that [`is_unconfirmed`].
pub(super) const UNCONFIRMED: &str = ", unconfirmed after correction for all tests";

/// How an accuracy with this difference compares with the other one.
pub(super) fn lower_or_higher(difference: f64) -> &'static str {
    if difference < 0.0 { "lower" } else { "higher" }
}

/// Whether nothing is detected although the interval excludes 0. The text then gives the effect, because "nothing was detected" next to
/// such an interval reads as a contradiction.
pub(super) fn is_unconfirmed(finding: &PooledFinding) -> bool {
    let difference = finding.strict.difference;
    let excludes_zero = difference.low > 0.0 || difference.high < 0.0;
    excludes_zero && matches!(finding.claim(), Claim::Open | Claim::InOwnSet)
}

/// Why a finding is not among those detected although its own test or its interval detects it; empty otherwise.
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
pub(super) fn with_verdict<'f>(
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
        findings
            .iter()
            .map(|finding| finding.level)
            .collect::<Vec<AxisLevel>>()
    });
    level_runs(&some, &all)
}

/// Effect, interval, p and n of a finding, with `more` before n.
pub(super) fn detail(finding: &PooledFinding, numbers: &mut Numbers, more: &str) -> String {
    let who = models(&finding.models, numbers);
    let strict = &finding.strict;
    let difference = numbers.difference("", strict.difference);
    match &finding.mean_over[..] {
        [] => numbers.at(&finding.level),
        over => numbers.at(&level_runs(over, over)),
    }
    let p = numbers.p("p", strict.p_report.unwrap_or(strict.holm));
    let sample = numbers.sample(finding);
    format!("{who}: {difference}, {p}{more}; {sample}")
}
