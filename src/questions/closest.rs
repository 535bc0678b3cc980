//! "Which object is closest to the camera?"

use serde_json::json;

use super::reason::Reason;
use super::rule_context::{Candidate, RuleContext, RuleResult, rejected};
use super::rules::{ClassFlag, GapScope, RuleBook};
use super::statistics::{Segment, SegmentDepth};
use darkqa_base::types::Family;

/// Returns the single candidate of a frame.
pub(super) fn candidates(context: &RuleContext<'_>) -> Vec<RuleResult> {
    let result = candidate(context);
    vec![result.unwrap_or_else(|reason| rejected(Family::Closest, "", None, reason))]
}

/// A segment with its depth.
#[derive(Debug, Clone, Copy)]
struct NearObject<'a> {
    segment: &'a Segment,
    depth: SegmentDepth,
}

fn candidate(context: &RuleContext<'_>) -> Result<RuleResult, Reason> {
    let (book, statistics) = (context.book, context.statistics);
    let depth = statistics.depth.as_ref().ok_or(Reason::NoDepth)?;
    let measure = &book.measure;
    if !(measure.least_median_depth_mm..=measure.most_median_depth_mm).contains(&depth.median) {
        return Err(Reason::Scale);
    }
    let lower = statistics.pixels() / 2;
    if statistics.lower_void * 1_000_000 > book.closest.lower_void_ppm * lower {
        return Err(Reason::Void);
    }
    let mut objects: Vec<NearObject<'_>> = statistics
        .evidence(book)
        .filter(|segment| is_eligible(context, segment))
        .filter_map(|segment| {
            let depth = segment.reliable_depth(book)?;
            Some(NearObject { segment, depth })
        })
        .collect();
    objects.sort_by_key(|object| (object.depth.median, object.segment.id));
    let [first, rest @ ..] = &objects[..] else {
        return Err(Reason::Few);
    };
    let second = match book.closest.gap_scope {
        GapScope::Instances => rest.first(),
        GapScope::Classes => rest.iter().find(|other| other.segment.class != first.segment.class),
    };
    let second = second.ok_or(Reason::Few)?;
    let mut classes = classes(&objects, book);
    if classes.len() < 2 {
        return Err(Reason::Few);
    }
    check_gap(context, &objects, *first, *second)?;
    check_rivals(context, &objects, first.depth.p10, second.depth.median)?;

    let winner = classes[0];
    classes.truncate(book.closest.choices);
    let about = winner.0.to_owned();
    context.picker.shuffle("closest", &mut classes);
    let truth = classes.iter().position(|class| *class == winner).unwrap_or(0);
    let choices = classes.iter().map(|(_, word)| (*word).to_owned()).collect();
    let segments: Vec<&Segment> = objects.iter().map(|object| object.segment).collect();
    Ok(context.viable(
        Candidate {
            family: Family::Closest,
            about,
            text: book.closest.text.clone(),
            choices,
            truth,
            evidence: json!({
                "gap_mm": second.depth.median - first.depth.median,
                "near_gap_mm": near_gap(&objects, *first),
                "along": depth.along,
            }),
        },
        &segments,
    ))
}

/// Returns the different classes, nearest first, each with the word of its nearest object.
fn classes<'a>(objects: &[NearObject<'a>], book: &'a RuleBook) -> Vec<(&'a str, &'a str)> {
    let mut classes: Vec<(&str, &str)> = Vec::new();
    for NearObject { segment, .. } in objects {
        let Some(word) = segment.question_word(book) else {
            continue;
        };
        if classes.iter().all(|(class, known)| *class != segment.class && *known != word) {
            classes.push((&segment.class, word));
        }
    }
    classes
}

/// True if a segment may be one of the choices.
fn is_eligible(context: &RuleContext<'_>, segment: &Segment) -> bool {
    let book = context.book;
    book.has_flag(&segment.class, ClassFlag::Asked)
        && !book.has_flag(&segment.class, ClassFlag::Structural)
        && !segment.is_flat(book)
        && segment.question_word(book).is_some()
        && context.statistics.area_ppm(segment) >= book.closest.area_ppm
}

/// Distance in mm from the first object's 10 % depth quantile to the smallest one of the others. `None` if another
/// object is nearer, or without other objects.
fn near_gap(objects: &[NearObject<'_>], first: NearObject<'_>) -> Option<u32> {
    let nearest =
        objects.iter().filter(|object| object.segment.id != first.segment.id).map(|object| object.depth.p10).min()?;
    nearest.checked_sub(first.depth.p10)
}

/// Checks that the first object is clearly nearer than the second, and that no other object's 10 % quantile is nearer.
fn check_gap(
    context: &RuleContext<'_>,
    objects: &[NearObject<'_>],
    first: NearObject<'_>,
    second: NearObject<'_>,
) -> Result<(), Reason> {
    let rule = &context.book.closest;
    let (near, far) = (u64::from(first.depth.median), u64::from(second.depth.median));
    let gap = far - near;
    if gap < rule.gap_mm.into() || gap * 1_000_000 < near * rule.gap_ppm {
        return Err(Reason::Gap);
    }
    let others: Vec<NearObject<'_>> = objects
        .iter()
        .filter(|other| rule.gap_scope == GapScope::Instances || other.segment.class != first.segment.class)
        .copied()
        .collect();
    match near_gap(&others, first) {
        None => Err(Reason::Disputed),
        Some(gap) if gap < rule.near_gap_mm => Err(Reason::Gap),
        Some(_) => Ok(()),
    }
}

fn is_background_class(book: &RuleBook, class: &str) -> bool {
    book.has_flag(class, ClassFlag::Structural) || book.has_flag(class, ClassFlag::Flat)
}

/// Checks the objects that are not among the choices: none may have a smaller median depth than `second`, or a smaller
/// 10 % quantile than `nearest`, both in millimetres.
fn check_rivals(
    context: &RuleContext<'_>,
    objects: &[NearObject<'_>],
    nearest: u32,
    second: u32,
) -> Result<(), Reason> {
    let (book, statistics) = (context.book, context.statistics);
    for segment in &statistics.segments {
        // A segment of several classes may be any object.
        let is_background =
            (is_background_class(book, &segment.class) || segment.is_flat(book)) && !segment.is_mixed(book);
        if is_background || objects.iter().any(|object| object.segment.id == segment.id) {
            continue;
        }
        let area = statistics.area_ppm(segment);
        match segment.reliable_depth(book) {
            None if area >= book.closest.unmeasured_ppm => return Err(Reason::Unmeasured),
            Some(depth) if area >= book.closest.rival_ppm && (depth.median < second || depth.p10 < nearest) => {
                return Err(Reason::Rival);
            }
            _ => {}
        }
    }
    let loose: u64 =
        statistics.loose.iter().filter(|(class, _)| !is_background_class(book, class)).map(|(_, pixels)| pixels).sum();
    if statistics.ppm(loose) >= book.closest.rival_ppm {
        return Err(Reason::Rival);
    }
    Ok(())
}
