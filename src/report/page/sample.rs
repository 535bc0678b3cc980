//! The items that the page of a large run shows: [`sample`].

use std::collections::BTreeMap;

use crate::types::{AxisLevel, Digest, Family};
use darkqa_score::choice::ReadingMode;
use darkqa_score::grid::Grid;

/// The most replies that a page shows. Chosen: as many have room on a page of 12 MB, and are read in two seconds.
const MOST_REPLIES: usize = 200_000;

/// The effect of darkness and enhancement on an item, for any model; of several the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Fate {
    /// Right in the dark, and wrong after an enhancer.
    Harmed,
    /// Wrong in the dark, and right after an enhancer.
    Rescued,
    /// Right at L0, and wrong in the dark.
    Lost,
    /// Nothing of it.
    Stable,
}

/// The items that a page has room for, if not all: as many of each family and fate as there are, but that rare ones are all shown. The
/// choice depends on the names of the questions alone.
pub(super) fn sample<'a>(grid: &Grid<'a>) -> Option<Grid<'a>> {
    let most = MOST_REPLIES / grid.subjects.len().max(1);
    (grid.items.len() > most).then(|| grid.select_items(&chosen(grid, most)))
}

/// The remark that the page shows a sample of its items; `None` if it shows all.
pub(super) fn words(grid: &Grid<'_>) -> Option<String> {
    let (all, most) = (grid.items.len(), MOST_REPLIES / grid.subjects.len().max(1));
    (all > most).then(|| {
        format!(
            "All numbers are of all {all} items. The list of items has {most} of them, drawn by family and by what darkness and enhancement \
             did to them; records.jsonl has all, and `darkqa-eval show` shows any."
        )
    })
}

/// Which items are shown; `most` of them.
fn chosen(grid: &Grid<'_>, most: usize) -> Vec<bool> {
    let fates = fates(grid);
    let mut strata = BTreeMap::<(&Family, Fate), Vec<(Digest, usize)>>::new();
    for (place, (item, fate)) in grid.items.iter().zip(fates).enumerate() {
        let name = format!("{} {}", item.asked.question, item.asked.repeat);
        let draw = (Digest::from_bytes(name.as_bytes()), place);
        strata
            .entry((&item.asked.family, fate))
            .or_default()
            .push(draw);
    }
    for draws in strata.values_mut() {
        draws.sort_unstable();
    }
    let mut kept = vec![false; grid.items.len()];
    let mut left = most;
    let mut strata: Vec<Vec<(Digest, usize)>> = strata.into_values().collect();
    // The smallest strata first, so that what they leave goes to the others.
    strata.sort_by_key(Vec::len);
    let mut strata_left = strata.len();
    for draws in strata {
        let share = left.div_ceil(strata_left).min(draws.len()).min(left);
        for (_, place) in &draws[..share] {
            kept[*place] = true;
        }
        left -= share;
        strata_left -= 1;
    }
    kept
}

/// The fate of each item.
fn fates(grid: &Grid<'_>) -> Vec<Fate> {
    let mut fates = vec![Fate::Stable; grid.items.len()];
    for (subject, of) in grid.subjects.iter().enumerate() {
        if of.level.is_none() || (of.level == Some(AxisLevel::L0) && of.enhancer.is_none()) {
            continue;
        }
        let mut base = of.clone();
        let fate = if base.enhancer.take().is_some() {
            [Fate::Harmed, Fate::Rescued]
        } else {
            base = darkqa_score::model_in_condition::ModelInCondition::with_images(
                &of.model,
                AxisLevel::L0,
                &of.variant,
                None,
            );
            [Fate::Lost, Fate::Stable]
        };
        let Some(base) = grid.find_up_to_group(&base) else {
            continue;
        };
        for (item, known) in fates.iter_mut().enumerate() {
            let right = |subject: usize| {
                let reading = grid.result(subject, item).reading(ReadingMode::Strict)?;
                Some(grid.items[item].is_right(reading))
            };
            match (right(base), right(subject)) {
                (Some(true), Some(false)) => *known = (*known).min(fate[0]),
                (Some(false), Some(true)) => *known = (*known).min(fate[1]),
                _ => {}
            }
        }
    }
    fates
}
