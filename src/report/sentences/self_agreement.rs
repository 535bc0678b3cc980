//! Sentences about agreement with a model's own answers at L0: [`self_agreement`].

use std::collections::BTreeSet;

use super::sentence::{EffectDirection, NamedNumbers, Sentence, level_runs};
use super::threshold::evidence_down_to;
use crate::text::words::light;
use darkqa_base::types::{AxisLevel, EnhancerName, SetLight, Variant};
use darkqa_score::comparisons::self_agreement::SelfAgreement;
use darkqa_score::comparisons::self_agreement::cell::{AgreementCell, CellRole};
use darkqa_score::comparisons::self_agreement::light::LightReplies;
use darkqa_score::comparisons::{Claim, Comparison, ComparisonKind};
use darkqa_score::model_in_condition::models_under_test;
use darkqa_score::significance::Verdict;

/// All sentences of a run without true answers: models against each other at L0 first, then each model.
#[must_use]
pub fn self_agreement(found: &SelfAgreement<'_>) -> Vec<Sentence> {
    let mut sentences = between(found);
    for model in found.models() {
        let light = found.light_of(model);
        if light.is_some_and(LightReplies::is_unread) {
            sentences.push(unread(found, model));
            continue;
        }
        if found.cannot_tell(model) {
            sentences.push(cannot_tell(found, model));
            continue;
        }
        for variant in variants(found, model) {
            sentences.extend(evidence_down_to(found, model, &variant));
            sentences.extend(darkness(found, model, &variant));
            for enhancer in enhancers(found, model) {
                sentences.extend(enhanced(found, model, &variant, &enhancer));
            }
        }
        for enhancer in enhancers(found, model) {
            sentences.extend(enhanced(found, model, &Variant::NONE, &enhancer));
        }
        sentences.extend(cannot_tell_shares(found, model));
    }
    for sentence in &mut sentences {
        sentence.add_training_data(&found.grid.listing);
    }
    sentences
}

/// The sentence for a model without a readable reply at L0.
fn unread(found: &SelfAgreement<'_>, model: &str) -> Sentence {
    let text = format!(
        "Nothing is known about {model}: no answer could be read in any of its replies at L0, so that there is nothing to compare it with."
    );
    let detail = "--request constrain=choice makes a server allow letters alone; --max-tokens may be too low for a model that thinks first";
    let numbers = NamedNumbers::new(found.unit);
    numbers.sentence("no_answer_in_the_light", EffectDirection::Note, text, detail.to_owned())
}

/// The sentence for a model whose answer to each question is the same for nearly all images, so that no verdict is
/// possible.
fn cannot_tell(found: &SelfAgreement<'_>, model: &str) -> Sentence {
    let mut numbers = NamedNumbers::new(found.unit);
    let (_, all) = found.informative(model);
    let all = numbers.count("questions", all);
    let text = format!(
        "The questions do not show what {model} sees: at L0 it answers each of the {all} alike for 95 % of the images or more."
    );
    let images = found.questions.iter().filter(|question| question.model == model).map(|question| question.images);
    let (least, greatest) = (images.clone().min(), images.max());
    let fewest = numbers.count("fewest_images", least.unwrap_or_default());
    let most = numbers.count("most_images", greatest.unwrap_or_default());
    let images = match (least, greatest) {
        (Some(1), Some(1)) => "1 image".to_owned(),
        (least, greatest) if least == greatest => format!("{most} images"),
        _ => format!("{fewest} to {most} images"),
    };
    let detail = format!(
        "each question has an answer about {images}; such a model agrees with itself whether it sees or not: ask other questions, \
         or about more images"
    );
    numbers.sentence("bank_cannot_tell", EffectDirection::Note, text, detail)
}

/// The agreement of each pair of models at L0.
fn between(found: &SelfAgreement<'_>) -> Vec<Sentence> {
    let models = models_under_test(found.models());
    let pairs = found.between.iter().filter(|pair| models.contains(&*pair.first) && models.contains(&*pair.second));
    pairs.map(|pair| {
        let mut numbers = NamedNumbers::new(found.unit);
        let same = numbers.percent("same", pair.same.value);
        let text = format!(
            "At L0 {} and {} give the same answer to {same} % of the questions that both answer.",
            pair.first, pair.second
        );
        let ends = numbers.share_ends("", pair.same);
        let kappa = match pair.kappa {
            Some(kappa) => format!("κ {}", numbers.number("kappa", kappa.value, 2)),
            None => "κ not defined".to_owned(),
        };
        let n = numbers.count("n", pair.same.n);
        let detail = format!(
            "[{ends}] %, {kappa}, n = {n}; each is compared with itself, so that their agreements in the dark can be compared only as far as this"
        );
        numbers.sentence("models_in_light", EffectDirection::Note, text, detail)
    }).collect()
}

/// The degraded variants of a model: the main variant of the report, then the others, sorted.
fn variants(found: &SelfAgreement<'_>, model: &str) -> Vec<Variant> {
    let main = found.grid.main_variant();
    let own: BTreeSet<&Variant> = found
        .whole()
        .filter(|cell| cell.subject.model == model)
        .map(|cell| &cell.subject.variant)
        .filter(|variant| variant.kind.is_some())
        .collect();
    let mut own: Vec<Variant> = own.into_iter().cloned().collect();
    own.sort_by_key(|variant| main.as_ref() != Some(variant));
    own
}

fn enhancers(found: &SelfAgreement<'_>, model: &str) -> BTreeSet<EnhancerName> {
    found.whole().filter(|cell| cell.subject.model == model).filter_map(|cell| cell.subject.enhancer.clone()).collect()
}

/// The comparisons of one kind of a model, over all families.
fn compared<'f>(
    found: &'f SelfAgreement<'_>,
    kind: ComparisonKind,
    model: &str,
) -> impl Iterator<Item = &'f Comparison> {
    found
        .comparisons
        .iter()
        .filter(move |comparison| comparison.kind == kind && comparison.family.is_none())
        .filter(move |comparison| comparison.first.model == model)
}

/// The agreement of a model's answers at the darkest level of a variant.
fn darkness(found: &SelfAgreement<'_>, model: &str, variant: &Variant) -> Option<Sentence> {
    let mut cells = found.whole().filter(|cell| cell.subject.model == model);
    let dark = cells
        .clone()
        .filter(|cell| cell.subject.variant == *variant && cell.subject.enhancer.is_none())
        .max_by_key(|cell| cell.subject.level)?;
    let level = dark.subject.level?;
    let agreement = dark.agreement?;
    let mut numbers = NamedNumbers::new(found.unit);
    let share = numbers.percent("agreement", agreement.value);
    let ceiling = cells.clone().find(|cell| cell.role() == CellRole::Ceiling);
    let floor = cells.find(|cell| cell.role() == CellRole::Floor);
    let mut references = Vec::new();
    for (name, words, cell) in [("ceiling", "asked again at L0", ceiling), ("floor", "without an image", floor)] {
        if let Some(share) = cell.and_then(|cell| cell.agreement) {
            references.push(format!("{words} to {} %", numbers.percent(name, share.value)));
        }
    }
    let references = if references.is_empty() { String::new() } else { format!("; {}", references.join(", ")) };
    let text = format!(
        "At {level} ({}) {model} gives its answer at L0 to {share} % of the questions{references}.",
        light(variant, None)
    );
    let test = compared(found, ComparisonKind::Level, model).find(|comparison| comparison.first == dark.subject);
    let detail = darkness_detail(found, dark, level, test, &mut numbers);
    let tone = test.map_or(EffectDirection::Note, |test| test.claim().into());
    Some(numbers.sentence("agreement_in_the_dark", tone, text, detail))
}

/// The detail of the sentence about the agreement at the darkest level.
fn darkness_detail(
    found: &SelfAgreement<'_>,
    dark: &AgreementCell,
    level: AxisLevel,
    test: Option<&Comparison>,
    numbers: &mut NamedNumbers,
) -> String {
    let model = &*dark.subject.model;
    let mut parts = Vec::new();
    if let Some(Ok(kept)) = dark.evidence {
        let value = numbers.percent("evidence", kept.value);
        let ends = numbers.share_ends("evidence_", kept);
        parts.push(format!("evidence kept {value} % [{ends}]"));
    }
    parts.push(match dark.kappa {
        Some(kappa) => format!("κ {}", numbers.number("kappa", kappa.value, 2)),
        None => "κ not defined".to_owned(),
    });
    if let [Some(clean), Some(here)] = dark.entropies {
        let clean = numbers.number("entropy_light", clean, 2);
        let here = numbers.number("entropy", here, 2);
        parts.push(format!("entropy of its answers {clean} at L0, {here} at {level}"));
    }
    if let Some(test) = test {
        let difference = numbers.difference("", test.strict.tested.difference);
        let p = numbers.p("p", test.strict.tested.stated_p());
        parts.push(format!("{difference} points against L0 asked again, {p}"));
    }
    if let Some(read) = found.light_of(model).and_then(|light| light.read) {
        let read = numbers.percent("read_in_light", read.value);
        parts.push(format!("{read} % had an answer at L0"));
    }
    let (informative, all) = found.informative(model);
    if informative < all {
        let (informative, all) = (numbers.count("informative", informative), numbers.count("questions", all));
        parts.push(format!("{informative} of {all} questions are informative"));
    }
    parts.join(", ")
}

/// The effect of an enhancer on a model's agreement with its answers at L0, over the levels of a variant.
fn enhanced(found: &SelfAgreement<'_>, model: &str, variant: &Variant, enhancer: &EnhancerName) -> Option<Sentence> {
    let own: Vec<&Comparison> = compared(found, ComparisonKind::Enhancer, model)
        .filter(|comparison| {
            let subject = &comparison.first;
            subject.variant == *variant && subject.enhancer.as_ref() == Some(enhancer)
        })
        .collect();
    let levels: Vec<AxisLevel> = own.iter().filter_map(|c| c.first.level).collect();
    let [better, worse] = [Verdict::Better, Verdict::Worse].map(|verdict| {
        let detected: Vec<AxisLevel> =
            own.iter().filter(|c| c.claim() == Claim::Detected(verdict)).filter_map(|c| c.first.level).collect();
        (!detected.is_empty()).then(|| level_runs(&detected, &levels))
    });
    let strongest = own.iter().max_by(|one, other| {
        let [one, other] = [one, other].map(|c| c.strict.tested.difference.value.abs());
        one.total_cmp(&other)
    })?;
    let (tone, text) = if found.set.light == SetLight::Dark && *variant == Variant::NONE {
        photograph_effects(enhancer, model, strongest.claim())
    } else {
        level_effects(enhancer, model, &light(variant, None), better, worse)
    };
    let mut numbers = NamedNumbers::new(found.unit);
    numbers.about(enhancer);
    let level = strongest.first.level?;
    let difference = numbers.difference("", strongest.strict.tested.difference);
    let p = numbers.p("p", strongest.strict.tested.stated_p());
    let against = if level == AxisLevel::L0 { "L0 asked again" } else { "raw" };
    let detail = format!("largest at {level}: {difference} points of agreement against {against}, {p}");
    Some(numbers.sentence("agreement_enhanced", tone, text, detail))
}

/// The effect of an enhancer on the answers of a model to images of a variant; `better` and `worse` are the levels at
/// which the answers become more and less like those at L0.
fn level_effects(
    enhancer: &EnhancerName,
    model: &str,
    variant: &str,
    better: Option<String>,
    worse: Option<String>,
) -> (EffectDirection, String) {
    match (better, worse) {
        (Some(levels), None) => {
            (EffectDirection::Better, format!("{enhancer} brings answers of {model} back at {levels} ({variant})."))
        }
        (None, Some(levels)) if levels == "L0" => (
            EffectDirection::Worse,
            format!("{enhancer} changes answers of {model} in the light: harm where nothing was dark."),
        ),
        (None, Some(levels)) => (
            EffectDirection::Worse,
            format!("{enhancer} takes {model} further from its answers at L0 at {levels} ({variant})."),
        ),
        (Some(better), Some(worse)) => (
            EffectDirection::Note,
            format!(
                "{enhancer} brings answers of {model} back at {better}, and changes others at {worse} ({variant})."
            ),
        ),
        (None, None) => (
            EffectDirection::NotShown,
            format!("{enhancer}: no effect on answers of {model} was detected ({variant})."),
        ),
    }
}

/// The effect of an enhancer on the answers of a model to photographs in the dark. L0 is also dark here, so a change of
/// an answer is neither help nor harm.
fn photograph_effects(enhancer: &EnhancerName, model: &str, change: Claim) -> (EffectDirection, String) {
    match change {
        Claim::Detected(Verdict::Worse) => (
            EffectDirection::Note,
            format!("{enhancer} changes answers of {model} to these photographs: whether for the better is not known."),
        ),
        Claim::Detected(_) => (
            EffectDirection::Note,
            format!(
                "{model} answers with {enhancer} as at L0, more often than the same photographs asked about again."
            ),
        ),
        _ => (
            EffectDirection::NotShown,
            format!("{enhancer}: no effect on answers of {model} to these photographs was detected."),
        ),
    }
}

/// The share of "cannot tell" replies at L0 and at the darkest level, if the questions offer that choice.
fn cannot_tell_shares(found: &SelfAgreement<'_>, model: &str) -> Option<Sentence> {
    let light = found.light_of(model).filter(|light| light.offers_cannot_tell)?;
    let dark = found
        .whole()
        .filter(|cell| cell.subject.model == model && cell.role() == CellRole::Other && cell.subject.enhancer.is_none())
        .max_by_key(|cell| cell.subject.level)?;
    let (level, share) = (dark.subject.level?, dark.cannot_tell?);
    let mut numbers = NamedNumbers::new(found.unit);
    let in_light = light.cannot_tell as f64 / light.replies().max(1) as f64;
    let in_light = numbers.percent("light", in_light);
    let here = numbers.percent("share", share.value);
    let text =
        format!("{model} says “cannot tell” to {in_light} % of the questions at L0, and to {here} % at {level}.");
    let ends = numbers.share_ends("", share);
    let n = numbers.count("n", share.n);
    let detail = format!("[{ends}] % at {level}, n = {n}");
    Some(numbers.sentence("cannot_tell", EffectDirection::Note, text, detail))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The summary of a report joins sentences with semicolons.
    #[test]
    fn missing_effect_names_enhancer_first() {
        let lift = EnhancerName::new("lift").unwrap();
        let (_, text) = level_effects(&lift, "m", "with noise", None, None);
        assert_eq!(text, "lift: no effect on answers of m was detected (with noise).");
        let (_, text) = photograph_effects(&lift, "m", Claim::Open);
        assert_eq!(text, "lift: no effect on answers of m to these photographs was detected.");
    }
}
