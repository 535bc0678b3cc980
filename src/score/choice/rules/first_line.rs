//! [`first_line`]: a first line that is an answer on its own.

use super::strict;
use crate::choice::names::{Delimiting, NameState};
use crate::choice::text::words::Role;
use crate::choice::view::ReplyView;
use darkqa_base::types::questions::{Answer, UnreadReason};

/// The first line, if it parses strictly. It is ambiguous if another line parses strictly as another choice, or if
/// another choice follows a retraction ("On reflection, it is C").
pub(super) fn first_line(view: &ReplyView<'_>) -> Option<Answer> {
    let (line, rest) = view.text.split_once('\n')?;
    let index = strict_choice(view, line)?;
    if view.state(0) == NameState::Repeated {
        return None;
    }
    let mut at = line.len() + 1;
    let mut differs = false;
    for other in rest.lines() {
        let listed = view.state(at) != NameState::Affirmed;
        differs |= !listed && other != line && strict_choice(view, other).is_some_and(|other| other != index);
        at += other.len() + 1;
    }
    let is_retracted = view
        .clauses
        .elements
        .iter()
        .find(|element| element.start > line.len() && element.has(Role::Retraction))
        .is_some_and(|retraction| {
            view.names.all().any(|name| {
                name.start > retraction.start
                    && name.choice != Some(index)
                    && name.delimiting > Delimiting::Loose
                    && name.is_affirmed()
            })
        });
    Some(if differs || is_retracted { Answer::Unparsed(UnreadReason::Ambiguous) } else { Answer::Chosen(index) })
}

/// The choice that the strict parsing finds in a line.
fn strict_choice(view: &ReplyView<'_>, line: &str) -> Option<usize> {
    match strict::read(line.trim(), &view.offered.texts) {
        Some(Answer::Chosen(index)) => Some(index),
        _ => None,
    }
}
