//! "I want to sleep, is this room suitable for this?"

use serde_json::json;

use super::reason::Reason;
use super::rules::Activity;
use super::statistics::Segment;
use super::survey::{Claim, Survey, Verdict, falls, yes_no};
use crate::types::Family;

/// Both answers for every activity.
pub(super) fn candidates(survey: &Survey<'_>) -> Vec<Verdict> {
    let activities = survey.book.activity.iter();
    activities
        .flat_map(|activity| [(true, yes(survey, activity)), (false, no(survey, activity))])
        .map(|(yes, verdict)| {
            verdict.unwrap_or_else(|(reason, about)| {
                falls(Family::Affordance, &about, Some(yes), reason)
            })
        })
        .collect()
}

type Found = Result<Verdict, (Reason, String)>;

/// Yes: the room is one where it is done, and what it takes is well seen.
fn yes(survey: &Survey<'_>, activity: &Activity) -> Found {
    let fall = |reason| Err((reason, activity.activity.clone()));
    let Some(room) = survey.room else {
        return fall(Reason::NoRoom);
    };
    if !activity.rooms.contains(room) {
        return fall(Reason::OtherRoom);
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
        return fall(Reason::Unseen);
    };
    Ok(claim(survey, activity, room, 0, &segments))
}

/// No: the room is known and no such room, and nothing that it takes, or that would do, has a pixel.
fn no(survey: &Survey<'_>, activity: &Activity) -> Found {
    let fall = |reason| Err((reason, activity.activity.clone()));
    let Some(room) = survey.room else {
        return fall(Reason::NoRoom);
    };
    if activity.rooms.contains(room) {
        return fall(Reason::OtherRoom);
    }
    if let Some(reason) = survey.open_world() {
        return fall(reason);
    }
    let pinch = activity
        .pinch
        .iter()
        .filter(|_| survey.book.affordance.strict);
    let tokens: Vec<&String> = activity.enablers.iter().flatten().chain(pinch).collect();
    if !tokens.iter().all(|token| survey.expressible(token)) {
        return fall(Reason::Inexpressible);
    }
    if tokens
        .iter()
        .any(|token| survey.statistics.shows(token, survey.book))
    {
        return fall(Reason::Seen);
    }
    let signs = survey
        .signs
        .segments
        .get(room)
        .map_or(&[][..], Vec::as_slice);
    let segments = survey.statistics.segments.iter();
    let segments: Vec<&Segment> = segments
        .filter(|segment| signs.contains(&segment.id))
        .collect();
    Ok(claim(survey, activity, room, 1, &segments))
}

fn claim(
    survey: &Survey<'_>,
    activity: &Activity,
    room: &str,
    truth: usize,
    segments: &[&Segment],
) -> Verdict {
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
        Claim {
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
