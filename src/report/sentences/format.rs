//! Sentences about the answer format, for differences that only the strict parsing detects: [`format_alone`].

use super::sentence::{Numbers, Sentence, Tone, models};
use crate::report::text::words::light;
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::{Claim, PooledFinding, PooledKind};
use darkqa_score::significance::Significance;

/// The largest finding that only the strict parsing detects, among those for which readable replies explain at least
/// half of the difference.
pub(super) fn format_alone(levels: &[&PooledFinding], unit: ClusterUnit) -> Option<Sentence> {
    let strict_only: Vec<&PooledFinding> = levels
        .iter()
        .copied()
        .filter(|finding| {
            let readable = finding.format[0] - finding.format[1];
            let difference = finding.strict.difference.value;
            matches!(finding.claim(), Claim::StrictOnly(_)) && readable / difference >= 0.5
        })
        .collect();
    let largest = PooledFinding::largest(&strict_only)?;
    let is_loss = largest.claim() == Claim::StrictOnly(Significance::Worse);
    let (more, effect) = if is_loss { ("fewer", "loss") } else { ("more", "gain") };
    let level = largest.level;
    let place = match (largest.kind, &largest.enhancer) {
        (PooledKind::Enhancer, Some(enhancer)) => format!("With {enhancer} at {level}"),
        (PooledKind::Blind, _) => format!("With images at {level}"),
        _ => match &*light(&largest.variant, None) {
            "" => format!("At {level}"),
            light => format!("At {level} {light}"),
        },
    };
    let mut numbers = Numbers::new(unit);
    let readable = numbers.size("format", largest.format[0] - largest.format[1]);
    let lenient = numbers.difference("_lenient", largest.lenient.difference);
    let text = format!(
        "{place}, {readable} % {more} replies keep to the answer format; no {effect} of accuracy was detected ({lenient})."
    );
    let who = models(&largest.models, &mut numbers);
    let [here, there] = [("kept", 0), ("kept_else", 1)].map(|(name, side)| numbers.percent(name, largest.format[side]));
    let strict = numbers.difference("", largest.strict.difference);
    let p = numbers.p("p", largest.strict.p_report.unwrap_or(1.0));
    let sample = numbers.sample(largest);
    let detail = format!("{who}: {here} % keep to it, {there} % without; strict parsing {strict}, {p}; {sample}");
    Some(numbers.sentence("format", Tone::Note, text, detail))
}
