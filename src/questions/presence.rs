//! "Is there a chair in the image?"

use std::collections::{BTreeMap, BTreeSet};

use serde_json::json;

use super::reason::Reason;
use super::rule_context::{Candidate, RuleContext, RuleResult, rejected, yes_no};
use super::rules::{ClassFlag, PresenceRule};
use super::statistics::{Segment, ppm};
use darkqa_base::types::Family;

/// Returns the candidates for every asked class: if it has a pixel in the frame, a yes for each word of its segments,
/// else a no for each word that the data set has for it.
pub(super) fn candidates(context: &RuleContext<'_>) -> Vec<RuleResult> {
    let rule = &context.book.presence;
    let expected =
        context.room.and_then(|room| context.frequency.expected(room, &context.statistics.scene, rule.frequent));
    context
        .book
        .class
        .iter()
        .filter(|(_, class)| class.flags.contains(&ClassFlag::Asked))
        .flat_map(|(class, _)| {
            let is_present = context.statistics.class_pixels(class) > 0;
            let result = if is_present { present(context, class) } else { absent(context, class, expected.as_ref()) };
            result.unwrap_or_else(|reason| vec![rejected(Family::Presence, class, Some(is_present), reason)])
        })
        .collect()
}

/// Candidates with the answer yes, one for each word: a segment with this word is large enough, of one class and not
/// cut by the border.
fn present(context: &RuleContext<'_>, class: &str) -> Result<Vec<RuleResult>, Reason> {
    let rule = &context.book.presence;
    let mut segments: Vec<&Segment> =
        context.statistics.segments.iter().filter(|segment| segment.class == class).collect();
    segments.sort_by_key(|segment| (std::cmp::Reverse(segment.area), segment.id));
    let mut largest: BTreeMap<&str, &Segment> = BTreeMap::new();
    let mut first_flaw = None;
    for segment in segments {
        match (flaw(context, segment, rule), segment.question_word(context.book)) {
            (None, Some(word)) => drop(largest.entry(word).or_insert(segment)),
            (flaw, _) => {
                first_flaw.get_or_insert(flaw.unwrap_or(Reason::Wordless));
            }
        }
    }
    if largest.is_empty() {
        // The reason of the largest segment. Without a listed segment, all are tiny.
        return Err(first_flaw.unwrap_or(Reason::Small));
    }
    Ok(largest.into_iter().map(|(word, segment)| candidate(context, class, word, 0, &[segment], json!({}))).collect())
}

/// Reason why a segment does not show that its class is present; `None` if it does.
fn flaw(context: &RuleContext<'_>, segment: &Segment, rule: &PresenceRule) -> Option<Reason> {
    if let Some(reason) = context.statistics.evidence_flaw(segment, context.book) {
        return Some(reason);
    }
    let area = context.statistics.area_ppm(segment);
    if area < rule.area_ppm {
        Some(Reason::Small)
    } else if ppm(segment.pure, segment.area) < rule.purity_ppm {
        Some(Reason::Mixed)
    } else if ppm(segment.rim_on_border, segment.rim) > rule.border_ppm && area < rule.border_area_ppm {
        Some(Reason::Cut)
    } else {
        None
    }
}

/// Candidates with the answer no: neither the class nor anything that may be mistaken for it has a pixel, no coarse
/// class may hide it, absence can be shown in this frame, and the class is common in such rooms.
fn absent(
    context: &RuleContext<'_>,
    class: &str,
    expected: Option<&BTreeSet<String>>,
) -> Result<Vec<RuleResult>, Reason> {
    let words: Vec<&str> = context.vocabulary.class_words(class).collect();
    if words.is_empty() || !context.labels.expressible.contains(class) {
        return Err(Reason::Inexpressible);
    }
    if context.may_be_hidden(class) {
        return Err(Reason::Hidden);
    }
    if let Some(reason) = context.absence_blocker() {
        return Err(reason);
    }
    let groups = context.book.confusable.iter().filter(|group| group.classes.contains(class));
    let is_confusable = groups.clone().any(|group| {
        group.classes.iter().any(|other| context.statistics.class_pixels(other) > 0)
            || context.statistics.words.keys().any(|word| group.names.contains(word))
    });
    if is_confusable || context.statistics.words.keys().any(|word| context.book.resembles(word, class)) {
        return Err(Reason::Confusable);
    }
    if expected.is_some_and(|expected| !expected.contains(class)) {
        return Err(Reason::Implausible);
    }
    let evidence = json!({
        "pixels": 0,
        "void_ppm": context.statistics.ppm(context.statistics.effective_void),
        "mirror_ppm": context.statistics.ppm(context.statistics.class_pixels("mirror")),
        "confusable": groups.flat_map(|group| &group.classes).collect::<BTreeSet<_>>(),
    });
    Ok(words.into_iter().map(|word| candidate(context, class, word, 1, &[], evidence.clone())).collect())
}

fn candidate(
    context: &RuleContext<'_>,
    class: &str,
    word: &str,
    truth: usize,
    segments: &[&Segment],
    evidence: serde_json::Value,
) -> RuleResult {
    let rule = &context.book.presence;
    let text = context.book.fill_template(&rule.text, &rule.plural, word);
    context.viable(
        Candidate { family: Family::Presence, about: class.to_owned(), text, choices: yes_no(), truth, evidence },
        segments,
    )
}
