//! [`contradiction`]: a letter with the text of another choice, anywhere in a reply.

use crate::choice::names::{Delimiting, Name};
use crate::choice::text::Boundary;
use crate::choice::text::words::Role;
use crate::choice::view::ReplyView;
use darkqa_base::types::questions::{Answer, UnreadReason};

/// Unparsed if any letter has the text of another choice: "B. bathroom", "kitchen (C)", "I choose D, the kitchen".
pub(super) fn contradiction(view: &ReplyView<'_>) -> Option<Answer> {
    let contradicted = view.names.letters.iter().find(|letter| {
        letter.state.counts() && paired_text(view, letter).is_some_and(|text| text.choice != letter.choice)
    });
    let reason = match contradicted?.choice {
        Some(_) => UnreadReason::Contradiction,
        None => UnreadReason::OutOfRange,
    };
    Some(Answer::Unparsed(reason))
}

/// The text that a letter labels, or that is in apposition to it.
fn paired_text(view: &ReplyView<'_>, letter: &Name) -> Option<Name> {
    if let Some(text) = view.names.text_before(letter).filter(|name| name.state.counts())
        && view.text[letter.end..].starts_with([')', ']'])
    {
        let next = view.names.labelled_text(letter);
        // "(A) bedroom (B) kitchen" has its labels before the texts.
        return match next {
            Some(next) if text.choice != letter.choice => Some(next),
            _ => Some(text),
        };
    }
    if letter.delimiting == Delimiting::Firm {
        return view
            .names
            .labelled_text(letter)
            .or_else(|| explained_text(view, letter))
            .or_else(|| text_before(view, letter));
    }
    text_after(view, letter).or_else(|| text_before(view, letter))
}

/// The text after a letter without brackets, separated only by a comma, a dash or a colon, at the end of a part of a
/// clause: "I choose D, the kitchen."
fn text_after(view: &ReplyView<'_>, letter: &Name) -> Option<Name> {
    if let Some(text) = explained_text(view, letter) {
        return Some(text);
    }
    let text = view.names.labelled_text(letter)?;
    let gap = &view.text[letter.end..text.start];
    let signs = [',', '-', '–', '—', ':', '.', ')', '=', '→'];
    let has_sign = gap.trim_start().starts_with(signs);
    (has_sign && ends_part(view, text.end)).then_some(text)
}

/// The text after a letter and words such as "i.e.": "B, which is the kitchen".
fn explained_text(view: &ReplyView<'_>, letter: &Name) -> Option<Name> {
    let elements = &view.clauses.elements;
    let mut at = view.clauses.index(letter.end);
    at += usize::from(view.clauses.is_sign(at, &[')', ']']));
    at += usize::from(view.clauses.is_sign(at, &[',']));
    if !elements.get(at)?.has(Role::Apposition) {
        return None;
    }
    at += 1 + usize::from(view.clauses.is_sign(at + 1, &[',']));
    let text = view.names.text_at(elements.get(at)?.start)?;
    text.state.counts().then_some(text)
}

/// The text before a letter, separated by a comma or a dash and perhaps "option": "the kitchen, option C."
fn text_before(view: &ReplyView<'_>, letter: &Name) -> Option<Name> {
    let elements = &view.clauses.elements;
    let mut at = view.clauses.index(letter.start);
    let mut called = false;
    while at > 0 && elements[at - 1].roles.has_any(&[Role::Candidate, Role::Apposition]) {
        at -= 1;
        called = true;
    }
    let sign = at.checked_sub(1)?;
    let joined = view.clauses.is_sign(sign, &[',', '-', '–', '—', '=', '→', ':', '(', '[']);
    let text = view.names.text_ending_at(elements[sign.checked_sub(1)?].end)?;
    let ends = ends_part(view, letter.end) && view.names.labelled_text(letter).is_none();
    let alone = called || !view.clauses.is_sign(sign, &[',']) || at_clause_end(view, letter.end);
    (joined && ends && alone && text.state.counts()).then_some(text)
}

/// True if a part of a clause ends at a byte.
fn ends_part(view: &ReplyView<'_>, end: usize) -> bool {
    let next = view.clauses.elements.get(view.clauses.index(end));
    next.is_none_or(|next| next.boundary > Boundary::None || next.roles.has_any(&[Role::Within, Role::Preposition]))
}

/// True if a clause ends at a byte.
fn at_clause_end(view: &ReplyView<'_>, end: usize) -> bool {
    let next = view.clauses.elements.get(view.clauses.index(end));
    next.is_none_or(crate::choice::text::Element::ends_clause)
}
