//! Rows that cannot be asked and are left out.
//!
//! Questions that are equal except for their answers: [`find_contradictions`], [`omit_contradictions`].

mod left_out;
mod skip_bad;

use std::collections::{BTreeSet, HashMap};

use super::cells::SetRows;
use super::choices::SetQuestion;
use super::settings::SetArgs;
use darkqa_base::types::Digest;

pub(super) use left_out::{Omissions, RowOmission};

pub use skip_bad::SkipBad;

/// Pairs of indices of questions with equal digests and different answers. Every contradicted question is in at least
/// one pair.
pub(super) fn find_contradictions(questions: &[SetQuestion], digests: &[Digest]) -> Vec<[usize; 2]> {
    let truth = |index: usize| questions[index].choices.truth();
    let mut first: HashMap<&Digest, usize> = HashMap::new();
    let mut opposed: HashMap<&Digest, usize> = HashMap::new();
    let mut pairs = Vec::new();
    for (index, digest) in digests.iter().enumerate() {
        let first = *first.entry(digest).or_insert(index);
        if truth(first) != truth(index) {
            opposed.entry(digest).or_insert(index);
            pairs.push([first, index]);
        }
    }
    if opposed.is_empty() {
        return pairs;
    }
    // Repeats of the first question of a digest contradict the first question with another answer.
    for (index, digest) in digests.iter().enumerate() {
        let first = first[digest];
        if let Some(other) = opposed.get(digest)
            && first != index
            && truth(first) == truth(index)
        {
            pairs.push([index, *other]);
        }
    }
    pairs
}

/// Leaves out both questions of each contradictory pair, if the user allows it.
///
/// # Errors
/// If the user does not allow it; the error names the first pair.
pub(super) fn omit_contradictions(
    table: &SetRows,
    args: &SetArgs,
    questions: &mut Vec<SetQuestion>,
    omissions: &mut Omissions,
    pairs: &[[usize; 2]],
) -> Result<(), String> {
    let mut omitted = BTreeSet::new();
    for pair in pairs {
        for index in pair {
            if omitted.insert(*index) {
                omissions.add(RowOmission::Bad, || describe_contradiction(table, questions, *pair));
            }
        }
    }
    omissions.check(table.rows.len(), args)?;
    let mut index = 0;
    questions.retain(|_| {
        index += 1;
        !omitted.contains(&(index - 1))
    });
    if questions.is_empty() {
        return Err("no row is left to ask".to_owned());
    }
    Ok(())
}

/// Message about two questions that are equal except for their answers.
fn describe_contradiction(table: &SetRows, questions: &[SetQuestion], pair: [usize; 2]) -> String {
    let [one, other] = pair.map(|index| {
        let SetQuestion { row, choices, .. } = &questions[index];
        let truth = choices.truth().map_or("", |truth| &choices.texts()[truth]);
        format!("{} ({truth:?})", table.place_in_set(*row))
    });
    format!("{one} and {other} ask the same of the same image, and their answers differ")
}
