//! "I want to sleep, is this room suitable for this?"

use serde_json::json;

use super::reason::Reason;
use super::rule_context::{Candidate, RuleContext, RuleResult, rejected, yes_no};
use super::rules::ActivityRule;
use super::statistics::Segment;
use crate::types::Family;

/// Two candidates for every activity: yes and no.
pub(super) fn candidates(context: &RuleContext<'_>) -> Vec<RuleResult> {
    let activities = context.book.activity.iter();
    activities
        .flat_map(|activity| {
            let reject = |answer, reason| {
                rejected(Family::Affordance, &activity.activity, Some(answer), reason)
            };
            [
                yes(context, activity).unwrap_or_else(|reason| reject(true, reason)),
                no(context, activity).unwrap_or_else(|reason| reject(false, reason)),
            ]
        })
        .collect()
}

/// Yes: the activity belongs to this type of room, and all objects of one of its enablers are evidence.
fn yes(context: &RuleContext<'_>, activity: &ActivityRule) -> Result<RuleResult, Reason> {
    let Some(room) = context.room else {
        return Err(Reason::NoRoom);
    };
    if !activity.rooms.contains(room) {
        return Err(Reason::OtherRoom);
    }
    let evidence: Vec<&Segment> = context.statistics.evidence(context.book).collect();
    let segment_of = |token: &String| {
        evidence
            .iter()
            .find(|segment| segment.token(context.book) == token)
    };
    let found = activity.enablers.iter().find_map(|tokens| {
        tokens
            .iter()
            .map(|token| segment_of(token).copied())
            .collect::<Option<Vec<&Segment>>>()
    });
    let Some(segments) = found else {
        return Err(Reason::Unseen);
    };
    Ok(candidate(context, activity, room, 0, &segments))
}

/// No: the room is known and of another type, and no object that the activity needs, or that could substitute one, has a
/// pixel.
fn no(context: &RuleContext<'_>, activity: &ActivityRule) -> Result<RuleResult, Reason> {
    let Some(room) = context.room else {
        return Err(Reason::NoRoom);
    };
    if activity.rooms.contains(room) {
        return Err(Reason::OtherRoom);
    }
    if let Some(reason) = context.absence_blocker() {
        return Err(reason);
    }
    let pinch = activity
        .pinch
        .iter()
        .filter(|_| context.book.affordance.strict);
    let tokens: Vec<&String> = activity.enablers.iter().flatten().chain(pinch).collect();
    if !tokens.iter().all(|token| context.expressible(token)) {
        return Err(Reason::Inexpressible);
    }
    if tokens
        .iter()
        .any(|token| context.statistics.shows(token, context.book))
    {
        return Err(Reason::Seen);
    }
    Ok(candidate(
        context,
        activity,
        room,
        1,
        &context.signs_of(room),
    ))
}

fn candidate(
    context: &RuleContext<'_>,
    activity: &ActivityRule,
    room: &str,
    truth: usize,
    segments: &[&Segment],
) -> RuleResult {
    let text = context
        .book
        .affordance
        .text
        .replace("{activity}", &activity.activity);
    let evidence = json!({
        "room": room,
        "scores": context.signs.scores,
        "suitable": activity.rooms,
    });
    context.viable(
        Candidate {
            family: Family::Affordance,
            about: activity.activity.clone(),
            text,
            choices: yes_no(),
            truth,
            evidence,
        },
        segments,
    )
}
