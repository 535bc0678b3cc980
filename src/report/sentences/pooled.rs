//! Sentences about noise and enhancers, over all models together.

use super::sample::Undecided;
use super::sentence::{EffectDirection, NamedNumbers, Sentence, format_alone, level_runs, models};
use darkqa_base::types::AxisLevel;
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::{Claim, PooledFinding};
use darkqa_score::estimate::Estimate;
use darkqa_score::model_in_condition;
use darkqa_score::significance::Verdict;

/// Maximum number of sentences about one enhancer.
const MAX_PER_ENHANCER: usize = 3;

/// A detected effect that is reported in one sentence: at several levels, or as a mean over levels at none of which it
/// is detected.
struct DetectedEffect<'f> {
    /// The finding at the level with the largest effect, or the mean.
    largest: &'f PooledFinding,
    /// The levels, as `L3–L5`.
    at: String,
    /// True if the effect is at several levels.
    has_several_levels: bool,
}

impl<'f> DetectedEffect<'f> {
    /// The effect at all levels with a verdict; `None` if no level has it.
    fn levels(levels: &[&'f PooledFinding], verdict: Verdict) -> Option<Self> {
        let detected = with_verdict(levels, verdict);
        Some(Self {
            largest: PooledFinding::largest(&detected)?,
            at: runs(&detected, levels),
            has_several_levels: detected.len() > 1,
        })
    }

    /// The effect at all levels with a verdict, and each mean with that verdict if none of its levels has it.
    fn all(levels: &[&'f PooledFinding], means: &[&'f PooledFinding], verdict: Verdict) -> Vec<Self> {
        let detected = with_verdict(levels, verdict);
        let means = with_verdict(means, verdict)
            .into_iter()
            .filter(|mean| !detected.iter().any(|finding| mean.mean_over.contains(&finding.level)))
            .map(|mean| Self { largest: mean, at: mean_levels(mean, levels), has_several_levels: true });
        Self::levels(levels, verdict).into_iter().chain(means).collect()
    }

    /// The size in words: `up to 5.0 points`, `5.0 points` for one level, or `5.0 points on average`.
    fn size(&self, numbers: &mut NamedNumbers) -> String {
        let size = numbers.size("effect", self.largest.strict.tested.difference.value);
        if self.is_mean() {
            format!("{size} points on average")
        } else if self.has_several_levels {
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
        if self.is_mean() { format!("; mean of {}", self.at) } else { format!("; at {}", self.largest.level) }
    }
}

/// The levels of a mean in words, as a part of `levels`.
pub(super) fn mean_levels(mean: &PooledFinding, levels: &[&PooledFinding]) -> String {
    let all: Vec<AxisLevel> = levels.iter().map(|finding| finding.level).collect();
    level_runs(&mean.mean_over, &all)
}

/// The levels at which nothing is detected, neither alone nor as a part of a mean.
fn undetected<'f>(levels: &[&'f PooledFinding], means: &[&PooledFinding]) -> Vec<&'f PooledFinding> {
    with_verdict(levels, Verdict::NotShown)
        .into_iter()
        .filter(|finding| {
            !means
                .iter()
                .any(|mean| matches!(mean.claim(), Claim::Detected(_)) && mean.mean_over.contains(&finding.level))
        })
        .collect()
}

/// The difference in accuracy between noise and the exposure drop alone: a sentence for each verdict, at the level with
/// the largest difference, or as a mean over levels. The two variants also differ in contrast, so this is not an effect
/// of noise alone.
pub(super) fn noise(levels: &[&PooledFinding], means: &[&PooledFinding], unit: ClusterUnit) -> Vec<Sentence> {
    let mut sentences = Vec::new();
    for (verdict, word) in [(Verdict::Worse, "lower"), (Verdict::Better, "higher")] {
        for effect in DetectedEffect::all(levels, means, verdict) {
            let mut numbers = NamedNumbers::new(unit);
            let size = effect.size(&mut numbers).replace(" points", &format!(" points {word}"));
            let (at, more) = if effect.is_mean() {
                (effect.at.clone(), effect.place())
            } else {
                let at = effect.largest.level.to_string();
                (at, format!("; shown at {}", effect.at))
            };
            let text = format!("With noise, accuracy is {size} than by the exposure drop alone ({at}).");
            let more = more + &curve(levels, &mut numbers);
            let detail = detail(effect.largest, &mut numbers, &more);
            sentences.push(numbers.sentence("noise", verdict.into(), text, detail));
        }
    }
    sentences.extend(Undecided::new(levels, &[]).sentence(
        "noise",
        "the difference between noise and the exposure drop alone",
        unit,
    ));
    if !sentences.is_empty() {
        return sentences;
    }
    let Some(largest) = PooledFinding::largest(&undetected(levels, means)) else {
        return sentences;
    };
    if let Some(format) = format_alone(levels, unit) {
        return vec![format];
    }
    let mut numbers = NamedNumbers::new(unit);
    let text = if let Some(unconfirmed) = unconfirmed(largest.claim(), largest.strict.tested.difference) {
        let difference = largest.strict.tested.difference.value;
        format!(
            "With noise, accuracy is {} points {} than by the exposure drop alone ({}){unconfirmed}.",
            numbers.size("effect", difference),
            lower_or_higher(difference),
            largest.level
        )
    } else {
        "No difference in accuracy between noise and the exposure drop alone was detected.".to_owned()
    };
    let more = format!("; largest at {}{}", largest.level, reservation(largest, &mut numbers));
    let detail = detail(largest, &mut numbers, &more);
    vec![numbers.sentence("noise", EffectDirection::NotShown, text, detail)]
}

/// The effects of each enhancer: a sentence for each verdict, with its levels.
pub(super) fn enhancers(all: &[&PooledFinding], means: &[&PooledFinding], unit: ClusterUnit) -> Vec<Sentence> {
    let mut sentences = Vec::new();
    for levels in all.chunk_by(|a, b| a.enhancer == b.enhancer) {
        let own: Vec<&PooledFinding> =
            means.iter().copied().filter(|mean| mean.enhancer == levels[0].enhancer).collect();
        let detected = [Verdict::Worse, Verdict::Better].into_iter().flat_map(|verdict| {
            DetectedEffect::all(levels, &own, verdict)
                .into_iter()
                .filter_map(move |effect| enhancer(&effect, levels, verdict, unit))
        });
        let undecided = levels[0]
            .enhancer
            .as_ref()
            .and_then(|name| Undecided::new(levels, &[]).sentence("enhancer", name.as_str(), unit));
        let no_effect = no_effect(&undetected(levels, &own), levels, unit);
        sentences.extend(detected.chain(undecided).chain(no_effect).take(MAX_PER_ENHANCER));
    }
    sentences
}

/// The detected effect of an enhancer.
fn enhancer(
    effect: &DetectedEffect<'_>,
    levels: &[&PooledFinding],
    verdict: Verdict,
    unit: ClusterUnit,
) -> Option<Sentence> {
    let name = effect.largest.enhancer.as_ref()?;
    let at = &effect.at;
    let mut numbers = NamedNumbers::new(unit);
    numbers.about(name);
    let size = effect.size(&mut numbers);
    let is_better = verdict == Verdict::Better;
    let (text, note) = if is_observer(effect.largest) {
        let more = if is_better { "more" } else { "less" };
        (
            format!("With {name} the observer confirms {more} at {at}, by {size}."),
            "; local tone and sharpening count as noise, so this does not show that evidence is lost",
        )
    } else {
        let verb = if is_better { "helps" } else { "harms" };
        (format!("{name} {verb} at {at}, by {size}."), "")
    };
    let more = effect.place() + note + &curve(levels, &mut numbers);
    let detail = detail(effect.largest, &mut numbers, &more);
    Some(numbers.sentence("enhancer", verdict.into(), text, detail))
}

/// The sentence about the levels at which no effect of an enhancer is detected, among all of its levels.
fn no_effect(undetected: &[&PooledFinding], levels: &[&PooledFinding], unit: ClusterUnit) -> Option<Sentence> {
    let largest = PooledFinding::largest(undetected)?;
    let name = largest.enhancer.as_ref()?;
    if let Some(format) = format_alone(undetected, unit) {
        return Some(format);
    }
    let mut numbers = NamedNumbers::new(unit);
    numbers.about(name);
    let at = runs(undetected, levels);
    let text = if let Some(unconfirmed) = unconfirmed(largest.claim(), largest.strict.tested.difference) {
        let difference = largest.strict.tested.difference.value;
        let up_to = if undetected.len() > 1 { "up to " } else { "" };
        let size = numbers.size("effect", difference);
        let word = lower_or_higher(difference);
        format!("{name} at {at}: accuracy {up_to}{size} points {word}{unconfirmed}.")
    } else {
        format!("{name} at {at}: no effect detected.")
    };
    let more = format!("; largest at {}{}", largest.level, reservation(largest, &mut numbers));
    let detail = detail(largest, &mut numbers, &more);
    Some(numbers.sentence("enhancer", EffectDirection::NotShown, text, detail))
}

/// True if a finding is about the observer alone, which has its own wording: evidence that it does not confirm may
/// still be present.
fn is_observer(finding: &PooledFinding) -> bool {
    matches!(&finding.models[..], [one] if model_in_condition::is_observer(one))
}

/// The end of a sentence about an effect that only the interval or the uncorrected test detects.
pub(super) const UNCONFIRMED: &str = ", unconfirmed after correction for all tests";

/// How an accuracy with this difference compares with the other one.
pub(super) fn lower_or_higher(difference: f64) -> &'static str {
    if difference < 0.0 { "lower" } else { "higher" }
}

/// The end of a sentence about an effect that does not count as detected although its interval excludes 0; `None` for
/// other findings. The sentence reports such an effect, because "nothing was detected" next to the interval would look
/// contradictory.
pub(super) fn unconfirmed(claim: Claim, difference: Estimate) -> Option<&'static str> {
    let excludes_zero = difference.low > 0.0 || difference.high < 0.0;
    match claim {
        Claim::Open | Claim::InOwnSet if excludes_zero => Some(UNCONFIRMED),
        Claim::StrictOnly(_) => Some(", in the strict parsing alone"),
        _ => None,
    }
}

/// The reason why a finding does not count as detected, although its own test or its interval detects it; empty for
/// other findings.
pub(super) fn reservation(finding: &PooledFinding, numbers: &mut NamedNumbers) -> String {
    let strict = &finding.strict;
    let difference = strict.tested.difference;
    match finding.claim() {
        Claim::Detected(_) | Claim::Impossible | Claim::Missing => String::new(),
        Claim::StrictOnly(_) => ", detected in the strict parsing alone".to_owned(),
        Claim::InOwnSet => {
            format!(", detected only if no other finding is counted ({})", numbers.p("own_p", strict.tested.holm))
        }
        Claim::Open if difference.low <= 0.0 && difference.high >= 0.0 => String::new(),
        Claim::Open => {
            format!(", not detected after correction (uncorrected {})", numbers.p("uncorrected_p", strict.tested.p))
        }
    }
}

/// The findings with a verdict in both parsings and after the correction over all sentences. A finding that could have
/// a verdict but has none counts as [`Verdict::NotShown`], unless the missing replies decide it.
pub(super) fn with_verdict<'f>(levels: &[&'f PooledFinding], verdict: Verdict) -> Vec<&'f PooledFinding> {
    levels
        .iter()
        .copied()
        .filter(|finding| match finding.claim() {
            Claim::Detected(found) => found == verdict,
            Claim::Impossible | Claim::Missing => false,
            _ => verdict == Verdict::NotShown,
        })
        .collect()
}

/// The levels of `some` findings in words, as a part of those of `all`.
pub(super) fn runs(some: &[&PooledFinding], all: &[&PooledFinding]) -> String {
    let [some, all] =
        [some, all].map(|findings| findings.iter().map(|finding| finding.level).collect::<Vec<AxisLevel>>());
    level_runs(&some, &all)
}

/// The differences at all levels, beside one that is quoted because its test detected it: chosen so, it is on average
/// larger than the true one. Empty for a single level.
pub(super) fn curve(levels: &[&PooledFinding], numbers: &mut NamedNumbers) -> String {
    if levels.len() < 2 {
        return String::new();
    }
    let all: Vec<AxisLevel> = levels.iter().map(|finding| finding.level).collect();
    let differences: Vec<String> = levels
        .iter()
        .map(|finding| {
            let name = format!("difference_{}", finding.level);
            numbers.points(&name, finding.strict.tested.difference.value)
        })
        .collect();
    format!("; at {}: {}", level_runs(&all, &all), differences.join(", "))
}

/// Effect, interval, p and n of a finding, with `more` before n.
pub(super) fn detail(finding: &PooledFinding, numbers: &mut NamedNumbers, more: &str) -> String {
    let who = models(&finding.models, numbers);
    let strict = &finding.strict;
    let difference = numbers.difference("", strict.tested.difference);
    match &finding.mean_over[..] {
        [] => numbers.at(&finding.level),
        over => numbers.at(&level_runs(over, over)),
    }
    let p = numbers.p("p", strict.tested.stated_p());
    let sample = numbers.sample(finding);
    format!("{who}: {difference}, {p}{more}; {sample}")
}
