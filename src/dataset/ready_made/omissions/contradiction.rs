//! Questions that differ in their answers alone: [`contradictory`], [`leave_out`].

use std::collections::{BTreeSet, HashMap};

use super::left_out::{OmissionReason, Omissions};
use crate::dataset::ready_made::cells::Table;
use crate::dataset::ready_made::choices::Answered;
use crate::dataset::ready_made::settings::SetArgs;
use crate::types::Digest;

/// The pairs of questions whose digests are equal and whose answers differ, by their places. Each question that another contradicts is
/// in a pair.
pub(in crate::dataset::ready_made) fn contradictory(
    answered: &[Answered],
    digests: &[Digest],
) -> Vec<[usize; 2]> {
    let truth = |at: usize| answered[at].choices.truth();
    let mut first: HashMap<&Digest, usize> = HashMap::new();
    let mut opposed: HashMap<&Digest, usize> = HashMap::new();
    let mut pairs = Vec::new();
    for (at, digest) in digests.iter().enumerate() {
        let first = *first.entry(digest).or_insert(at);
        if truth(first) != truth(at) {
            opposed.entry(digest).or_insert(at);
            pairs.push([first, at]);
        }
    }
    if !opposed.is_empty() {
        for (at, digest) in digests.iter().enumerate() {
            let other = opposed
                .get(digest)
                .copied()
                .filter(|_| first[digest] != at && truth(first[digest]) == truth(at));
            pairs.extend(other.map(|other| [at, other]));
        }
    }
    pairs
}

/// Leaves out both questions of each pair that differs in its answers alone, if the user allows it.
///
/// # Errors
/// If the user does not; the error names the first pair.
pub(in crate::dataset::ready_made) fn leave_out(
    table: &Table,
    args: &SetArgs,
    answered: &mut Vec<Answered>,
    left: &mut Omissions,
    pairs: &[[usize; 2]],
) -> Result<(), String> {
    let mut wrong = BTreeSet::new();
    for pair in pairs {
        for at in pair {
            let is_new = wrong.insert(*at);
            if is_new {
                left.add(OmissionReason::Bad, || {
                    contradiction(table, answered, *pair)
                });
            }
        }
    }
    left.check(table.rows.len(), args)?;
    let mut at = 0;
    answered.retain(|_| {
        at += 1;
        !wrong.contains(&(at - 1))
    });
    if answered.is_empty() {
        return Err("no row is left to ask".to_owned());
    }
    Ok(())
}

/// Two questions that differ in their answers alone, in words.
fn contradiction(table: &Table, answered: &[Answered], pair: [usize; 2]) -> String {
    let [one, other] = pair.map(|at| {
        let Answered { row, choices, .. } = &answered[at];
        let truth = choices.truth().map_or("", |truth| &choices.texts()[truth]);
        format!("{} ({truth:?})", table.place(*row))
    });
    format!("{one} and {other} ask the same of the same image, and their answers differ")
}
