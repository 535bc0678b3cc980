//! Sentences about people, and about models that answered fewer questions than others. Neither are part of any mean.

use std::collections::BTreeSet;

use super::lights::Topic;
use super::sentence::{Numbers, Sentence, Tone, capitalised};
use crate::text::words::light;
use crate::types::{AxisLevel, UnreadReason, Variant, View};
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::pool;
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::grid::Grid;
use darkqa_score::model_in_condition::{ModelInCondition, is_reference};

/// A sentence for each of them: the accuracy at L0 and at the darkest level, and that of the other models on the same questions.
pub(super) fn apart(findings: &Findings<'_>) -> Vec<Sentence> {
    let others = others(findings);
    if others.is_empty() {
        return Vec::new();
    }
    let topics = Topic::all(findings);
    names(findings)
        .into_iter()
        .filter_map(|name| {
            topics
                .iter()
                .flat_map(|topic| &topic.lights)
                .find_map(|variant| sentence(findings, name, &others, variant))
        })
        .collect()
}

/// The names of people, and of models that a finding leaves out, in the order of tables.
fn names<'f>(findings: &'f Findings<'_>) -> Vec<&'f str> {
    let left_out: BTreeSet<&str> = findings
        .left_out
        .iter()
        .filter(|set| !set.is_more)
        .flat_map(|set| &set.models)
        .map(String::as_str)
        .collect();
    let listing = &findings.grid.listing;
    let mut names: Vec<&str> = findings
        .grid
        .subjects
        .iter()
        .filter(|subject| subject.view == Some(View::Image))
        .map(|subject| &*subject.model)
        .filter(|name| listing.is_people(name) || left_out.contains(name))
        .collect();
    names.dedup();
    names
}

/// The models that means include.
fn others<'f>(findings: &'f Findings<'_>) -> Vec<&'f str> {
    let apart = names(findings);
    pool(&findings.grid)
        .into_iter()
        .filter(|model| !apart.contains(model) && !is_reference(model))
        .collect()
}

/// The accuracy of a subject, and of others on the same questions.
struct OnSameQuestions {
    level: AxisLevel,
    own: Estimate,
    /// Mean of the models that answered some of the questions; `None` if none did.
    others: Option<f64>,
    /// Number of "cannot tell" replies.
    cannot_tell: usize,
}

impl OnSameQuestions {
    fn new(
        findings: &Findings<'_>,
        name: &str,
        others: &[&str],
        level: AxisLevel,
        variant: &Variant,
    ) -> Option<Self> {
        let grid = &findings.grid;
        let find = |model: &str| {
            grid.find_up_to_group(&ModelInCondition::with_images(model, level, variant, None))
        };
        let own = find(name)?;
        let cell = findings
            .summary
            .cell(&grid.subjects[own], None, ParsingMode::Strict)?;
        let answered: Vec<usize> = (0..grid.items.len())
            .filter(|item| grid.result(own, *item).is_reply())
            .collect();
        let shares: Vec<f64> = others
            .iter()
            .filter_map(|model| accuracy(grid, find(model)?, &answered))
            .collect();
        let cannot_tell = answered
            .iter()
            .filter_map(|item| grid.trial(own, *item)?.strict()?.why)
            .filter(|why| *why == UnreadReason::CannotTell);
        Some(Self {
            level,
            own: cell.accuracy?,
            others: (!shares.is_empty()).then(|| shares.iter().sum::<f64>() / shares.len() as f64),
            cannot_tell: cannot_tell.count(),
        })
    }
}

/// Share of right replies of a subject to the questions of some items; `None` without a reply. The same question may be asked several
/// times, and of different people.
fn accuracy(grid: &Grid<'_>, subject: usize, items: &[usize]) -> Option<f64> {
    let asked: BTreeSet<_> = items
        .iter()
        .map(|item| &grid.items[*item].asked.question)
        .collect();
    let (mut right, mut replies) = (0, 0);
    for (index, item) in grid.items.iter().enumerate() {
        let reading = grid.result(subject, index).reading(ParsingMode::Strict);
        if let (Some(chosen), true) = (reading, asked.contains(&item.asked.question)) {
            replies += 1;
            right += usize::from(item.is_right(chosen));
        }
    }
    (replies > 0).then(|| f64::from(right as u32) / replies as f64)
}

/// The sentence about a variant; `None` if the subject answered nothing there.
fn sentence(
    findings: &Findings<'_>,
    name: &str,
    others: &[&str],
    variant: &Variant,
) -> Option<Sentence> {
    let grid = &findings.grid;
    let darkest = grid
        .subjects
        .iter()
        .filter(|subject| {
            subject.model == name && subject.variant == *variant && subject.enhancer.is_none()
        })
        .filter_map(|subject| subject.level)
        .max();
    let found: Vec<OnSameQuestions> = [Some(AxisLevel::L0), darkest]
        .into_iter()
        .flatten()
        .filter_map(|level| OnSameQuestions::new(findings, name, others, level, variant))
        .collect();
    if found.is_empty() {
        return None;
    }
    let mut numbers = Numbers::new(findings.unit);
    let (mut own, mut other_shares, mut details) = (Vec::new(), Vec::new(), Vec::new());
    for same in &found {
        let level = same.level;
        let percent = numbers.percent(&format!("{level}"), same.own.value);
        own.push(format!("{percent} % at {level}"));
        if let Some(others) = same.others {
            let percent = numbers.percent(&format!("others {level}"), others);
            other_shares.push(format!("{percent} %"));
        }
        let low = numbers.percent(&format!("low {level}"), same.own.low);
        let high = numbers.percent(&format!("high {level}"), same.own.high);
        let n = numbers.count(&format!("n {level}"), same.own.n);
        let cannot_tell = match same.cannot_tell {
            0 => String::new(),
            count => format!(
                ", {} “I cannot tell”",
                numbers.count(&format!("cannot tell {level}"), count)
            ),
        };
        details.push(format!("{level} [{low}, {high}], n = {n}{cannot_tell}"));
    }
    let is_dark = found.iter().any(|same| same.level != AxisLevel::L0);
    let place = if is_dark {
        format!("{}, ", light(variant, None))
    } else {
        String::new()
    };
    let who = match others {
        [one] => (*one).to_owned(),
        several => format!(
            "the mean of {} models",
            numbers.count("models", several.len())
        ),
    };
    let comparison = match &*other_shares {
        [] => String::new(),
        shares => format!("; {who}: {} on the same questions", shares.join(" and ")),
    };
    let text = format!(
        "{}{name}: {}{comparison}.",
        capitalised(&place),
        own.join(", ")
    );
    let people = if grid.listing.is_people(name) {
        "people; "
    } else {
        ""
    };
    let detail = format!("{people}{}; in no mean", details.join("; "));
    Some(numbers.sentence("apart", Tone::Note, text, detail))
}
