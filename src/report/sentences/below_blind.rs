//! Sentences about models that are right less often with images than without: over all families, or in one family.
//!
//! The sentence about confidence: whether it falls with accuracy in the dark.

use std::collections::BTreeSet;

use super::pooled::{detail, runs, unconfirmed, with_verdict};
use super::sentence::{EffectDirection, NamedNumbers, Sentence, capitalised, format_alone, level_runs};
use crate::text::words::family as family_name;
use darkqa_base::types::{Axis, AxisLevel, Variant};
use darkqa_score::calibration::{Calibration, MIN_CONFIDENT_REPLIES};
use darkqa_score::cluster::{ClusterUnit, MIN_CLUSTERS};
use darkqa_score::comparisons::{Claim, Comparison, PooledFinding, PooledKind, Tested};
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::significance::Verdict;

/// Second side of a comparison if the same models answered with images and without.
const WITHOUT: &str = "without images";

/// Reports the levels at which the models are right less often with images than without. If none has a verdict,
/// [`format_alone`] reports a loss that only the strict parsing detects.
pub(super) fn pooled(findings: &[&PooledFinding], unit: ClusterUnit) -> Option<Sentence> {
    let detected = with_verdict(findings, Verdict::Worse);
    let Some(largest) = PooledFinding::largest(&detected) else {
        let strict_only: Vec<&PooledFinding> =
            findings.iter().copied().filter(|finding| finding.claim() == Claim::StrictOnly(Verdict::Worse)).collect();
        return format_alone(&strict_only, unit);
    };
    let mut numbers = NamedNumbers::new(unit);
    let who = match &largest.models[..] {
        [one] => format!("{one} is"),
        _ => "the models are".to_owned(),
    };
    let below = pooled_second_side(largest);
    let at = runs(&detected, findings);
    let place = capitalised(largest.level.axis().unwrap_or(Axis::LIGHT).place);
    let text = format!("{place} {who} less often right than {below} at {at}.");
    let detail = detail(largest, &mut numbers, &format!("; at {}", largest.level));
    Some(numbers.sentence("below blind", EffectDirection::Worse, text, detail))
}

/// Second side of a pooled finding, in words.
fn pooled_second_side(finding: &PooledFinding) -> String {
    let blind_models = &finding.blind_models;
    if blind_models.iter().all(|model| finding.models.contains(model)) {
        return WITHOUT.to_owned();
    }
    match &blind_models[..] {
        [other] => format!("{other} without images"),
        _ => "the models without images".to_owned(),
    }
}

/// Second side of a pooled finding, as ` against NAME without images`; empty if each model is compared with itself.
fn against(finding: &PooledFinding) -> String {
    match &*pooled_second_side(finding) {
        WITHOUT => String::new(),
        other => format!(" against {other}"),
    }
}

/// Reports the gain from untouched images, over all models.
pub(super) fn untouched(findings: &Findings<'_>) -> Option<Sentence> {
    let finding = findings.pooled.iter().find(|finding| {
        finding.kind == PooledKind::Blind
            && finding.family.is_none()
            && finding.enhancer.is_none()
            && finding.level == AxisLevel::L0
    })?;
    if let Some(format) = format_alone(&[finding], findings.unit) {
        return Some(format);
    }
    let mut numbers = NamedNumbers::new(findings.unit);
    let (with, without) =
        (numbers.percent("with", finding.strict.first), numbers.percent("without", finding.strict.second));
    let text = match finding.claim() {
        Claim::Detected(Verdict::Better) => format!(
            "At L0 images add {} points{}: {with} % with them, {without} % without.",
            numbers.size("gain", finding.strict.tested.difference.value),
            against(finding)
        ),
        Claim::Detected(_) => format!(
            "At L0 images cost {} points{}: {with} % with them, {without} % without.",
            numbers.size("cost", finding.strict.tested.difference.value),
            against(finding)
        ),
        // One sentence for all topics reports that no verdict is possible.
        Claim::Impossible | Claim::Missing => return None,
        _ => {
            if let Some(unconfirmed) = unconfirmed(finding.claim(), finding.strict.tested.difference) {
                let difference = finding.strict.tested.difference.value;
                let verb = if difference < 0.0 { "cost" } else { "add" };
                format!(
                    "At L0 images {verb} {} points{}{unconfirmed}: {with} % with them, {without} % without.",
                    numbers.size("effect", difference),
                    against(finding)
                )
            } else {
                format!("No gain by images was detected at L0: {with} % with them, {without} % without.")
            }
        }
    };
    let detail = detail(finding, &mut numbers, "");
    Some(numbers.sentence("images", EffectDirection::from(finding.claim()), text, detail))
}

/// Comparisons between raw images of a variant and no images, for each model whose findings are pooled: by family, and
/// over all families if there are several models.
pub(super) fn by_family<'f>(findings: &'f Findings<'_>, variant: &Variant) -> Vec<&'f Comparison> {
    findings
        .comparisons
        .iter()
        .filter(|comparison| comparison.first.variant == *variant && findings.is_tested_against_blind(comparison))
        .collect()
}

/// Reports the family and the model with the largest loss from images, and the number of models with a loss in that
/// family. `all` contains the comparisons of all models and families. `None` without a loss, or if the findings over
/// all families (`pooled`) already report a loss of this model alone.
pub(super) fn in_a_family(all: &[&Comparison], pooled: &[&PooledFinding], unit: ClusterUnit) -> Option<Sentence> {
    let worst = all.iter().copied().filter(|comparison| is_below(comparison)).min_by(|a, b| {
        let [a, b] = [a, b].map(|comparison| comparison.strict.tested.difference.value);
        a.total_cmp(&b)
    })?;
    let model = &worst.first.model;
    if with_verdict(pooled, Verdict::Worse).iter().any(|finding| finding.models == [&**model]) {
        return None;
    }
    let in_family: Vec<&Comparison> =
        all.iter().copied().filter(|comparison| comparison.family == worst.family).collect();
    let below: Vec<&Comparison> = in_family.iter().copied().filter(|comparison| is_below(comparison)).collect();
    let models_below = model_count(&below);
    let mut numbers = NamedNumbers::new(unit);
    let family = capitalised(family_name(worst.family.as_ref()));
    let text = if models_below == 1 {
        let than = second_side(worst);
        let at = levels_below(&in_family, worst);
        format!("{family}: {model} is less often right than {than} at {at}.")
    } else {
        let than = if below.iter().all(|comparison| is_own(comparison)) { WITHOUT } else { "a model without images" };
        let fallen = numbers.count("fallen", models_below);
        let models = numbers.count("models", model_count(&in_family));
        format!("{family}: {fallen} of {models} models are less often right than {than}.")
    };
    let detail = comparison_detail(worst, &mut numbers)?;
    Some(numbers.sentence("below blind", EffectDirection::Worse, text, detail))
}

/// Number of different models on the first sides of comparisons.
fn model_count(comparisons: &[&Comparison]) -> usize {
    let models: BTreeSet<&str> = comparisons.iter().map(|comparison| &*comparison.first.model).collect();
    models.len()
}

/// True if images are detected to make a model worse than the second side.
fn is_below(comparison: &Comparison) -> bool {
    comparison.claim() == Claim::Detected(Verdict::Worse)
}

/// True if a model is compared with its own replies.
fn is_own(comparison: &Comparison) -> bool {
    comparison.first.model == comparison.second.model
}

/// Second side of a comparison of images with no images, in words.
fn second_side(comparison: &Comparison) -> String {
    if is_own(comparison) { WITHOUT.to_owned() } else { format!("{} without images", comparison.second.model) }
}

/// Levels at which the model of a comparison is below the second side. Only comparisons of the same two models count,
/// because a model without blind replies is compared with every model that has some.
fn levels_below(in_family: &[&Comparison], comparison: &Comparison) -> String {
    let same_models: Vec<&Comparison> = in_family
        .iter()
        .copied()
        .filter(|other| other.first.model == comparison.first.model && other.second.model == comparison.second.model)
        .collect();
    let below: Vec<&Comparison> = same_models.iter().copied().filter(|comparison| is_below(comparison)).collect();
    level_runs(&levels(&below), &levels(&same_models))
}

/// Levels of the first sides of comparisons, sorted and without duplicates.
fn levels(comparisons: &[&Comparison]) -> Vec<AxisLevel> {
    let levels: BTreeSet<AxisLevel> = comparisons.iter().filter_map(|comparison| comparison.first.level).collect();
    levels.into_iter().collect()
}

/// Effect, interval, p and n of a comparison of images with no images.
fn comparison_detail(comparison: &Comparison, numbers: &mut NamedNumbers) -> Option<String> {
    let (model, level) = (&comparison.first.model, comparison.first.level?);
    let against = if is_own(comparison) { String::new() } else { format!(" against {}", comparison.second.model) };
    let paired = &comparison.strict;
    numbers.at(&level);
    let difference = numbers.difference("", paired.tested.difference);
    let p = numbers.p("p", paired.tested.stated_p());
    let n = numbers.count("n", paired.tested.difference.n);
    let clusters = numbers.clusters(paired.clusters);
    Some(format!("{model} at {level}{against}: {difference}, {p}; n = {n} in {clusters}"))
}

/// The calibration of a model with one variant: at the darkest level, and at L0 if it was asked there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Confidence<'f> {
    pub(super) model: &'f str,
    pub(super) level: AxisLevel,
    pub(super) dark: &'f Calibration,
    pub(super) clean: Option<&'f Calibration>,
}

impl<'f> Confidence<'f> {
    /// The calibrations with raw images at the darkest level of a variant, for the models of the pooled findings.
    /// Models with few replies are left out, and all models if there are few clusters, because their intervals are too
    /// wide.
    pub(super) fn all(findings: &'f Findings<'_>, variant: &Variant) -> Vec<Self> {
        if findings.grid.clusters < MIN_CLUSTERS {
            return Vec::new();
        }
        let models = findings.models_of(variant);
        let rows = findings.calibrations.iter().filter(|row| row.replies >= MIN_CONFIDENT_REPLIES);
        let dark = rows.clone().filter(|row| {
            let subject = &row.subject;
            subject.variant == *variant && subject.enhancer.is_none() && models.contains(&&*subject.model)
        });
        let Some(level) = dark.clone().filter_map(|row| row.subject.level).max() else {
            return Vec::new();
        };
        dark.filter(|row| row.subject.level == Some(level))
            .map(|dark| {
                let model = &*dark.subject.model;
                let clean = ModelInCondition::with_images(model, AxisLevel::L0, variant, None);
                Self { model, level, dark, clean: rows.clone().find(|row| row.subject.matches_up_to_group(&clean)) }
            })
            .collect()
    }

    /// True if the confidence is detected to be above the accuracy.
    fn is_overconfident(&self) -> bool {
        is_above(self.dark.overconfidence)
    }

    /// True if the overconfidence is detected to be larger than at L0.
    fn has_grown(&self) -> bool {
        self.dark.growth.is_some_and(is_above)
    }
}

/// True if a mean is detected to be above 0.
fn is_above(tested: Tested) -> bool {
    tested.difference.value > 0.0 && tested.is_detected()
}

/// The sentence about the model whose confidence is furthest above its accuracy. Both tests, of overconfidence and of
/// its growth since L0, are corrected over all sentences.
pub(super) fn confidence(all: &[Confidence<'_>], unit: ClusterUnit) -> Option<Sentence> {
    let most = all.iter().copied().max_by(|a, b| {
        let [value, other] = [a, b].map(|one| one.dark.overconfidence.difference.value);
        a.is_overconfident().cmp(&b.is_overconfident()).then(value.total_cmp(&other))
    })?;
    let mut numbers = NamedNumbers::new(unit);
    let (model, level) = (most.model, most.level);
    let sure = numbers.percent("confidence", most.dark.confidence.value);
    let right = numbers.percent("accuracy", most.dark.accuracy.value);
    let (tone, text) = if most.is_overconfident() && most.has_grown() {
        let text = format!(
            "{model} does not know how little it sees at {level}: its mean confidence is {sure} %, and {right} % of its replies are \
             right."
        );
        (EffectDirection::Worse, text)
    } else if most.is_overconfident() {
        let text = format!(
            "At {level} {model} is surer than it is right: its mean confidence is {sure} %, and {right} % of its replies are right."
        );
        (EffectDirection::Worse, text)
    } else {
        let text = format!(
            "{model} was not detected to be surer than it is right at {level}: its mean confidence is {sure} %, and {right} % of its \
             replies are right."
        );
        (EffectDirection::NotShown, text)
    };
    let difference = numbers.difference("", most.dark.overconfidence.difference);
    let p = numbers.p("p", most.dark.overconfidence.stated_p());
    let clean = most.clean.map(|clean| {
        let difference = numbers.difference("_L0", clean.overconfidence.difference);
        format!(", {difference} at L0")
    });
    let replies = numbers.count("n", most.dark.replies);
    let others = if all.len() > 1 {
        let overconfident = all.iter().filter(|one| one.is_overconfident()).count();
        let overconfident = numbers.count("shown", overconfident);
        let models = numbers.count("models", all.len());
        format!("; shown of {overconfident} of {models} models")
    } else {
        String::new()
    };
    let detail = format!(
        "confidence less accuracy: {difference} points, {p}{}{others}; n = {replies} replies with probabilities",
        clean.unwrap_or_default()
    );
    Some(numbers.sentence("confidence", tone, text, detail))
}
