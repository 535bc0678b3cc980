//! Sentences about the cost of darkness for all models together, with each variant.
//!
//! Topics of sentences ([`Topic`]), and the findings about one variant.

use super::pooled::{curve, detail, lower_or_higher, mean_levels, reservation, runs, unconfirmed, with_verdict};
use super::sample::{Undecided, WIDE, is_impossible, silent_levels};
use super::sentence::{EffectDirection, NamedNumbers, Sentence, capitalised, format_alone};
use crate::text::words::light;
use darkqa_base::types::degradations::{Axis, Kind};
use darkqa_base::types::{AxisLevel, RunGroup, Variant};
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::{Claim, PooledFinding, PooledKind};
use darkqa_score::findings::Findings;
use darkqa_score::significance::Verdict;

/// The cost of darkness, or of another cause, in each topic.
pub(super) fn darkness(findings: &Findings<'_>) -> Vec<Sentence> {
    Topic::all(findings).iter().flat_map(|topic| topic_sentences(findings, topic)).collect()
}

/// The cost of darkness with each light of a topic, then with each other variant whose detected effect no light of the
/// same runs shows. If the verdicts differ, the sentences name their variants.
fn topic_sentences(findings: &Findings<'_>, topic: &Topic<'_>) -> Vec<Sentence> {
    let Topic { lights, others, .. } = topic;
    let unit = findings.unit;
    let mut sentences = Vec::new();
    for variant in lights {
        let cost = CostOfDarkness::new(findings, variant);
        let verdict = cost.verdict();
        let differs = others
            .iter()
            .filter(|other| overlap(other, variant))
            .filter_map(|other| CostOfDarkness::new(findings, other).verdict())
            .any(|other| Some(other) != verdict);
        let name = (differs && lights.len() == 1).then(|| name(variant));
        let sentence = cost.sentence(name.as_deref(), unit);
        sentences.extend(sentence.map(|sentence| topic.add_light(variant, sentence)));
    }
    for other in others {
        let cost = CostOfDarkness::new(findings, other);
        let verdict = cost.verdict();
        let is_reported = lights
            .iter()
            .filter(|variant| overlap(other, variant))
            .any(|variant| CostOfDarkness::new(findings, variant).verdict() == verdict);
        if !is_reported && verdict.is_some_and(Verdict::is_shown) {
            let name = name(other);
            sentences.extend(cost.sentence(Some(&name), unit));
        }
    }
    sentences
}

/// The findings about the cost of darkness with one variant.
struct CostOfDarkness<'f> {
    levels: Vec<&'f PooledFinding>,
    /// The mean over the darker levels.
    mean: Option<&'f PooledFinding>,
    /// Levels that were asked, and at which no question has all replies.
    silent: Vec<AxisLevel>,
}

impl<'f> CostOfDarkness<'f> {
    fn new(findings: &'f Findings<'_>, variant: &Variant) -> Self {
        Self {
            levels: findings_of_kind(findings, PooledKind::Darkness, variant),
            mean: mean_findings(findings, PooledKind::Darkness, variant).into_iter().next(),
            silent: silent_levels(findings, variant),
        }
    }

    /// The sentence of [`with_variant`].
    fn sentence(&self, name: Option<&str>, unit: ClusterUnit) -> Option<Sentence> {
        with_variant(&self.levels, self.mean, &self.silent, name, unit)
    }

    /// The verdict of the levels; if none is detected, the verdict of their mean.
    fn verdict(&self) -> Option<Verdict> {
        let verdict = verdict(&self.levels)?;
        match self.mean.and_then(mean_verdict) {
            Some(mean) if !verdict.is_shown() => Some(mean),
            _ => Some(verdict),
        }
    }
}

/// True if two variants have a run in common.
fn overlap(one: &Variant, other: &Variant) -> bool {
    RunGroup::overlap(one.group.as_ref(), other.group.as_ref())
}

/// The verdict over all levels: a loss if any level has one, otherwise a gain, otherwise not detected; `None` if no
/// level can have a verdict.
fn verdict(levels: &[&PooledFinding]) -> Option<Verdict> {
    [Verdict::Worse, Verdict::Better, Verdict::NotShown]
        .into_iter()
        .find(|verdict| !with_verdict(levels, *verdict).is_empty())
}

/// The detected verdict of a mean over levels; `None` if nothing is detected.
fn mean_verdict(mean: &PooledFinding) -> Option<Verdict> {
    match mean.claim() {
        Claim::Detected(verdict) => Some(verdict),
        _ => None,
    }
}

/// The phrase for a variant at the beginning of a sentence.
fn name(variant: &Variant) -> String {
    match variant.kind {
        Some(Kind::Exposure) => format!("By the exposure drop alone{}", variant.group_suffix()),
        _ => capitalised(&light(variant, None)),
    }
}

/// The cost of darkness with one variant: at the darkest level where it is detected, otherwise as the mean over the
/// darker levels if that is detected, otherwise that missing replies allow no verdict, otherwise that nothing was
/// detected. `silent` are the levels at which no question has all replies. The sentence begins with `name`.
pub(super) fn with_variant(
    levels: &[&PooledFinding],
    mean: Option<&PooledFinding>,
    silent: &[AxisLevel],
    name: Option<&str>,
    unit: ClusterUnit,
) -> Option<Sentence> {
    let mut numbers = NamedNumbers::new(unit);
    let undecided = Undecided::new(levels, silent);
    let verdict = verdict(levels);
    let is_shown = verdict.is_some_and(Verdict::is_shown);
    if let Some(mean) = mean
        && let Some(mean_verdict) = mean_verdict(mean)
        && !is_shown
    {
        return Some(over_levels(mean, levels, mean_verdict, name, numbers));
    }
    let cause = levels.first()?.level.axis().unwrap_or(Axis::LIGHT).cause;
    if !is_shown && let Some(mut sentence) = undecided.sentence("darkness", &cause.to_lowercase(), unit) {
        sentence.text = match name {
            None => sentence.text,
            Some(name) => format!("{name}: {}", sentence.text),
        };
        return Some(sentence);
    }
    let verdict = verdict?;
    let found = with_verdict(levels, verdict);
    let darkest = found.last()?;
    let size = darkest.strict.tested.difference.value;
    let (text, more) = match verdict {
        Verdict::Worse => (
            format!(
                "{cause} costs {} points at {}, from {} % at L0.",
                numbers.size("cost", size),
                darkest.level,
                numbers.percent("L0", darkest.strict.second)
            ),
            format!("; a loss is shown at {}{}", runs(&found, levels), curve(levels, &mut numbers)),
        ),
        Verdict::Better => (
            format!("at {} accuracy is {} points higher than at L0.", darkest.level, numbers.size("gain", size)),
            format!("; at {}{}", darkest.level, curve(levels, &mut numbers)),
        ),
        _ => {
            if let Some(format) = format_alone(levels, unit) {
                return Some(format);
            }
            let text = if let Some(unconfirmed) = unconfirmed(darkest.claim(), darkest.strict.tested.difference) {
                format!(
                    "at {} accuracy is {} points {} than at L0{unconfirmed}.",
                    darkest.level,
                    numbers.size("effect", size),
                    lower_or_higher(size),
                )
            } else {
                format!("no loss by {cause} was detected at any level{}.", possible_loss(&found, &mut numbers))
            };
            let reservation = reservation(darkest, &mut numbers);
            (text, format!("; at {}{reservation}", darkest.level))
        }
    };
    let text = begin_with(name, &text);
    let without = if undecided.is_empty() {
        String::new()
    } else {
        format!("; missing replies allow no verdict at {}", undecided.at())
    };
    let detail = detail(darkest, &mut numbers, &(more + &without));
    Some(numbers.sentence("darkness", EffectDirection::from(verdict), text, detail))
}

/// A sentence that begins with the name of a variant, if any.
fn begin_with(name: Option<&str>, text: &str) -> String {
    match name {
        None => capitalised(text),
        Some(name) => format!("{name}, {text}"),
    }
}

/// The mean cost of darkness over several levels, if it is not detected at any single level.
fn over_levels(
    mean: &PooledFinding,
    levels: &[&PooledFinding],
    verdict: Verdict,
    name: Option<&str>,
    mut numbers: NamedNumbers,
) -> Sentence {
    let size = mean.strict.tested.difference.value;
    let cause = mean.level.axis().unwrap_or(Axis::LIGHT).cause;
    let at = mean_levels(mean, levels);
    let text = if verdict == Verdict::Worse {
        format!(
            "{cause} costs {} points on average over {at}, from {} % at L0.",
            numbers.size("cost", size),
            numbers.percent("L0", mean.strict.second)
        )
    } else {
        format!("over {at} accuracy is {} points higher on average than at L0.", numbers.size("gain", size))
    };
    let more = format!("; mean of {at}, no level alone is shown{}", curve(levels, &mut numbers));
    let detail = detail(mean, &mut numbers, &more);
    numbers.sentence("darkness", verdict.into(), begin_with(name, &text), detail)
}

/// The largest loss that the intervals do not exclude, if it is large, so that a small sample is not mistaken for good
/// night vision.
fn possible_loss(levels: &[&PooledFinding], numbers: &mut NamedNumbers) -> String {
    let Some(finding) = levels.iter().min_by(|a, b| {
        let [a, b] = [a, b].map(|finding| finding.strict.tested.difference.low);
        a.total_cmp(&b)
    }) else {
        return String::new();
    };
    let largest = -finding.strict.tested.difference.low;
    if largest <= WIDE {
        return String::new();
    }
    let points = numbers.number("possible loss", 100.0 * largest, 0);
    let level = finding.level;
    format!("; a loss of up to {points} points at {level} cannot be excluded")
}

/// Variants with a common root kind, such as the exposure drop and noise, which sentences report together.
#[derive(Debug)]
pub(super) struct Topic<'f> {
    /// The variants of the last kind, one for each noise profile or group of runs.
    pub(super) lights: Vec<&'f Variant>,
    /// The variants of the other kinds.
    pub(super) others: Vec<&'f Variant>,
    /// True if an earlier topic has the same axis, so that a level alone does not identify the topic.
    shares_levels: bool,
}

impl<'f> Topic<'f> {
    /// The topics of all variants that were asked, in the order of tables. The first one is the main one.
    pub(super) fn all(findings: &'f Findings<'_>) -> Vec<Self> {
        let mut topics: Vec<Self> = Vec::new();
        let variants: Vec<&Variant> = findings.grid.variants().into_iter().collect();
        for group in variants.chunk_by(|a, b| a.kind.map(Kind::root) == b.kind.map(Kind::root)) {
            let last = group.last().map(|variant| variant.kind);
            let (lights, others) = group.iter().copied().partition(|variant| Some(variant.kind) == last);
            let shares_levels = topics
                .iter()
                .flat_map(|topic| &topic.lights)
                .any(|other| other.kind.map(Kind::axis) == group[0].kind.map(Kind::axis));
            topics.push(Self { lights, others, shares_levels });
        }
        topics
    }

    /// Adds the name of the variant to a sentence, if the topic has several lights or shares its levels with another
    /// topic.
    pub(super) fn add_light(&self, variant: &Variant, mut sentence: Sentence) -> Sentence {
        if self.lights.len() > 1 || self.shares_levels {
            let light = light(variant, None);
            sentence.text = format!("{light}: {}", sentence.text);
            sentence.scope.light = Some(light);
        }
        sentence
    }
}

/// Sentences about each light of each topic.
pub(super) fn in_each_light(
    findings: &Findings<'_>,
    about: fn(&Findings<'_>, &Variant) -> Vec<Sentence>,
) -> Vec<Sentence> {
    let mut sentences = Vec::new();
    for topic in Topic::all(findings) {
        for variant in &topic.lights {
            let about_light = about(findings, variant);
            sentences.extend(about_light.into_iter().map(|sentence| topic.add_light(variant, sentence)));
        }
    }
    sentences
}

/// The findings of one kind and variant that average over several levels, in the order of enhancers.
pub(super) fn mean_findings<'f>(
    findings: &'f Findings<'_>,
    kind: PooledKind,
    variant: &Variant,
) -> Vec<&'f PooledFinding> {
    findings.averaged.iter().filter(|mean| mean.kind == kind && mean.variant == *variant).collect()
}

/// The findings of one kind and variant over all families of the kind, in the order of enhancers and levels. The
/// findings about an enhancer are left out if none of them can have a verdict.
pub(super) fn findings_of_kind<'f>(
    findings: &'f Findings<'_>,
    kind: PooledKind,
    variant: &Variant,
) -> Vec<&'f PooledFinding> {
    let of_kind: Vec<&PooledFinding> = findings
        .pooled
        .iter()
        .filter(|finding| {
            finding.kind == kind && finding.family.as_ref() == kind.only_family() && finding.variant == *variant
        })
        .collect();
    of_kind.chunk_by(|a, b| a.enhancer == b.enhancer).filter(|set| !is_impossible(set)).flatten().copied().collect()
}
