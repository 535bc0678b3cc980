//! Sample of the items for the page of a large run: [`sample`].

use std::collections::BTreeMap;

use crate::types::{AxisLevel, Digest, Family};
use darkqa_score::choice::ParsingMode;
use darkqa_score::grid::Grid;
use darkqa_score::model_in_condition::ModelInCondition;

/// Maximum number of replies on a page (chosen): they fit on a page of 12 MB, and a browser loads them in two seconds.
const MAX_REPLIES: usize = 200_000;

/// Strongest effect of darkness and enhancement on the answers to an item, over all models. The variants are in order
/// of precedence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum AnswerChange {
    /// Right in the dark, and wrong after an enhancer.
    Harmed,
    /// Wrong in the dark, and right after an enhancer.
    Rescued,
    /// Right at L0, and wrong in the dark.
    Lost,
    /// None of these changes.
    Stable,
}

/// Maximum number of items on the page.
fn max_items(grid: &Grid<'_>) -> usize {
    MAX_REPLIES / grid.subjects.len().max(1)
}

/// Draws a sample of the items; `None` if all of them fit on the page. The strata of family and answer change have
/// equal shares; small strata are kept in full. The sample depends only on the names of the questions.
pub(super) fn sample<'a>(grid: &Grid<'a>) -> Option<Grid<'a>> {
    let max = max_items(grid);
    (grid.items.len() > max).then(|| grid.select_items(&selection(grid, max)))
}

/// Note that the page has only a sample of the items; `None` if it has all.
pub(super) fn note(grid: &Grid<'_>) -> Option<String> {
    let (all, max) = (grid.items.len(), max_items(grid));
    (all > max).then(|| {
        format!(
            "All numbers are of all {all} items. The list of items has {max} of them, drawn by family and by what darkness and enhancement \
             did to them; records.jsonl has all, and `darkqa-eval show` shows any."
        )
    })
}

/// Selects `max` items; true for each selected item.
fn selection(grid: &Grid<'_>, max: usize) -> Vec<bool> {
    let changes = answer_changes(grid);
    let mut strata = BTreeMap::<(&Family, AnswerChange), Vec<(Digest, usize)>>::new();
    for (index, (item, change)) in grid.items.iter().zip(changes).enumerate() {
        let name = format!("{} {}", item.asked.question, item.asked.repeat);
        // Sorting by digest draws items at random, but reproducibly.
        let draw = (Digest::from_bytes(name.as_bytes()), index);
        strata.entry((&item.asked.family, change)).or_default().push(draw);
    }
    for draws in strata.values_mut() {
        draws.sort_unstable();
    }
    let mut selected = vec![false; grid.items.len()];
    let mut items_left = max;
    let mut strata: Vec<Vec<(Digest, usize)>> = strata.into_values().collect();
    // The smallest strata come first; the part of their share that they do not need goes to the others.
    strata.sort_by_key(Vec::len);
    let mut strata_left = strata.len();
    for draws in strata {
        let share = items_left.div_ceil(strata_left).min(draws.len()).min(items_left);
        for (_, index) in &draws[..share] {
            selected[*index] = true;
        }
        items_left -= share;
        strata_left -= 1;
    }
    selected
}

/// Change of the answers to each item.
fn answer_changes(grid: &Grid<'_>) -> Vec<AnswerChange> {
    let mut changes = vec![AnswerChange::Stable; grid.items.len()];
    for (subject, condition) in grid.subjects.iter().enumerate() {
        let is_clean = condition.level == Some(AxisLevel::L0) && condition.enhancer.is_none();
        if condition.level.is_none() || is_clean {
            continue;
        }
        let mut base = condition.clone();
        let [if_lost, if_gained] = if base.enhancer.take().is_some() {
            [AnswerChange::Harmed, AnswerChange::Rescued]
        } else {
            base = ModelInCondition::with_images(&condition.model, AxisLevel::L0, &condition.variant, None);
            [AnswerChange::Lost, AnswerChange::Stable]
        };
        let Some(base) = grid.find_up_to_group(&base) else {
            continue;
        };
        for (item, change) in changes.iter_mut().enumerate() {
            match [base, subject].map(|subject| is_right(grid, subject, item)) {
                [Some(true), Some(false)] => *change = (*change).min(if_lost),
                [Some(false), Some(true)] => *change = (*change).min(if_gained),
                _ => {}
            }
        }
    }
    changes
}

/// True if a reply is right by strict parsing; `None` without a reply.
fn is_right(grid: &Grid<'_>, subject: usize, item: usize) -> Option<bool> {
    let answer = grid.result(subject, item).reading(ParsingMode::Strict)?;
    Some(grid.items[item].is_right(answer))
}
