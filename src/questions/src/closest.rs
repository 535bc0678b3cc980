//! "Which object is closest to the camera?"

use serde_json::json;

use super::reason::Reason;
use super::rule_context::{Candidate, RuleContext, RuleResult, rejected};
use super::rules::{ClassFlag, GapScope, RuleBook};
use super::statistics::{Segment, SegmentDepth};
use darkqa_ground::types::Family;

/// The single candidate of a frame.
pub(super) fn candidates(context: &RuleContext<'_>) -> Vec<RuleResult> {
    let result = candidate(context);
    vec![result.unwrap_or_else(|reason| rejected(Family::Closest, "", None, reason))]
}

type NearObject<'a> = (&'a Segment, SegmentDepth);

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
        .filter(|segment| eligible(context, segment))
        .filter_map(|segment| Some((segment, segment.reliable_depth(book)?)))
        .collect();
    objects.sort_by_key(|(segment, depth)| (depth.median, segment.id));
    let [first, rest @ ..] = &objects[..] else {
        return Err(Reason::Few);
    };
    let second = match book.closest.gap_scope {
        GapScope::Instances => rest.first(),
        GapScope::Classes => rest.iter().find(|(other, _)| other.class != first.0.class),
    };
    let second = second.ok_or(Reason::Few)?;
    let mut classes = classes(&objects, book);
    if classes.len() < 2 {
        return Err(Reason::Few);
    }
    check_gap(context, &objects, *first, *second)?;
    check_rivals(context, &objects, first.1.p10, second.1.median)?;

    let winner = classes[0];
    classes.truncate(book.closest.choices);
    let about = winner.0.to_owned();
    context.picker.shuffle("closest", &mut classes);
    let truth = classes
        .iter()
        .position(|class| *class == winner)
        .unwrap_or(0);
    let choices = classes.iter().map(|(_, word)| (*word).to_owned()).collect();
    let segments: Vec<&Segment> = objects.iter().map(|(segment, _)| *segment).collect();
    Ok(context.viable(
        Candidate {
            family: Family::Closest,
            about,
            text: book.closest.text.clone(),
            choices,
            truth,
            evidence: json!({
                "gap_mm": second.1.median - first.1.median,
                "near_gap_mm": near_gap(&objects, *first),
                "along": depth.along,
            }),
        },
        &segments,
    ))
}

/// The different classes, nearest first, each with the word of its nearest object.
fn classes<'a>(objects: &[NearObject<'a>], book: &'a RuleBook) -> Vec<(&'a str, &'a str)> {
    let mut classes: Vec<(&str, &str)> = Vec::new();
    for (segment, _) in objects {
        let Some(word) = segment.question_word(book) else {
            continue;
        };
        if classes
            .iter()
            .all(|(class, known)| *class != segment.class && *known != word)
        {
            classes.push((&segment.class, word));
        }
    }
    classes
}

/// Whether a segment may be offered.
fn eligible(context: &RuleContext<'_>, segment: &Segment) -> bool {
    let book = context.book;
    book.has_flag(&segment.class, ClassFlag::Asked)
        && !book.has_flag(&segment.class, ClassFlag::Structural)
        && !segment.is_flat(book)
        && segment.question_word(book).is_some()
        && context.statistics.area_ppm(segment) >= book.closest.area_ppm
}

/// The distance in mm from the first object's 10 % depth quantile to the smallest one of the others. `None` if another is
/// nearer or there is none.
fn near_gap(objects: &[NearObject<'_>], first: NearObject<'_>) -> Option<u32> {
    let nearest = objects
        .iter()
        .filter(|(segment, _)| segment.id != first.0.id)
        .map(|(_, depth)| depth.p10)
        .min()?;
    nearest.checked_sub(first.1.p10)
}

/// Checks that the first object is clearly nearer than the second, and that no other object's 10 % quantile is nearer.
fn check_gap(
    context: &RuleContext<'_>,
    objects: &[NearObject<'_>],
    first: NearObject<'_>,
    second: NearObject<'_>,
) -> Result<(), Reason> {
    let rule = &context.book.closest;
    let (near, far) = (u64::from(first.1.median), u64::from(second.1.median));
    let gap = far - near;
    if gap < rule.gap_mm.into() || gap * 1_000_000 < near * rule.gap_ppm {
        return Err(Reason::Gap);
    }
    let others: Vec<NearObject<'_>> = objects
        .iter()
        .filter(|other| rule.gap_scope == GapScope::Instances || other.0.class != first.0.class)
        .copied()
        .collect();
    match near_gap(&others, first) {
        None => Err(Reason::Disputed),
        Some(gap) if gap < rule.near_gap_mm => Err(Reason::Gap),
        Some(_) => Ok(()),
    }
}

/// Checks the objects that are not offered: none may be nearer than the second, or have a 10 % quantile nearer than the
/// first's.
fn check_rivals(
    context: &RuleContext<'_>,
    objects: &[NearObject<'_>],
    nearest: u32,
    second: u32,
) -> Result<(), Reason> {
    let (book, statistics) = (context.book, context.statistics);
    let background_class = |class: &str| {
        book.has_flag(class, ClassFlag::Structural) || book.has_flag(class, ClassFlag::Flat)
    };
    for segment in &statistics.segments {
        // A segment of several classes may be any object.
        let background =
            (background_class(&segment.class) || segment.is_flat(book)) && !segment.is_mixed(book);
        if background || objects.iter().any(|(object, _)| object.id == segment.id) {
            continue;
        }
        let area = statistics.area_ppm(segment);
        match segment.reliable_depth(book) {
            None if area >= book.closest.unmeasured_ppm => return Err(Reason::Unmeasured),
            Some(depth)
                if area >= book.closest.rival_ppm
                    && (depth.median < second || depth.p10 < nearest) =>
            {
                return Err(Reason::Rival);
            }
            _ => {}
        }
    }
    let loose: u64 = statistics
        .loose
        .iter()
        .filter(|(class, _)| !background_class(class))
        .map(|(_, pixels)| pixels)
        .sum();
    if statistics.ppm(loose) >= book.closest.rival_ppm {
        return Err(Reason::Rival);
    }
    Ok(())
}
