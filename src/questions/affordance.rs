//! "I want to sleep, is this room suitable for this?"

use serde_json::json;

use super::reason::Reason;
use super::rule_context::{Candidate, RuleContext, RuleResult, falls, yes_no};
use super::rules::ActivityRule;
use super::statistics::Segment;
use crate::types::Family;

/// Both answers for every activity.
pub(super) fn candidates(survey: &RuleContext<'_>) -> Vec<RuleResult> {
    let activities = survey.book.activity.iter();
    activities
        .flat_map(|activity| {
            let falls = |answer, reason| {
                falls(Family::Affordance, &activity.activity, Some(answer), reason)
            };
            [
                yes(survey, activity).unwrap_or_else(|reason| falls(true, reason)),
                no(survey, activity).unwrap_or_else(|reason| falls(false, reason)),
            ]
        })
        .collect()
}

/// Yes: the room is one where it is done, and what it takes is well seen.
fn yes(survey: &RuleContext<'_>, activity: &ActivityRule) -> Result<RuleResult, Reason> {
    let Some(room) = survey.room else {
        return Err(Reason::NoRoom);
    };
    if !activity.rooms.contains(room) {
        return Err(Reason::OtherRoom);
    }
    let evidence: Vec<&Segment> = survey.statistics.evidence(survey.book).collect();
    let of = |token: &String| {
        evidence
            .iter()
            .find(|segment| segment.token(survey.book) == token)
    };
    let seen = activity.enablers.iter().find_map(|tokens| {
        tokens
            .iter()
            .map(|token| of(token).copied())
            .collect::<Option<Vec<&Segment>>>()
    });
    let Some(segments) = seen else {
        return Err(Reason::Unseen);
    };
    Ok(claim(survey, activity, room, 0, &segments))
}

/// No: the room is known and no such room, and nothing that it takes, or that would do, has a pixel.
fn no(survey: &RuleContext<'_>, activity: &ActivityRule) -> Result<RuleResult, Reason> {
    let Some(room) = survey.room else {
        return Err(Reason::NoRoom);
    };
    if activity.rooms.contains(room) {
        return Err(Reason::OtherRoom);
    }
    if let Some(reason) = survey.open_world() {
        return Err(reason);
    }
    let pinch = activity
        .pinch
        .iter()
        .filter(|_| survey.book.affordance.strict);
    let tokens: Vec<&String> = activity.enablers.iter().flatten().chain(pinch).collect();
    if !tokens.iter().all(|token| survey.expressible(token)) {
        return Err(Reason::Inexpressible);
    }
    if tokens
        .iter()
        .any(|token| survey.statistics.shows(token, survey.book))
    {
        return Err(Reason::Seen);
    }
    Ok(claim(survey, activity, room, 1, &survey.signs_of(room)))
}

fn claim(
    survey: &RuleContext<'_>,
    activity: &ActivityRule,
    room: &str,
    truth: usize,
    segments: &[&Segment],
) -> RuleResult {
    let text = survey
        .book
        .affordance
        .text
        .replace("{activity}", &activity.activity);
    let more = json!({
        "room": room,
        "scores": survey.signs.scores,
        "suitable": activity.rooms,
    });
    survey.rests(
        Candidate {
            family: Family::Affordance,
            about: activity.activity.clone(),
            text,
            choices: yes_no(),
            truth,
            evidence: more,
        },
        segments,
    )
}
