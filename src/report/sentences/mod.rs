//! Findings in words: [`Sentence`]s that say what was shown, and no more than its test.
//!
//! Each sentence comes from typed results and from fixed wording. The terminal, the page, `summary.json` and `tables.tex` show the
//! same strings. Rules:
//!
//! - “costs”, “harms”, “helps” and “falls below” are used only if p after Holm's correction is below 0.05.
//! - If nothing is shown, the sentence says “is not shown”, with the interval. It never says that there is no difference.
//! - A sentence is about the models of the run and names their number; it does not speak of models in general.

mod answers;
mod baseline;
mod confidence;
mod darkness;
mod hallucination;
mod lights;
mod models;
mod pooled;
mod readings;
mod real;
mod sample;
mod self_agreement;
mod sentence;
mod words_alone;

pub(crate) use baseline::{against_baseline, no_verdict};
pub(in crate::report) use models::over_levels;
pub(in crate::report) use sample::left_out;
pub(in crate::report) use self_agreement::self_agreement;
pub(crate) use sentence::{Sentence, Tone};

use std::collections::BTreeSet;

use self::confidence::Confidence;
use self::hallucination::TopAnswer;
use self::lights::{in_each_light, of_set};
use crate::score::confusion::FalseAnswer;
use crate::score::findings::Findings;
use crate::score::pooled_kind::PooledKind;
use crate::types::{Family, KindReading};

/// Largest number of sentences that are shown first; the others follow on request.
pub(in crate::report) const FIRST: usize = 8;

/// What is said about the sentences as a whole, in the line below them.
pub(in crate::report) const HOW_TO_READ: &str = "p is Holm's, over the levels of a finding (best: pairs of models; one family below blind: conditions and families of a model; old run: conditions of a model; fidelity: one test). An interval is uncorrected: effects outside it are ruled out at 95 %. Interval and test are two methods: near p = 0.05 they may disagree.";

/// All sentences, in the order of their importance.
#[must_use]
pub(crate) fn sentences(findings: &Findings<'_>) -> Vec<Sentence> {
    let mut sentences = Vec::new();
    sentences.extend(sample::impossible(findings));
    sentences.extend(sample::left_out(findings));
    sentences.extend(readings::readings(&findings.by_reading, findings.unit));
    sentences.extend(darkness::darkness(findings));
    sentences.extend(real::real(findings));
    sentences.extend(in_each_light(findings, about_light));
    sentences.extend(words_alone::untouched(findings));
    sentences.extend(about_clean(findings));
    sentences.extend(models::best(findings));
    sentences.extend(in_each_light(findings, about_answers));
    sentences.extend(answers::fidelity(findings));
    sentences.extend(answers::unread(findings));
    sentences.extend(sample::power(&findings.pooled, findings.unit));
    sentences
}

/// Sentences about noise, enhancers and words alone.
fn about_light(findings: &Findings<'_>, variant: &KindReading) -> Vec<Sentence> {
    let unit = findings.unit;
    let of = |kind| of_set(findings, kind, variant);
    let mut sentences = Vec::new();
    sentences.extend(pooled::noise(&of(PooledKind::Noise), unit));
    sentences.extend(pooled::enhancers(&of(PooledKind::Enhancer), unit));
    let blind = of(PooledKind::Blind);
    sentences.extend(words_alone::pooled(&blind, unit));
    let by_family = words_alone::by_family(findings, variant);
    sentences.extend(words_alone::in_a_family(&by_family, &blind, unit));
    sentences
}

/// Sentences about enhancers on the clean frames.
fn about_clean(findings: &Findings<'_>) -> Vec<Sentence> {
    let clean = findings
        .pooled
        .iter()
        .filter(|finding| finding.kind == PooledKind::Enhancer && finding.variant.kind.is_none());
    let clean: BTreeSet<&KindReading> = clean.map(|finding| &finding.variant).collect();
    let sentences = clean.into_iter().flat_map(|variant| {
        let levels = of_set(findings, PooledKind::Enhancer, variant);
        pooled::enhancers(&levels, findings.unit)
    });
    sentences.collect()
}

/// Sentences about false answers, one answer to everything, confidence, and the families.
fn about_answers(findings: &Findings<'_>, variant: &KindReading) -> Vec<Sentence> {
    let unit = findings.unit;
    let mut sentences = Vec::new();
    for answer in [FalseAnswer::No, FalseAnswer::Yes] {
        let levels = of_set(findings, PooledKind::Hallucination(answer), variant);
        sentences.extend(hallucination::false_answers(&levels, answer, unit));
    }
    let mut answers = TopAnswer::all(findings, variant);
    // “no” to most questions about presence is one finding, not two.
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
mod tests;
