//! [`yes_or_no`]: a leading "yes" or "no".

use crate::choice::names::Delimiting;
use crate::choice::view::ReplyView;
use darkqa_base::types::questions::{Answer, UnreadReason};

/// The first word, if yes and no are among the choices: "Yes, there is no lamp". A "no" counts only if it is an answer
/// and not a determiner; if the other word is named too, the reply is ambiguous.
pub(super) fn yes_or_no(view: &ReplyView<'_>) -> Option<Answer> {
    let (yes, no) = view.offered.yes_no?;
    let first = view.clauses.elements.iter().find(|element| element.end > element.start)?;
    let word = view.names.text_from(first.start)?;
    let (chosen, other) = match word.choice {
        Some(choice) if choice == yes => (yes, no),
        Some(choice) if choice == no => (no, yes),
        _ => return None,
    };
    if !word.is_affirmed() {
        return None;
    }
    Some(
        if view
            .names
            .all()
            .any(|name| name.choice == Some(other) && name.delimiting > Delimiting::Loose && name.state.counts())
        {
            Answer::Unparsed(UnreadReason::Ambiguous)
        } else {
            Answer::Chosen(chosen)
        },
    )
}
