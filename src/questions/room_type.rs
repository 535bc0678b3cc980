//! "What type of room is this?"

use serde_json::json;

use super::reason::Reason;
use super::rule_context::{Candidate, RuleContext, RuleResult, rejected};
use super::rules::ClassFlag;
use super::statistics::Segment;
use darkqa_base::types::Family;

/// Returns the single candidate of a frame.
pub(super) fn candidates(context: &RuleContext<'_>) -> Vec<RuleResult> {
    let (book, statistics) = (context.book, context.statistics);
    let rule = &book.room_type;
    let reject = |reason| vec![rejected(Family::RoomType, "", None, reason)];
    let Some(room) = context.room else {
        return reject(Reason::NoRoom);
    };
    if statistics.ppm(statistics.pixels() - statistics.void) < rule.labelled_ppm {
        return reject(Reason::Unlabelled);
    }
    let asked: Vec<&Segment> =
        statistics.evidence(book).filter(|segment| book.has_flag(&segment.class, ClassFlag::Asked)).collect();
    let has_large = asked.iter().any(|segment| statistics.area_ppm(segment) >= rule.large_ppm);
    if asked.len() < rule.least_asked && !has_large {
        return reject(Reason::Bare);
    }
    let rooms = &book.room.order;
    let Some(truth) = rooms.iter().position(|other| other == room) else {
        return reject(Reason::NoRoom);
    };
    let evidence = json!({ "scores": context.signs.scores });
    vec![context.viable(
        Candidate {
            family: Family::RoomType,
            about: String::new(),
            text: rule.text.clone(),
            choices: rooms.clone(),
            truth,
            evidence,
        },
        &context.room_evidence(room),
    )]
}
