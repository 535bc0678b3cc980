//! Findings in words: [`Sentence`]s that claim no more than their tests detected.
//!
//! Each sentence combines typed results with fixed wording. The terminal, the page, `summary.json` and `tables.tex`
//! show the same strings. Rules:
//!
//! - A sentence has a sign, and the words “costs”, “harms”, “helps” and “less often right”, only if p is below 0.05
//!   after the correction over the tests of all sentences, in the strict and in the lenient parsing, with the same
//!   direction.
//! - If only the strict parsing detects a difference, the sentence is about the answer format.
//! - If nothing is detected, the sentence states so, with the interval. It never states that there is no difference.
//! - A sentence is about the models of the run and names their number; it makes no claim about models in general.

mod answers;
mod apart;
mod baseline;
mod below_blind;
mod confidence;
mod darkness;
mod format;
mod hallucination;
mod lights;
mod models;
mod pooled;
mod readings;
mod real;
mod sample;
mod self_agreement;
mod sentence;
mod undecided;

pub(crate) use baseline::{against_baseline, no_verdict};
pub(crate) use models::dark_levels;
pub(crate) use sample::left_out;
pub(crate) use self_agreement::self_agreement;
#[cfg(test)]
pub(crate) use sentence::Scope;
pub(crate) use sentence::{Sentence, Tone, capitalised};

use std::collections::BTreeSet;

use self::confidence::Confidence;
use self::hallucination::TopAnswer;
use self::lights::{findings_of_kind, in_each_light, mean_findings};
use crate::types::{Family, Variant};
use darkqa_score::answers::confusion::FalseAnswer;
use darkqa_score::comparisons::PooledKind;
use darkqa_score::findings::Findings;

/// The line below the sentences that explains their signs, p-values and intervals.
pub(crate) fn how_to_read(sentences: &[Sentence]) -> String {
    let has_baseline = sentences.iter().any(|sentence| sentence.kind == "baseline");
    let old_run = if has_baseline { ", and 5 % more for the old run" } else { "" };
    format!(
        "Signs and p are corrected over all tests behind these sentences: a report without any effect has a sign with a probability of \
         5 % at most{old_run}. A sign holds in the strict and the lenient parsing. An interval is of one test: it leaves out 0 if and \
         only if the uncorrected p is below 0.05."
    )
}

/// All sentences, in the order of their importance.
#[must_use]
pub(crate) fn sentences(findings: &Findings<'_>) -> Vec<Sentence> {
    let mut sentences = Vec::new();
    sentences.extend(sample::impossible(findings));
    sentences.extend(sample::left_out(findings));
    sentences.extend(readings::readings(&findings.by_profile, findings.unit));
    sentences.extend(darkness::darkness(findings));
    sentences.extend(real::real(findings));
    sentences.extend(in_each_light(findings, about_light));
    sentences.extend(below_blind::untouched(findings));
    sentences.extend(about_clean(findings));
    sentences.extend(models::best(findings));
    sentences.extend(apart::apart(findings));
    sentences.extend(in_each_light(findings, about_answers));
    sentences.extend(answers::fidelity(findings));
    sentences.extend(answers::unread(findings));
    sentences.extend(sample::power(&findings.pooled, findings.unit));
    for sentence in &mut sentences {
        sentence.add_training_data(&findings.grid.listing);
    }
    sentences
}

/// Sentences about noise, enhancers, and questions without images.
fn about_light(findings: &Findings<'_>, variant: &Variant) -> Vec<Sentence> {
    let unit = findings.unit;
    let [noise, enhancers, blind] = [PooledKind::Noise, PooledKind::Enhancer, PooledKind::Blind]
        .map(|kind| findings_of_kind(findings, kind, variant));
    let [noise_means, enhancer_means] =
        [PooledKind::Noise, PooledKind::Enhancer].map(|kind| mean_findings(findings, kind, variant));
    let mut sentences = Vec::new();
    sentences.extend(pooled::noise(&noise, &noise_means, unit));
    sentences.extend(pooled::enhancers(&enhancers, &enhancer_means, unit));
    sentences.extend(below_blind::pooled(&blind, unit));
    let by_family = below_blind::by_family(findings, variant);
    sentences.extend(below_blind::in_a_family(&by_family, &blind, unit));
    sentences
}

/// Sentences about enhancers on the clean frames.
fn about_clean(findings: &Findings<'_>) -> Vec<Sentence> {
    let clean: BTreeSet<&Variant> = findings
        .pooled
        .iter()
        .filter(|finding| finding.kind == PooledKind::Enhancer && finding.variant.kind.is_none())
        .map(|finding| &finding.variant)
        .collect();
    clean
        .into_iter()
        .flat_map(|variant| {
            let levels = findings_of_kind(findings, PooledKind::Enhancer, variant);
            pooled::enhancers(&levels, &[], findings.unit)
        })
        .collect()
}

/// Sentences about false answers, one answer to everything, confidence, and the families.
fn about_answers(findings: &Findings<'_>, variant: &Variant) -> Vec<Sentence> {
    let unit = findings.unit;
    let mut sentences = Vec::new();
    for answer in [FalseAnswer::No, FalseAnswer::Yes] {
        let levels = findings_of_kind(findings, PooledKind::Hallucination(answer), variant);
        sentences.extend(hallucination::false_answers(&levels, answer, unit));
    }
    let mut answers = TopAnswer::all(findings, variant);
    // False answers already report a model that answers “no” to most questions about presence.
    if !sentences.is_empty() {
        answers.retain(|answer| *answer.family != Family::Presence);
    }
    sentences.extend(hallucination::collapse(&answers, unit));
    let confidence = Confidence::all(findings, variant);
    sentences.extend(confidence::confidence(&confidence, unit));
    sentences.extend(models::families(findings, variant));
    sentences
}

#[cfg(test)]
pub(crate) mod tests;
