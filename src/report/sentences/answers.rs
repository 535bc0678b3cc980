//! Sentences about replies: the number that could not be read, and whether image fidelity predicts right answers.

use super::pooled::UNCONFIRMED;
use super::sentence::{Numbers, Sentence, Tone};
use crate::report::text::alert::MAX_UNREAD;
use crate::types::UnreadReason;
use darkqa_score::comparisons::{Claim, PooledFinding, PooledKind};
use darkqa_score::findings::Findings;
use darkqa_score::photographs::{ConditionFidelity, FidelityFindings};
use darkqa_score::significance::ALPHA;

/// The number of replies that could not be read, if they are few; an alert reports many, and failed trials. Built-in
/// models are not counted.
pub(super) fn unread(findings: &Findings<'_>) -> Option<Sentence> {
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
    let mut numbers = Numbers::new(findings.unit);
    let count = numbers.count("unread", unread);
    let noun = if unread == 1 { "reply" } else { "replies" };
    let percent = numbers.percent("share", share);
    let text = format!("{count} {noun} ({percent} %) could not be read.");
    let all = numbers.count("replies", replies);
    let detail = format!("of {all} replies; those that cannot be read count as wrong");
    Some(numbers.sentence("unread", Tone::Note, text, detail))
}

/// Whether PSNR predicts right answers within a condition, and the effect of the enhancer with the largest PSNR gain on
/// PSNR and answers.
pub(super) fn fidelity(findings: &Findings<'_>) -> Option<Sentence> {
    let fidelity = findings.fidelity.as_ref()?;
    let auc = fidelity.within[0]?;
    let mut numbers = Numbers::new(findings.unit);
    let estimate = auc.estimate;
    let is_detected = fidelity.p_report.is_some_and(|p| p < ALPHA);
    let excludes_chance = estimate.low > 0.5 || estimate.high < 0.5;
    let (more, tone) = if estimate.value > 0.5 { ("more", Tone::Better) } else { ("fewer", Tone::Worse) };
    let (tone, text) = if is_detected {
        let text = format!("Within a condition, images with a higher PSNR get {more} right answers.");
        (tone, text)
    } else if excludes_chance {
        let text = format!("Within a condition, images with a higher PSNR get {more} right answers{UNCONFIRMED}.");
        (Tone::NotShown, text)
    } else {
        let text = "Within a condition, PSNR was not detected to tell right from wrong answers.";
        (Tone::NotShown, text.to_owned())
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

fn example_text(gain: &Gain<'_>, numbers: &mut Numbers) -> String {
    let Gain { enhanced, raw, answers } = gain;
    let (Some(enhancer), Some(before), Some(after)) = (&enhanced.enhancer, raw.means[0], enhanced.means[0]) else {
        return String::new();
    };
    let (before, after) = (numbers.number("psnr_raw", before, 1), numbers.number("psnr_enhanced", after, 1));
    let difference = numbers.difference("_answers", answers.strict.difference);
    let note = match answers.claim() {
        Claim::Detected(_) => "",
        _ => ", not detected",
    };
    format!(
        ". Largest gain: {enhancer} takes the mean PSNR at {} from {before} to {after} dB and the answers by {difference} points{note}",
        enhanced.level
    )
}
