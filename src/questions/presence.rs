//! "Is there a chair in the image?"

use std::collections::BTreeSet;

use serde_json::json;

use super::reason::Reason;
use super::rule_context::{Candidate, RuleContext, RuleResult, rejected, yes_no};
use super::rules::{ClassFlag, PresenceRule};
use super::statistics::{Segment, ppm};
use crate::types::Family;

/// One candidate for every asked class: yes if it has a pixel in the frame, else no.
pub(super) fn candidates(context: &RuleContext<'_>) -> Vec<RuleResult> {
    let rule = &context.book.presence;
    let expected = context.room.and_then(|room| {
        context
            .frequency
            .expected(room, &context.statistics.scene, rule.frequent)
    });
    let classes = context.book.class.iter();
    let asked = classes.filter(|(_, class)| class.flags.contains(&ClassFlag::Asked));
    asked
        .map(|(class, _)| {
            let present = context.statistics.of_class(class) > 0;
            let result = if present {
                yes(context, class)
            } else {
                no(context, class, expected.as_ref())
            };
            result.unwrap_or_else(|reason| rejected(Family::Presence, class, Some(present), reason))
        })
        .collect()
}

/// Yes: one segment of the class is large enough, of one class and not cut by the border.
fn yes(context: &RuleContext<'_>, class: &str) -> Result<RuleResult, Reason> {
    let rule = &context.book.presence;
    let segments = context.statistics.segments.iter();
    let mut segments: Vec<&Segment> = segments.filter(|segment| segment.class == class).collect();
    segments.sort_by_key(|segment| (std::cmp::Reverse(segment.area), segment.id));
    let flaws: Vec<Option<Reason>> = segments
        .iter()
        .map(|segment| flaw(context, segment, rule))
        .collect();
    match flaws.iter().position(Option::is_none) {
        Some(found) => Ok(candidate(
            context,
            class,
            0,
            &segments[found..=found],
            json!({}),
        )),
        // The reason is that of the largest segment. If none is listed, all are tiny.
        None => Err(flaws.first().copied().flatten().unwrap_or(Reason::Small)),
    }
}

fn flaw(context: &RuleContext<'_>, segment: &Segment, rule: &PresenceRule) -> Option<Reason> {
    if let Some(reason) = context.statistics.disqualified(segment, context.book) {
        return Some(reason);
    }
    let area = context.statistics.area(segment);
    if area < rule.area_ppm {
        Some(Reason::Small)
    } else if ppm(segment.pure, segment.area) < rule.purity_ppm {
        Some(Reason::Mixed)
    } else if ppm(segment.rim_on_border, segment.rim) > rule.border_ppm
        && area < rule.border_area_ppm
    {
        Some(Reason::Cut)
    } else {
        None
    }
}

/// No: the class and the classes that may be mistaken for it have no pixel, absence can be shown in this frame, and the class
/// is common in such rooms.
fn no(
    context: &RuleContext<'_>,
    class: &str,
    expected: Option<&BTreeSet<String>>,
) -> Result<RuleResult, Reason> {
    if !context.labels.expressible.contains(class) {
        return Err(Reason::Inexpressible);
    }
    if let Some(reason) = context.absence_blocker() {
        return Err(reason);
    }
    let groups = context
        .book
        .confusable
        .iter()
        .filter(|group| group.classes.contains(class));
    let confused = groups.clone().any(|group| {
        group
            .classes
            .iter()
            .any(|other| context.statistics.of_class(other) > 0)
            || context
                .statistics
                .words
                .keys()
                .any(|word| group.names.contains(word))
    });
    if confused {
        return Err(Reason::Confusable);
    }
    if expected.is_some_and(|expected| !expected.contains(class)) {
        return Err(Reason::Implausible);
    }
    let evidence = json!({
        "pixels": 0,
        "void_ppm": context.statistics.ppm(context.statistics.effective_void),
        "mirror_ppm": context.statistics.ppm(context.statistics.of_class("mirror")),
        "confusable": groups.flat_map(|group| &group.classes).collect::<BTreeSet<_>>(),
    });
    Ok(candidate(context, class, 1, &[], evidence))
}

fn candidate(
    context: &RuleContext<'_>,
    class: &str,
    truth: usize,
    segments: &[&Segment],
    evidence: serde_json::Value,
) -> RuleResult {
    let book = context.book;
    let text = book.presence.text.replace("{article}", book.article(class));
    let text = text.replace("{object}", book.name(class));
    context.viable(
        Candidate {
            family: Family::Presence,
            about: class.to_owned(),
            text,
            choices: yes_no(),
            truth,
            evidence,
        },
        segments,
    )
}
