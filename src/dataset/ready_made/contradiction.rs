//! Questions that differ in their answers alone: [`leave_out`].

use std::collections::BTreeSet;

use super::left_out::Why;
use super::row::Table;
use super::truths::Answered;
use super::{Opened, ReadSet};
use crate::error::{Error, Result};

/// Leaves out both questions of each pair that differs in its answers alone, if the user allows it.
pub(super) fn leave_out(
    opened: &Opened<'_>,
    set: &mut ReadSet,
    pairs: &[[usize; 2]],
) -> Result<()> {
    let mut wrong = BTreeSet::new();
    for pair in pairs {
        for at in pair {
            let is_new = wrong.insert(*at);
            if is_new {
                set.left.add(Why::Bad, || {
                    contradiction(opened.table, &set.answered, *pair)
                });
            }
        }
    }
    let problem = |problem: String| Error::data(opened.place.display(), problem);
    set.left
        .check(opened.table.rows.len(), opened.args)
        .map_err(problem)?;
    let mut at = 0;
    set.answered.retain(|_| {
        at += 1;
        !wrong.contains(&(at - 1))
    });
    if set.answered.is_empty() {
        return Err(problem("no row is left to ask".to_owned()));
    }
    Ok(())
}

/// Two questions that differ in their answers alone, in words.
fn contradiction(table: &Table, answered: &[Answered], pair: [usize; 2]) -> String {
    let [one, other] = pair.map(|at| {
        let (item, choices) = (&answered[at].item, &answered[at].choices);
        let truth = choices.truth().map_or("", |truth| &choices.texts()[truth]);
        format!("{} ({truth:?})", table.place(item.row))
    });
    format!("{one} and {other} ask the same of the same image, and their answers differ")
}
