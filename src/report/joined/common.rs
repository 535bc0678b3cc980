//! `report --common`: a report on only the items that all models answered ([`keep_common_items`]).

use std::collections::HashSet;

use super::combine::Combined;
use super::join::TrialPlaces;
use crate::error::{Error, Result};
use crate::types::{AskedItem, QuestionId};
use darkqa_score::accuracies::shared_items;

/// Keeps only the trials of items to which every model with images has a reply in some condition. Models without any
/// reply are ignored.
///
/// # Errors
/// If there is no such item.
pub(super) fn keep_common_items(mut combined: Combined) -> Result<Combined> {
    let shared: HashSet<(QuestionId, Vec<String>, u32)> = {
        let grid = combined.grid();
        grid.items
            .iter()
            .zip(shared_items(&grid))
            .filter(|(_, is_shared)| *is_shared)
            .map(|(item, _)| item_key(item.asked))
            .collect()
    };
    if shared.is_empty() {
        return Err(Error::usage("--common", "no item was answered by every model; leave it out"));
    }
    let is_shared: Vec<bool> = combined
        .trials
        .items()
        .into_iter()
        .map(|item| item.is_some_and(|item| shared.contains(&item_key(item))))
        .collect();
    // The new place of each trial; `None` if it is removed.
    let mut places = Vec::with_capacity(combined.trials.len());
    let mut next = 0;
    for trial in combined.trials.iter() {
        let is_kept = is_shared[trial.item_number()];
        places.push(is_kept.then_some(next));
        next += u32::from(is_kept);
    }
    for run in &mut combined.runs {
        let kept = run.trials.iter().filter_map(|place| places[place]);
        run.trials = TrialPlaces::Some(kept.collect());
    }
    combined.trials.retain(|trial| is_shared[trial.item_number()]);
    let questions: HashSet<&QuestionId> = shared.iter().map(|(question, ..)| question).collect();
    combined.questions.retain(|question| questions.contains(&question.id));
    Ok(combined)
}

/// The identity of an item: question, order of choices and repeat.
fn item_key(item: &AskedItem) -> (QuestionId, Vec<String>, u32) {
    let (question, choices, repeat) = item.key();
    (question.clone(), choices.to_vec(), repeat)
}
