//! Sentences about the replies: how many could not be read, and whether fidelity predicts right ones.

use super::sentence::{Numbers, Sentence, Tone};
use crate::text::alert::MAX_UNREAD;
use crate::types::UnreadReason;
use darkqa_score::comparisons::{Claim, PooledFinding, PooledKind};
use darkqa_score::findings::Findings;
use darkqa_score::photographs::{ConditionFidelity, FidelityFindings};
use darkqa_score::significance::ALPHA;

/// Replies that could not be read, if they are few: an alert speaks of many, and of failed trials. Built-in models are not counted.
pub(super) fn unread(findings: &Findings<'_>) -> Option<Sentence> {
    let health = findings.health.iter();
    let health = health.filter(|health| !health.subject.is_reference());
    let (mut replies, mut unread) = (0, 0);
    for health in health {
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

/// Whether PSNR tells right from wrong answers within a condition, and what the best enhancer does to both.
pub(super) fn fidelity(findings: &Findings<'_>) -> Option<Sentence> {
    let fidelity = findings.fidelity.as_ref()?;
    let auc = fidelity.within[0]?;
    let mut numbers = Numbers::new(findings.unit);
    let estimate = auc.estimate;
    let is_detected = fidelity.p_report.is_some_and(|p| p < ALPHA);
    let (tone, text) = if is_detected && estimate.value > 0.5 {
        let text = "Within a condition, images with a higher PSNR get more right answers.";
        (Tone::Better, text)
    } else if is_detected {
        let text = "Within a condition, images with a higher PSNR get fewer right answers.";
        (Tone::Worse, text)
    } else {
        let text = "Within a condition, PSNR was not detected to tell right from wrong answers.";
        (Tone::NotShown, text)
    };
    let ends = [
        ("auc", estimate.value),
        ("low", estimate.low),
        ("high", estimate.high),
    ];
    let [value, low, high] = ends.map(|(name, value)| numbers.number(name, value, 2));
    let p = numbers.p("p", fidelity.p_report.unwrap_or(auc.p));
    let replies = numbers.count("n", estimate.n);
    let chance = numbers.number("chance", 0.5, 1);
    let mut detail =
        format!("AUC {value} [{low}, {high}], {chance} is chance, {p}; n = {replies} replies");
    if let Some(example) = largest_gain(findings, fidelity) {
        detail += &example_text(example, &mut numbers);
    }
    Some(numbers.sentence("fidelity", tone, text.to_owned(), detail))
}

/// An enhancer's images, the raw ones of the same level, and the difference of the answers.
type Gain<'f> = (
    &'f ConditionFidelity,
    &'f ConditionFidelity,
    &'f PooledFinding,
);

/// The enhancer and level with the largest gain of mean PSNR; `None` if no enhancer raises it.
fn largest_gain<'f>(
    findings: &'f Findings<'_>,
    fidelity: &'f FidelityFindings,
) -> Option<Gain<'f>> {
    fidelity
        .conditions
        .iter()
        .filter(|row| row.enhancer.is_some())
        .filter_map(|row| {
            let raw = fidelity.conditions.iter().find(|raw| {
                raw.enhancer.is_none() && raw.level == row.level && raw.variant == row.variant
            })?;
            let answers = findings.pooled.iter().find(|finding| {
                finding.kind == PooledKind::Enhancer
                    && finding.family.is_none()
                    && finding.level == row.level
                    && finding.variant == row.variant
                    && finding.enhancer == row.enhancer
            })?;
            Some((row.means[0]? - raw.means[0]?, (row, raw, answers)))
        })
        .filter(|(gain, _)| *gain > 0.0)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, gain)| gain)
}

fn example_text((row, raw, answers): Gain<'_>, numbers: &mut Numbers) -> String {
    let (Some(enhancer), [Some(before), Some(after)]) =
        (&row.enhancer, [raw.means[0], row.means[0]])
    else {
        return String::new();
    };
    let (before, after) = (
        numbers.number("psnr_raw", before, 1),
        numbers.number("psnr_enhanced", after, 1),
    );
    let difference = numbers.difference("_answers", answers.strict.difference);
    let shown = match answers.claim() {
        Claim::Detected(_) => "",
        _ => ", not detected",
    };
    format!(
        ". Largest gain: {enhancer} takes the mean PSNR at {} from {before} to {after} dB and the answers by {difference} points{shown}",
        row.level
    )
}
