//! "I want to sleep, is this room suitable for this?"

use serde_json::json;

use super::reason::Reason;
use super::rule_context::{Candidate, RuleContext, RuleResult, rejected, yes_no};
use super::rules::ActivityRule;
use super::statistics::Segment;
use darkqa_base::types::Family;

/// Returns two candidates for every activity: yes and no.
pub(super) fn candidates(context: &RuleContext<'_>) -> Vec<RuleResult> {
    context
        .book
        .activity
        .iter()
        .flat_map(|activity| {
            [(true, suitable(context, activity)), (false, unsuitable(context, activity))].map(|(answer, result)| {
                result.unwrap_or_else(|reason| rejected(Family::Affordance, &activity.activity, Some(answer), reason))
            })
        })
        .collect()
}

/// Candidate with the answer yes: the activity belongs to this type of room, and all objects of one of its enablers are
/// evidence.
fn suitable(context: &RuleContext<'_>, activity: &ActivityRule) -> Result<RuleResult, Reason> {
    let Some(room) = context.any_room else {
        return Err(Reason::NoRoom);
    };
    if !activity.rooms.contains(room) {
        return Err(Reason::OtherRoom);
    }
    if !can_be_enabled(context, activity) {
        return Err(Reason::Inexpressible);
    }
    let evidence: Vec<&Segment> = context.statistics.evidence(context.book).collect();
    let found = activity.enablers.iter().find_map(|tokens| {
        tokens
            .iter()
            .map(|token| {
                evidence
                    .iter()
                    .copied()
                    .find(|segment| segment.token(context.book) == token && is_typical(context, segment))
            })
            .collect::<Option<Vec<&Segment>>>()
    });
    let Some(segments) = found else {
        return Err(Reason::Unseen);
    };
    Ok(candidate(context, activity, room, 0, &segments))
}

/// True if the data set has words for all objects of one enabler. Otherwise, "no" would be the answer to every question
/// about the activity.
fn can_be_enabled(context: &RuleContext<'_>, activity: &ActivityRule) -> bool {
    activity.enablers.iter().any(|tokens| tokens.iter().all(|token| context.vocabulary.has_token(token)))
}

/// True if a segment is a typical member of its class: it has a token of its own, or questions use its word.
/// Counterexample: the sofa of a coarse label space may be an armchair.
fn is_typical(context: &RuleContext<'_>, segment: &Segment) -> bool {
    segment.token(context.book) != segment.class || segment.question_word(context.book).is_some()
}

/// Candidate with the answer no: the room is of another, known type, and no object that the activity needs, or a
/// substitute for one, has a pixel.
fn unsuitable(context: &RuleContext<'_>, activity: &ActivityRule) -> Result<RuleResult, Reason> {
    let Some(room) = context.room else {
        return Err(Reason::NoRoom);
    };
    if activity.rooms.contains(room) {
        return Err(Reason::OtherRoom);
    }
    if !can_be_enabled(context, activity) {
        return Err(Reason::Inexpressible);
    }
    if let Some(reason) = context.absence_blocker() {
        return Err(reason);
    }
    let mut tokens: Vec<&String> = activity.enablers.iter().flatten().collect();
    if context.book.affordance.strict {
        tokens.extend(&activity.pinch);
    }
    if !tokens.iter().all(|token| context.is_expressible(token)) {
        return Err(Reason::Inexpressible);
    }
    if tokens.iter().any(|token| context.may_be_hidden(token)) {
        return Err(Reason::Hidden);
    }
    if tokens.iter().any(|token| context.statistics.has_token(token, context.book)) {
        return Err(Reason::Seen);
    }
    Ok(candidate(context, activity, room, 1, &context.room_evidence(room)))
}

fn candidate(
    context: &RuleContext<'_>,
    activity: &ActivityRule,
    room: &str,
    truth: usize,
    segments: &[&Segment],
) -> RuleResult {
    let text = context.book.affordance.text.replace("{activity}", &activity.activity);
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
