//! Sentences about models that are less often right with images than without: all together, or in one family.

use std::collections::BTreeSet;

use super::format::format_alone;
use super::pooled::{detail, runs, with_verdict};
use super::sentence::{Numbers, Sentence, Tone, capitalised, level_runs};
use crate::text::words::family as family_name;
use crate::types::{Axis, AxisLevel, KindReading};
use darkqa_score::claim::Claim;
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparison::{Comparison, ComparisonKind};
use darkqa_score::findings::Findings;
use darkqa_score::pooled::PooledFinding;
use darkqa_score::pooled_kind::PooledKind;
use darkqa_score::significance::Significance;

/// The second side of a comparison of images with no images, if both are of the same models.
const WITHOUT: &str = "without images";

/// Where the models are less often right than without images.
pub(super) fn pooled(levels: &[&PooledFinding], unit: ClusterUnit) -> Option<Sentence> {
    let shown = with_verdict(levels, Significance::Worse);
    let Some(largest) = PooledFinding::largest(&shown) else {
        let worse = levels
            .iter()
            .copied()
            .filter(|of| of.claim() == Claim::StrictOnly(Significance::Worse));
        return format_alone(&worse.collect::<Vec<_>>(), unit);
    };
    let mut numbers = Numbers::new(unit);
    let who = match &largest.models[..] {
        [one] => format!("{one} is"),
        _ => "the models are".to_owned(),
    };
    let below = second_side(largest);
    let at = runs(&shown, levels);
    let place = capitalised(largest.level.axis().unwrap_or(Axis::LIGHT).place);
    let text = format!("{place} {who} less often right than {below} at {at}.");
    let detail = detail(largest, &mut numbers, &format!("; at {}", largest.level));
    Some(numbers.sentence("below blind", Tone::Worse, text, detail))
}

/// The side with which a finding compares images.
fn second_side(finding: &PooledFinding) -> String {
    let mut models = finding.blind_models.iter();
    match &finding.blind_models[..] {
        _ if models.all(|model| finding.models.contains(model)) => WITHOUT.to_owned(),
        [other] => format!("{other} without images"),
        _ => "the models without images".to_owned(),
    }
}

/// Another model that images are compared with, as ` against NAME without images`; empty if each model is compared with itself.
fn against(finding: &PooledFinding) -> String {
    match &*second_side(finding) {
        WITHOUT => String::new(),
        other => format!(" against {other}"),
    }
}

/// The gain from untouched images, over all models.
pub(super) fn untouched(findings: &Findings<'_>) -> Option<Sentence> {
    let of = findings.pooled.iter().find(|finding| {
        finding.kind == PooledKind::Blind
            && finding.family.is_none()
            && finding.enhancer.is_none()
            && finding.level == AxisLevel::L0
    })?;
    let mut numbers = Numbers::new(findings.unit);
    if let Some(format) = format_alone(&[of], findings.unit) {
        return Some(format);
    }
    let (with, without) = (
        numbers.percent("with", of.strict.first),
        numbers.percent("without", of.strict.second),
    );
    let text = match of.claim() {
        Claim::Detected(Significance::Better) => format!(
            "At L0 images add {} points{}: {with} % with them, {without} % without.",
            numbers.size("gain", of.strict.difference.value),
            against(of)
        ),
        Claim::Detected(_) => format!(
            "At L0 images cost {} points{}: {with} % with them, {without} % without.",
            numbers.size("cost", of.strict.difference.value),
            against(of)
        ),
        // That no verdict is possible is said for all topics together.
        Claim::Impossible => return None,
        _ => format!(
            "No gain by images was detected at L0: {with} % with them, {without} % without."
        ),
    };
    let detail = detail(of, &mut numbers, "");
    Some(numbers.sentence("images", Tone::from(of.claim()), text, detail))
}

/// The comparisons by family of raw images of a variant with no images, of the models over which findings are pooled.
pub(super) fn by_family<'f>(
    findings: &'f Findings<'_>,
    variant: &KindReading,
) -> Vec<&'f Comparison> {
    let models = findings.models_of(variant);
    findings
        .comparisons
        .iter()
        .filter(|comparison| {
            let first = &comparison.first;
            comparison.kind == ComparisonKind::Blind
                && comparison.family.is_some()
                && first.variant == *variant
                && first.enhancer.is_none()
                && models.contains(&&*first.model)
        })
        .collect()
}

/// The family in which a model is furthest below its score without images, and how many models do in that family. `all` are the
/// comparisons of all models and families. `None` if the findings over all families (`pooled`) say it of the same single model.
pub(super) fn in_a_family(
    all: &[&Comparison],
    pooled: &[&PooledFinding],
    unit: ClusterUnit,
) -> Option<Sentence> {
    let difference = |of: &Comparison| of.strict.paired.difference.value;
    let below = all.iter().copied().filter(|of| is_below(of));
    let most = below.min_by(|a, b| difference(a).total_cmp(&difference(b)))?;
    let model = &most.first.model;
    let said = with_verdict(pooled, Significance::Worse);
    if said.iter().any(|finding| finding.models == [&**model]) {
        return None;
    }
    let of_family: Vec<&Comparison> = all
        .iter()
        .copied()
        .filter(|of| of.family == most.family)
        .collect();
    let below: Vec<&Comparison> = of_family
        .iter()
        .copied()
        .filter(|of| is_below(of))
        .collect();
    let [models, fallen] = [&of_family, &below].map(|of| {
        let models: BTreeSet<&str> = of.iter().map(|of| &*of.first.model).collect();
        models.len()
    });
    let mut numbers = Numbers::new(unit);
    let family = capitalised(family_name(most.family.as_ref()));
    let text = if fallen == 1 {
        let (than, at) = (than(most), levels_below(&of_family, most));
        format!("{family}: {model} is less often right than {than} at {at}.")
    } else {
        let than = if below.iter().all(|of| is_own(of)) {
            WITHOUT
        } else {
            "a model without images"
        };
        let fallen = numbers.count("fallen", fallen);
        let models = numbers.count("models", models);
        format!("{family}: {fallen} of {models} models are less often right than {than}.")
    };
    let detail = comparison_detail(most, &mut numbers)?;
    Some(numbers.sentence("below blind", Tone::Worse, text, detail))
}

fn is_below(comparison: &Comparison) -> bool {
    comparison.claim() == Claim::Detected(Significance::Worse)
}

/// Whether a model is compared with its own replies.
fn is_own(comparison: &Comparison) -> bool {
    comparison.first.model == comparison.second.model
}

/// The second side of a comparison with no images, in words.
fn than(comparison: &Comparison) -> String {
    if is_own(comparison) {
        WITHOUT.to_owned()
    } else {
        format!("{} without images", comparison.second.model)
    }
}

/// The levels at which a model is below the second side of a comparison. A model that was not asked without images is compared with
/// every model that was: the levels are those of one of them.
fn levels_below(of_family: &[&Comparison], of: &Comparison) -> String {
    let pair = of_family.iter().copied().filter(|other| {
        other.first.model == of.first.model && other.second.model == of.second.model
    });
    let sorted = |pair: Vec<&Comparison>| -> Vec<AxisLevel> {
        let levels: BTreeSet<AxisLevel> = pair.iter().filter_map(|of| of.first.level).collect();
        levels.into_iter().collect()
    };
    let below = sorted(pair.clone().filter(|of| is_below(of)).collect());
    level_runs(&below, &sorted(pair.collect()))
}

/// Effect, interval, p and n of a comparison with no images.
fn comparison_detail(comparison: &Comparison, numbers: &mut Numbers) -> Option<String> {
    let (model, level) = (&comparison.first.model, comparison.first.level?);
    let against = if is_own(comparison) {
        String::new()
    } else {
        format!(" against {}", comparison.second.model)
    };
    let paired = &comparison.strict.paired;
    numbers.at(&level);
    let difference = numbers.difference("", paired.difference);
    let tested = &comparison.strict;
    let p = numbers.p("p", tested.p_report.unwrap_or(tested.holm));
    let n = numbers.count("n", paired.difference.n);
    let clusters = numbers.clusters(paired.clusters);
    Some(format!(
        "{model} at {level}{against}: {difference}, {p}; n = {n} in {clusters}"
    ))
}
