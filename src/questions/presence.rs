//! "Is there a chair in the image?"

use std::collections::BTreeSet;

use serde_json::json;

use super::reason::Reason;
use super::rule_context::{Candidate, RuleContext, RuleResult, falls, yes_no};
use super::rules::{ClassFlag, PresenceRule};
use super::statistics::{Segment, ppm};
use crate::types::Family;

/// Yes and no for every asked class.
pub(super) fn candidates(survey: &RuleContext<'_>) -> Vec<RuleResult> {
    let rule = &survey.book.presence;
    let expected = survey.room.and_then(|room| {
        survey
            .frequency
            .expected(room, &survey.statistics.scene, rule.frequent)
    });
    let classes = survey.book.class.iter();
    let asked = classes.filter(|(_, class)| class.flags.contains(&ClassFlag::Asked));
    asked
        .map(|(class, _)| {
            let present = survey.statistics.of_class(class) > 0;
            let verdict = if present {
                yes(survey, class)
            } else {
                no(survey, class, expected.as_ref())
            };
            verdict.unwrap_or_else(|reason| falls(Family::Presence, class, Some(present), reason))
        })
        .collect()
}

/// Yes: the best segment of the class is large, pure and whole.
fn yes(survey: &RuleContext<'_>, class: &str) -> Result<RuleResult, Reason> {
    let rule = &survey.book.presence;
    let segments = survey.statistics.segments.iter();
    let mut segments: Vec<&Segment> = segments.filter(|segment| segment.class == class).collect();
    segments.sort_by_key(|segment| (std::cmp::Reverse(segment.area), segment.id));
    let flaws: Vec<Option<Reason>> = segments
        .iter()
        .map(|segment| flaw(survey, segment, rule))
        .collect();
    match flaws.iter().position(Option::is_none) {
        Some(found) => Ok(claim(survey, class, 0, &segments[found..=found], json!({}))),
        // The largest says why; where none is listed, all are tiny.
        None => Err(flaws.first().copied().flatten().unwrap_or(Reason::Small)),
    }
}

fn flaw(survey: &RuleContext<'_>, segment: &Segment, rule: &PresenceRule) -> Option<Reason> {
    if let Some(reason) = survey.statistics.disqualified(segment, survey.book) {
        return Some(reason);
    }
    let area = survey.statistics.area(segment);
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

/// No: not a pixel of the class or of what may be taken for it, in a frame where that says something, of a thing that might
/// well be there.
fn no(
    survey: &RuleContext<'_>,
    class: &str,
    expected: Option<&BTreeSet<String>>,
) -> Result<RuleResult, Reason> {
    if !survey.labels.expressible.contains(class) {
        return Err(Reason::Inexpressible);
    }
    if let Some(reason) = survey.open_world() {
        return Err(reason);
    }
    let groups = survey
        .book
        .confusable
        .iter()
        .filter(|group| group.classes.contains(class));
    let confused = groups.clone().any(|group| {
        group
            .classes
            .iter()
            .any(|other| survey.statistics.of_class(other) > 0)
            || survey
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
    let more = json!({
        "pixels": 0,
        "void_ppm": survey.statistics.ppm(survey.statistics.effective_void),
        "mirror_ppm": survey.statistics.ppm(survey.statistics.of_class("mirror")),
        "confusable": groups.flat_map(|group| &group.classes).collect::<BTreeSet<_>>(),
    });
    Ok(claim(survey, class, 1, &[], more))
}

fn claim(
    survey: &RuleContext<'_>,
    class: &str,
    truth: usize,
    segments: &[&Segment],
    more: serde_json::Value,
) -> RuleResult {
    let book = survey.book;
    let text = book.presence.text.replace("{article}", book.article(class));
    let text = text.replace("{object}", book.name(class));
    survey.rests(
        Candidate {
            family: Family::Presence,
            about: class.to_owned(),
            text,
            choices: yes_no(),
            truth,
            evidence: more,
        },
        segments,
    )
}
