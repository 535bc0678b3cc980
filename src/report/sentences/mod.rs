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
mod hallucination;
mod models;
mod pooled;
mod sentence;
mod words_alone;

pub(crate) use baseline::{against_baseline, no_verdict};
pub(crate) use sentence::Sentence;

use self::hallucination::TopAnswer;
use crate::report::words::light;
use crate::score::confusion::FalseAnswer;
use crate::score::findings::Findings;
use crate::score::pooled::PooledFinding;
use crate::score::pooled_kind::PooledKind;
use crate::types::{Family, KindReading};

/// Largest number of sentences that are shown first; the others follow on request.
pub(in crate::report) const FIRST: usize = 8;

/// What is said about the sentences as a whole, in the line below them.
pub(in crate::report) const HOW_TO_READ: &str = "p is Holm's, over the levels of a finding. An interval is of one level, uncorrected: effects outside it are ruled out at 95 %.";

/// All sentences, in the order of their importance.
#[must_use]
pub(crate) fn sentences(findings: &Findings<'_>) -> Vec<Sentence> {
    let mut sentences = Vec::new();
    if let Some(impossible) = pooled::impossible(findings) {
        sentences.push(impossible);
    } else {
        sentences.extend(in_each_light(findings, about_light));
        sentences.extend(models::best(findings));
        sentences.extend(in_each_light(findings, about_answers));
    }
    sentences.extend(answers::fidelity(findings));
    sentences.extend(answers::unread(findings));
    sentences.extend(pooled::power(&findings.pooled, findings.unit));
    sentences
}

/// Sentences about the last kind of degradation that was asked. If it was asked in several lights, each sentence names its own.
fn in_each_light(
    findings: &Findings<'_>,
    about: fn(&Findings<'_>, &KindReading) -> Vec<Sentence>,
) -> Vec<Sentence> {
    let variants = findings.grid.variants();
    let last = variants.last().map(|variant| variant.kind);
    let variants: Vec<&KindReading> = variants
        .into_iter()
        .filter(|variant| Some(variant.kind) == last)
        .collect();
    let mut all = Vec::new();
    for variant in &variants {
        let mut sentences = about(findings, variant);
        if variants.len() > 1 {
            for sentence in &mut sentences {
                sentence.text = format!("{}: {}", light(variant, None), sentence.text);
            }
        }
        all.extend(sentences);
    }
    all
}

/// Sentences about darkness, noise, enhancers and words alone.
fn about_light(findings: &Findings<'_>, variant: &KindReading) -> Vec<Sentence> {
    let unit = findings.unit;
    let of = |kind| of_set(findings, kind, variant);
    let mut sentences = Vec::new();
    sentences.extend(pooled::darkness(&of(PooledKind::Darkness), unit));
    sentences.extend(pooled::noise(&of(PooledKind::Noise), unit));
    sentences.extend(pooled::enhancers(&of(PooledKind::Enhancer), unit));
    let blind = of(PooledKind::Blind);
    sentences.extend(words_alone::pooled(&blind, unit));
    let by_family = words_alone::by_family(findings, variant);
    sentences.extend(words_alone::in_a_family(&by_family, &blind, unit));
    sentences
}

/// Sentences about false answers, one answer to everything, and the families.
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
    sentences.extend(models::families(findings, variant));
    sentences
}

/// The findings of one kind and variant over all families that the kind is about, in the order of enhancers and levels.
fn of_set<'f>(
    findings: &'f Findings<'_>,
    kind: PooledKind,
    variant: &KindReading,
) -> Vec<&'f PooledFinding> {
    let pooled = findings.pooled.iter();
    let of_set = pooled.filter(|finding| {
        finding.kind == kind
            && finding.family.as_ref() == kind.only_family()
            && finding.variant == *variant
    });
    of_set.collect()
}

#[cfg(test)]
mod tests;
