//! `--common`: a report on the items that all models answered ([`restrict`]).

use std::collections::HashSet;

use super::combine::Combined;
use crate::error::{Error, Result};
use crate::score::common::shared_items;
use crate::types::{QuestionId, Record};

/// Keeps the records of the items to which every model with images has a reply in any condition; a model without any reply does not
/// count.
///
/// # Errors
/// If there is no such item.
pub(super) fn restrict(mut combined: Combined) -> Result<Combined> {
    let shared: HashSet<(QuestionId, Vec<String>, u32)> = {
        let grid = combined.grid();
        let items = grid.items.iter().zip(shared_items(&grid));
        let items = items.filter(|(_, is_shared)| *is_shared);
        items.map(|(item, _)| item_of(item.record)).collect()
    };
    if shared.is_empty() {
        return Err(Error::usage(
            "--common",
            "no item was answered by every model; leave it out",
        ));
    }
    let kept: Vec<bool> = combined
        .records
        .iter()
        .map(|record| shared.contains(&item_of(record)))
        .collect();
    let mut places = Vec::with_capacity(kept.len());
    let mut next = 0;
    for kept in &kept {
        places.push(kept.then_some(next));
        next += usize::from(*kept);
    }
    for run in &mut combined.runs {
        run.records = run
            .records
            .iter()
            .filter_map(|place| places[*place])
            .collect();
    }
    let mut kept = kept.into_iter();
    combined.records.retain(|_| kept.next() == Some(true));
    let questions: HashSet<&QuestionId> = shared.iter().map(|(question, ..)| question).collect();
    combined
        .questions
        .retain(|question| questions.contains(&question.id));
    Ok(combined)
}

/// What identifies an item: question, order of choices and repeat.
fn item_of(record: &Record) -> (QuestionId, Vec<String>, u32) {
    (
        record.question.clone(),
        record.detail.choices.to_vec(),
        record.detail.repeat,
    )
}
