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
//!
//! Sentences about replies: the number that could not be read, and whether image fidelity predicts right answers.
//!
//! The sentence about noise profiles: how many findings hold under all of them.

mod baseline;
mod below_blind;
mod darkness;
mod hallucination;
mod models;
mod pooled;
mod real;
mod sample;
mod self_agreement;
mod sentence;
#[cfg(test)]
pub(crate) mod tests;
mod threshold;
mod variation;

use std::collections::BTreeSet;

use self::hallucination::TopAnswer;
use crate::text::alert::MAX_UNREAD;
use below_blind::Confidence;
use darkness::{findings_of_kind, in_each_light, mean_findings};
use darkqa_base::types::{Family, UnreadReason, Variant};
use darkqa_score::answers::confusion::FalseAnswer;
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::{Claim, FindingByProfile, NoiseHypothesis, PooledFinding, PooledKind, Robustness};
use darkqa_score::findings::Findings;
use darkqa_score::photographs::{ConditionFidelity, FidelityFindings};
use darkqa_score::significance::ALPHA;
use pooled::UNCONFIRMED;
use sentence::NamedNumbers;

#[cfg(test)]
pub(crate) use sentence::SentenceScope;

pub use baseline::{against_baseline, no_verdict};
pub use models::dark_levels;
pub use sample::left_out;
pub use self_agreement::self_agreement;
pub use sentence::{EffectDirection, Sentence, capitalised, level_runs, with_separators};

/// The line below the sentences that explains their signs, p-values and intervals, and what the intervals leave out.
pub fn how_to_read(sentences: &[Sentence]) -> String {
    let has_variation = sentences.iter().any(|sentence| sentence.kind == "variation");
    let asked = if has_variation {
        "the wordings, orders and draws that were asked; the table of their variation has intervals for others, too"
    } else {
        "one wording of the prompt, one order of the choices and one draw of the noise; how far others move the results is unknown"
    };
    let has_baseline = sentences.iter().any(|sentence| sentence.kind == "baseline");
    let old_run = if has_baseline { ", and 5 % more for the old run" } else { "" };
    format!(
        "Signs and p are corrected over all tests behind these sentences: a report without any effect has a sign with a probability of \
         5 % at most{old_run}. A sign holds in the strict and the lenient parsing. An interval is of one test: it leaves out 0 if and \
         only if the uncorrected p is below 0.05. Intervals hold for {asked}."
    )
}

/// All sentences, in the order of their importance.
#[must_use]
pub fn sentences(findings: &Findings<'_>) -> Vec<Sentence> {
    let mut sentences = Vec::new();
    sentences.extend(sample::impossible(findings));
    sentences.extend(sample::left_out(findings));
    sentences.extend(readings(&findings.by_profile, findings.unit));
    sentences.extend(in_each_light(findings, threshold::seen_down_to));
    sentences.extend(darkness::darkness(findings));
    sentences.extend(variation::variation(findings));
    sentences.extend(real::real(findings));
    sentences.extend(in_each_light(findings, about_light));
    sentences.extend(below_blind::untouched(findings));
    sentences.extend(about_clean(findings));
    sentences.extend(models::best(findings));
    sentences.extend(models::apart(findings));
    sentences.extend(in_each_light(findings, about_answers));
    sentences.extend(fidelity(findings));
    sentences.extend(unread(findings));
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
    sentences.extend(below_blind::confidence(&confidence, unit));
    sentences.extend(models::families(findings, variant));
    sentences
}

/// The number of replies that could not be read, if they are few; an alert reports many, and failed trials. Built-in
/// models are not counted.
fn unread(findings: &Findings<'_>) -> Option<Sentence> {
    let (mut replies, mut unread) = (0, 0);
    for health in findings.health.iter().filter(|health| !health.subject.is_reference()) {
        replies += health.replies;
        let all: usize = health.unread.values().sum();
        unread += all - health.unread_for(&[UnreadReason::CannotTell]);
    }
    let share = unread as f64 / replies.max(1) as f64;
    if unread == 0 || share > MAX_UNREAD {
        return None;
    }
    let mut numbers = NamedNumbers::new(findings.unit);
    let count = numbers.count("unread", unread);
    let noun = if unread == 1 { "reply" } else { "replies" };
    let percent = numbers.percent("share", share);
    let text = format!("{count} {noun} ({percent} %) could not be read.");
    let all = numbers.count("replies", replies);
    let detail = format!("of {all} replies; those that cannot be read count as wrong");
    Some(numbers.sentence("unread", EffectDirection::Note, text, detail))
}

/// Whether PSNR predicts right answers within a condition, and the effect of the enhancer with the largest PSNR gain on
/// PSNR and answers.
fn fidelity(findings: &Findings<'_>) -> Option<Sentence> {
    let fidelity = findings.fidelity.as_ref()?;
    let auc = fidelity.within[0]?;
    let mut numbers = NamedNumbers::new(findings.unit);
    let estimate = auc.estimate;
    let is_detected = fidelity.p_report.is_some_and(|p| p < ALPHA);
    let excludes_chance = estimate.low > 0.5 || estimate.high < 0.5;
    let (more, tone) =
        if estimate.value > 0.5 { ("more", EffectDirection::Better) } else { ("fewer", EffectDirection::Worse) };
    let (tone, text) = if is_detected {
        let text = format!("Within a condition, images with a higher PSNR get {more} right answers.");
        (tone, text)
    } else if excludes_chance {
        let text = format!("Within a condition, images with a higher PSNR get {more} right answers{UNCONFIRMED}.");
        (EffectDirection::NotShown, text)
    } else {
        let text = "Within a condition, PSNR was not detected to tell right from wrong answers.";
        (EffectDirection::NotShown, text.to_owned())
    };
    let ends = [("auc", estimate.value), ("low", estimate.low), ("high", estimate.high)];
    let [value, low, high] = ends.map(|(name, value)| numbers.number(name, value, 2));
    let p = numbers.p("p", fidelity.p_report.unwrap_or(auc.p));
    let replies = numbers.count("n", estimate.n);
    let chance = numbers.number("chance", 0.5, 1);
    let mut detail = format!("AUC {value} [{low}, {high}], {chance} is chance, {p}; n = {replies} replies");
    if let Some(example) = largest_gain(findings, fidelity) {
        detail += &example_text(&example, &mut numbers);
    }
    Some(numbers.sentence("fidelity", tone, text, detail))
}

/// The PSNR gain of an enhancer at one level, and its effect on the answers.
struct Gain<'f> {
    enhanced: &'f ConditionFidelity,
    raw: &'f ConditionFidelity,
    answers: &'f PooledFinding,
}

/// The enhancer and level with the largest gain of mean PSNR; `None` if no enhancer raises it.
fn largest_gain<'f>(findings: &'f Findings<'_>, fidelity: &'f FidelityFindings) -> Option<Gain<'f>> {
    fidelity
        .conditions
        .iter()
        .filter(|row| row.enhancer.is_some())
        .filter_map(|enhanced| {
            let raw = fidelity
                .conditions
                .iter()
                .find(|raw| raw.enhancer.is_none() && raw.level == enhanced.level && raw.variant == enhanced.variant)?;
            let answers = findings.pooled.iter().find(|finding| {
                finding.kind == PooledKind::Enhancer
                    && finding.family.is_none()
                    && finding.level == enhanced.level
                    && finding.variant == enhanced.variant
                    && finding.enhancer == enhanced.enhancer
            })?;
            let gain = Gain { enhanced, raw, answers };
            Some((enhanced.means[0]? - raw.means[0]?, gain))
        })
        .filter(|(gain, _)| *gain > 0.0)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, gain)| gain)
}

fn example_text(gain: &Gain<'_>, numbers: &mut NamedNumbers) -> String {
    let Gain { enhanced, raw, answers } = gain;
    let (Some(enhancer), Some(before), Some(after)) = (&enhanced.enhancer, raw.means[0], enhanced.means[0]) else {
        return String::new();
    };
    let (before, after) = (numbers.number("psnr_raw", before, 1), numbers.number("psnr_enhanced", after, 1));
    let difference = numbers.difference("_answers", answers.strict.tested.difference);
    let note = match answers.claim() {
        Claim::Detected(_) => "",
        _ => ", not detected",
    };
    format!(
        ". Largest gain: {enhancer} takes the mean PSNR at {} from {before} to {after} dB and the answers by {difference} points{note}",
        enhanced.level
    )
}

/// The numbers of findings about noise that hold under all, some or none of the noise profiles; `None` without
/// findings. Findings that are repeated by level count once.
fn readings(found: &[FindingByProfile], unit: ClusterUnit) -> Option<Sentence> {
    let readings = found.first()?.effects.len();
    let whole: Vec<&FindingByProfile> =
        found.iter().filter(|one| !matches!(one.claim, NoiseHypothesis::NoiseCompounds(Some(_)))).collect();
    let [all, some, reversed, none, open] =
        [Robustness::All, Robustness::Some, Robustness::Reversed, Robustness::None, Robustness::Open]
            .map(|robustness| whole.iter().filter(|one| one.robustness == robustness).count());
    let mut numbers = NamedNumbers::new(unit);
    let text = format!(
        "{} of {} findings about noise {} under all {} noise profiles.",
        numbers.count("all", all),
        numbers.count("findings", whole.len()),
        if all == 1 { "holds" } else { "hold" },
        numbers.count("readings", readings),
    );
    let detail = format!(
        "{} under some; {} with opposite effects under two; {} with the opposite effect alone; {} open; corrected over all claims, models \
         and profiles; the table by noise profile names them",
        numbers.count("some", some),
        numbers.count("reversed", reversed),
        numbers.count("none", none),
        numbers.count("open", open),
    );
    Some(numbers.sentence("readings", EffectDirection::Note, text, detail))
}
