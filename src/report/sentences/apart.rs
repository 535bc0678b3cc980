//! Sentences about subjects that are excluded from the means about darkness: people, and models that answered fewer
//! questions than others.

use std::collections::BTreeSet;

use super::lights::Topic;
use super::sample::topic_in_light;
use super::sentence::{Numbers, Sentence, Tone, capitalised};
use crate::report::text::words::light;
use crate::types::{AxisLevel, UnreadReason, Variant, View};
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::{PooledKind, pool};
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::grid::Grid;
use darkqa_score::model_in_condition::{ModelInCondition, is_reference};

/// One sentence for each person, and for each model excluded from the mean cost of darkness in a light: its accuracy at
/// L0 and at the darkest level, and the mean accuracy of the other models on the same questions.
pub(super) fn apart(findings: &Findings<'_>) -> Vec<Sentence> {
    let topics = Topic::all(findings);
    let mut names: Vec<&str> = findings
        .grid
        .subjects
        .iter()
        .filter(|subject| subject.view == Some(View::Image))
        .map(|subject| &*subject.model)
        .collect();
    names.dedup();
    names
        .into_iter()
        .filter_map(|name| {
            topics
                .iter()
                .flat_map(|topic| &topic.lights)
                .filter(|variant| is_excluded(findings, name, variant))
                .find_map(|variant| sentence(findings, name, variant))
        })
        .collect()
}

/// True for people, and for models that the mean cost of darkness with a variant leaves out.
fn is_excluded(findings: &Findings<'_>, name: &str, variant: &Variant) -> bool {
    findings.grid.listing.is_people(name)
        || findings.left_out.iter().any(|set| {
            set.kind == PooledKind::Darkness
                && set.variant == *variant
                && !set.is_more
                && set.models.iter().any(|model| model == name)
        })
}

/// Models that the mean cost of darkness with a variant includes.
fn models_in_mean<'f>(findings: &'f Findings<'_>, variant: &Variant) -> Vec<&'f str> {
    pool(&findings.grid)
        .into_iter()
        .filter(|model| !is_excluded(findings, model, variant) && !is_reference(model))
        .collect()
}

/// Accuracies of a subject and of other models on the same questions, at one level.
struct SameQuestionAccuracy {
    level: AxisLevel,
    /// Accuracy of the subject.
    own: Estimate,
    /// Mean accuracy of the other models that answered any of the questions; `None` if none did.
    others: Option<f64>,
    /// Number of the subject's "cannot tell" replies.
    cannot_tell: usize,
    /// Number of the subject's missing replies, with its accuracy if all of them were wrong, and if all were right;
    /// `None` without any.
    missing: Option<(usize, [f64; 2])>,
}

impl SameQuestionAccuracy {
    fn new(findings: &Findings<'_>, name: &str, others: &[&str], level: AxisLevel, variant: &Variant) -> Option<Self> {
        let grid = &findings.grid;
        let find = |model: &str| grid.find_up_to_group(&ModelInCondition::with_images(model, level, variant, None));
        let subject = find(name)?;
        let cell = findings.summary.cell(&grid.subjects[subject], None, ParsingMode::Strict)?;
        let answered: Vec<usize> =
            (0..grid.items.len()).filter(|item| grid.result(subject, *item).is_reply()).collect();
        let other_accuracies: Vec<f64> =
            others.iter().filter_map(|model| accuracy(grid, find(model)?, &answered)).collect();
        let cannot_tell = answered
            .iter()
            .filter_map(|item| grid.trial(subject, *item)?.strict()?.why)
            .filter(|why| *why == UnreadReason::CannotTell)
            .count();
        Some(Self {
            level,
            own: cell.accuracy?,
            others: (!other_accuracies.is_empty())
                .then(|| other_accuracies.iter().sum::<f64>() / other_accuracies.len() as f64),
            cannot_tell,
            missing: cell.bounds().map(|bounds| (cell.failed, bounds)),
        })
    }
}

/// Share of right replies of a subject to the questions of `items`; `None` without a reply. Several items may share a
/// question, for instance one item for each person, so items are matched by question.
fn accuracy(grid: &Grid<'_>, subject: usize, items: &[usize]) -> Option<f64> {
    let asked: BTreeSet<_> = items.iter().map(|item| &grid.items[*item].asked.question).collect();
    let (mut right, mut replies) = (0, 0);
    for (index, item) in grid.items.iter().enumerate() {
        let reading = grid.result(subject, index).reading(ParsingMode::Strict);
        if let (Some(chosen), true) = (reading, asked.contains(&item.asked.question)) {
            replies += 1;
            right += usize::from(item.is_right(chosen));
        }
    }
    (replies > 0).then(|| right as f64 / replies as f64)
}

/// Sentence about a subject at L0 and at the darkest level of a variant; `None` if it answered at neither, or without
/// other models.
fn sentence(findings: &Findings<'_>, name: &str, variant: &Variant) -> Option<Sentence> {
    let grid = &findings.grid;
    let others = models_in_mean(findings, variant);
    if others.is_empty() {
        return None;
    }
    let darkest = grid
        .subjects
        .iter()
        .filter(|subject| subject.model == name && subject.variant == *variant && subject.enhancer.is_none())
        .filter_map(|subject| subject.level)
        .max();
    let accuracies: Vec<SameQuestionAccuracy> = [Some(AxisLevel::L0), darkest]
        .into_iter()
        .flatten()
        .filter_map(|level| SameQuestionAccuracy::new(findings, name, &others, level, variant))
        .collect();
    if accuracies.is_empty() {
        return None;
    }
    let mut numbers = Numbers::new(findings.unit);
    let (mut own_shares, mut other_shares, mut details) = (Vec::new(), Vec::new(), Vec::new());
    for accuracy in &accuracies {
        let level = accuracy.level;
        let percent = numbers.percent(&format!("{level}"), accuracy.own.value);
        let missing = accuracy.missing.map_or_else(String::new, |(count, bounds)| {
            let low = numbers.percent(&format!("if wrong {level}"), bounds[0]);
            let high = numbers.percent(&format!("if right {level}"), bounds[1]);
            let count = numbers.count(&format!("missing {level}"), count);
            format!(" of its replies ({low} to {high} % with the {count} missing ones)")
        });
        own_shares.push(format!("{percent} %{missing} at {level}"));
        if let Some(others) = accuracy.others {
            let percent = numbers.percent(&format!("others {level}"), others);
            other_shares.push(format!("{percent} %"));
        }
        let low = numbers.percent(&format!("low {level}"), accuracy.own.low);
        let high = numbers.percent(&format!("high {level}"), accuracy.own.high);
        let n = numbers.count(&format!("n {level}"), accuracy.own.n);
        let cannot_tell = match accuracy.cannot_tell {
            0 => String::new(),
            count => format!(", {} “I cannot tell”", numbers.count(&format!("cannot tell {level}"), count)),
        };
        details.push(format!("{level} [{low}, {high}], n = {n}{cannot_tell}"));
    }
    let is_dark = accuracies.iter().any(|accuracy| accuracy.level != AxisLevel::L0);
    let place = if is_dark { format!("{}, ", light(variant, None)) } else { String::new() };
    let who = match &others[..] {
        [one] => (*one).to_owned(),
        several => format!("the mean of {} models", numbers.count("models", several.len())),
    };
    let comparison = match &*other_shares {
        [] => String::new(),
        shares => format!("; {who}: {} on the same questions", shares.join(" and ")),
    };
    let text = format!("{}{name}: {}{comparison}.", capitalised(&place), own_shares.join(", "));
    let details = details.join("; ");
    let detail = if grid.listing.is_people(name) {
        format!("people; {details}; in no mean")
    } else {
        let topic = topic_in_light(PooledKind::Darkness, variant, None);
        format!("{details}; in no mean about {topic}")
    };
    Some(numbers.sentence("apart", Tone::Note, text, detail))
}
