//! A first line that is an answer by itself: [`first_line`].

use super::strict;
use crate::names::{Delimiting, Name, NameState};
use crate::text::words::Role;
use crate::view::ReplyView;
use darkqa_ground::types::questions::{Answer, UnreadReason};

/// The first line, if it parses strictly. It is ambiguous if another line parses strictly as another choice, or if another choice follows a
/// retraction ("On reflection, it is C").
pub(super) fn first_line(view: &ReplyView<'_>) -> Option<Answer> {
    let (line, rest) = view.text.split_once('\n')?;
    let read = |line: &str| match strict::read(line.trim(), &view.offered.texts) {
        Some(Answer::Chosen(index)) => Some(index),
        _ => None,
    };
    let index = read(line)?;
    if view.state(0) == NameState::Repeated {
        return None;
    }
    let mut at = line.len() + 1;
    let mut differs = false;
    for other in rest.lines() {
        let listed = view.state(at) != NameState::Affirmed;
        differs |= !listed && other != line && read(other).is_some_and(|other| other != index);
        at += other.len() + 1;
    }
    let names_other = |name: &Name| {
        name.choice != Some(index) && name.delimiting > Delimiting::Loose && name.is_affirmed()
    };
    let taken_back = view
        .clauses
        .elements
        .iter()
        .find(|element| element.start > line.len() && element.has(Role::Retraction))
        .is_some_and(|back| {
            view.names
                .all()
                .any(|name| name.start > back.start && names_other(name))
        });
    Some(if differs || taken_back {
        Answer::Unparsed(UnreadReason::Ambiguous)
    } else {
        Answer::Chosen(index)
    })
}
