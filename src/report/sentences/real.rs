//! Sentences about photographs in the dark: their cost, their difference from synthetic images, and the effect of
//! enhancers.

use super::pooled::{lower_or_higher, unconfirmed};
use super::sentence::{EffectDirection, NamedNumbers, Sentence};
use crate::text::words::light;
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::{Claim, Comparison, ComparisonKind};
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::models_under_test;
use darkqa_score::photographs::PairDarkness;
use darkqa_score::significance::Verdict;

/// Sentences about each model and each photograph: compared with the lit frame, with synthetic images of the same
/// darkness, and with the enhanced photograph.
pub(super) fn real(findings: &Findings<'_>) -> Vec<Sentence> {
    let models = models_under_test(findings.grid.subjects.iter().map(|subject| &*subject.model));
    let mut sentences = Vec::new();
    for pair in &findings.pairs {
        let rows: Vec<&Comparison> = findings
            .comparisons
            .iter()
            .filter(|row| {
                row.family.is_none()
                    && row.first.variant.photograph() == Some(&pair.name)
                    && models.contains(&*row.first.model)
            })
            .collect();
        let unit = findings.unit;
        for row in rows.iter().filter(|row| row.kind == ComparisonKind::Level) {
            sentences.push(cost(row, pair, unit));
        }
        for row in &rows {
            if row.kind == ComparisonKind::RealSynthetic && row.first.enhancer.is_none() {
                sentences.push(against_synthetic(row, unit));
            }
        }
        for row in rows.iter().filter(|row| row.kind == ComparisonKind::RealEnhanced) {
            sentences.push(enhanced(row, unit));
        }
    }
    sentences
}

/// The loss of a model on photographs in the dark.
fn cost(row: &Comparison, pair: &PairDarkness, unit: ClusterUnit) -> Sentence {
    let mut numbers = NamedNumbers::new(unit);
    let least = if pair.is_lower_bound { "≥ " } else { "" };
    let ev = numbers.number("ev", pair.ev[1], 1);
    let place = format!("Photographed in the dark ({}, {least}{ev} EV)", pair.name);
    let model = &row.first.model;
    let text = match verdict(row) {
        Verdict::Worse | Verdict::Better => {
            let does = if verdict(row) == Verdict::Worse { "loses" } else { "gains" };
            let size = numbers.size("effect", row.strict.tested.difference.value);
            format!("{place}, {model} {does} {size} points against the light.")
        }
        _ => match unconfirmed_size(row, &mut numbers) {
            Some((size, end)) => {
                format!("{place}, accuracy of {model} is {size} than in the light{end}.")
            }
            None => format!("{place}, no loss of {model} is shown."),
        },
    };
    sentence("real darkness", row, numbers, text)
}

/// The difference of a model between photographs and synthetic images of the same darkness.
fn against_synthetic(row: &Comparison, unit: ClusterUnit) -> Sentence {
    let mut numbers = NamedNumbers::new(unit);
    let (model, synthetic) = (&row.first.model, light(&row.second.variant, None));
    let level = row.second.condition();
    let (name, size) = (row.first.condition(), row.strict.tested.difference.value);
    let text = match verdict(row) {
        Verdict::Worse | Verdict::Better => {
            let harder = if verdict(row) == Verdict::Worse { "harder" } else { "easier" };
            let size = numbers.size("effect", size);
            format!("{name} is {harder} for {model} than {synthetic} ({level}), by {size} points.")
        }
        _ => match unconfirmed_size(row, &mut numbers) {
            Some((size, end)) => format!("With {name}, accuracy of {model} is {size} than {synthetic} ({level}){end}."),
            None => format!("It is not shown that {name} is harder or easier for {model} than {synthetic} ({level})."),
        },
    };
    sentence("real against synthetic", row, numbers, text)
}

/// The effect of an enhancer on photographs.
fn enhanced(row: &Comparison, unit: ClusterUnit) -> Sentence {
    let mut numbers = NamedNumbers::new(unit);
    let name = row.first.enhancer.as_ref().map_or("", |name| name.as_str());
    if let Some(enhancer) = &row.first.enhancer {
        numbers.about(enhancer);
    }
    let (model, raw) = (&row.first.model, row.second.condition());
    let text = match verdict(row) {
        Verdict::Worse | Verdict::Better => {
            let does = if verdict(row) == Verdict::Worse { "harms" } else { "helps" };
            let size = numbers.size("effect", row.strict.tested.difference.value);
            format!("{name} {does} {model} with {raw}, by {size} points.")
        }
        _ => match unconfirmed_size(row, &mut numbers) {
            Some((size, end)) => {
                format!("{name} with {raw}: accuracy of {model} {size}{end}.")
            }
            None => format!("Neither help nor harm of {name} is shown for {model} with {raw}."),
        },
    };
    sentence("real enhanced", row, numbers, text)
}

/// An effect that is not detected although its interval excludes 0, as `5.0 points lower`, and the end of its sentence.
fn unconfirmed_size(row: &Comparison, numbers: &mut NamedNumbers) -> Option<(String, &'static str)> {
    let difference = row.strict.tested.difference;
    let end = unconfirmed(row.claim(), difference)?;
    let size = numbers.size("effect", difference.value);
    let word = lower_or_higher(difference.value);
    Some((format!("{size} points {word}"), end))
}

/// The verdict in both parsings and after the correction over all sentences.
fn verdict(row: &Comparison) -> Verdict {
    match row.claim() {
        Claim::Detected(verdict) => verdict,
        _ => Verdict::NotShown,
    }
}

/// A sentence with the difference, its interval, its test and its sample.
fn sentence(kind: &'static str, row: &Comparison, mut numbers: NamedNumbers, text: String) -> Sentence {
    let paired = &row.strict;
    let difference = numbers.difference("", paired.tested.difference);
    let p = numbers.p("p", row.strict.tested.stated_p());
    let n = numbers.count("n", paired.tested.difference.n);
    let clusters = numbers.clusters(paired.clusters);
    let detail = format!("{difference}, {p}, n = {n} in {clusters}");
    let tone =
        if row.claim() == Claim::Impossible { EffectDirection::Note } else { EffectDirection::from(verdict(row)) };
    numbers.sentence(kind, tone, text, detail)
}
