//! "What type of room is this?"

use serde_json::json;

use super::reason::Reason;
use super::rule_context::{Candidate, RuleContext, RuleResult, falls};
use super::rules::ClassFlag;
use super::statistics::Segment;
use crate::types::Family;

/// The one candidate of a frame.
pub(super) fn candidates(survey: &RuleContext<'_>) -> Vec<RuleResult> {
    let (book, statistics) = (survey.book, survey.statistics);
    let rule = &book.room_type;
    let fall = |reason| vec![falls(Family::RoomType, "", None, reason)];
    let Some(room) = survey.room else {
        return fall(Reason::NoRoom);
    };
    if statistics.ppm(statistics.pixels() - statistics.void) < rule.labelled_ppm {
        return fall(Reason::Unlabelled);
    }
    let asked: Vec<&Segment> = statistics
        .evidence(book)
        .filter(|segment| book.is(&segment.class, ClassFlag::Asked))
        .collect();
    let large = asked
        .iter()
        .any(|segment| statistics.area(segment) >= rule.large_ppm);
    if asked.len() < rule.least_asked && !large {
        return fall(Reason::Bare);
    }
    let rooms = &book.room.order;
    let Some(truth) = rooms.iter().position(|other| other == room) else {
        return fall(Reason::NoRoom);
    };
    let more = json!({ "scores": survey.signs.scores });
    vec![survey.rests(
        Candidate {
            family: Family::RoomType,
            about: String::new(),
            text: rule.text.clone(),
            choices: rooms.clone(),
            truth,
            evidence: more,
        },
        &survey.signs_of(room),
    )]
}
