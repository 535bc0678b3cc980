//! Questions that differ in their answers alone: [`leave_out`].

use std::collections::BTreeSet;

use super::left_out::{LeftOut, Why};
use super::row::Table;
use super::settings::SetArgs;
use super::truths::Answered;

/// Leaves out both questions of each pair that differs in its answers alone, if the user allows it.
///
/// # Errors
/// If the user does not; the error names the first pair.
pub(super) fn leave_out(
    table: &Table,
    args: &SetArgs,
    answered: &mut Vec<Answered>,
    left: &mut LeftOut,
    pairs: &[[usize; 2]],
) -> Result<(), String> {
    let mut wrong = BTreeSet::new();
    for pair in pairs {
        for at in pair {
            let is_new = wrong.insert(*at);
            if is_new {
                left.add(Why::Bad, || contradiction(table, answered, *pair));
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
