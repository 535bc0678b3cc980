//! Lenient parsing: a sequence of levels; the first that finds something decides.
//!
//! 1. A letter with the text of another choice, anywhere in the reply: a contradiction.
//! 2. JSON with an answer key, `\boxed{}`, `<answer>`.
//! 3. Ticks and task lists.
//! 4. The strict parsing of the text without markup.
//! 5. The last stated answer: "the answer is B", "which leaves B".
//! 6. A leading "yes" or "no"; the first line alone, if it parses strictly.
//! 7. Affirmed letters, then affirmed texts.
//!
//! From level 5 on, only affirmed names count: not those in a list of all choices, in a question or in a condition, not
//! a color of the image, and not denied ones ([`NameState`]). A level that finds two different answers accepts neither,
//! and no later level is tried.

use super::contradiction::contradiction;
use super::first_line::first_line;
use super::stated::{has_alternative, stated};
use super::strict;
use super::structured::{boxed, json};
use super::ticks::{ticked, without_unknown};
use super::yes_no::yes_or_no;
use crate::choice::choice_views::ChoiceViews;
use crate::choice::names::{Delimiting, NameState};
use crate::choice::text::{clean, declines, fold, plain};
use crate::choice::view::ReplyView;
use darkqa_base::types::questions::{Answer, Choices, UnreadReason};

/// The lenient parsing of a reply without its reasoning.
pub(crate) fn read(text: &str, choices: &Choices) -> Answer {
    let choices = ChoiceViews::new(choices);
    let tidy = clean::tidy(text);
    let tidy = without_unknown(&tidy);
    // If the model continues with a next question of its own, its answer is before that question.
    let first = clean::before_next_turn(&tidy).map(|before| steps(before, &choices));
    match first {
        None | Some(Answer::Unparsed(UnreadReason::NoChoice | UnreadReason::Refused)) => steps(&tidy, &choices),
        Some(answer) => answer,
    }
}

/// All levels, on a text from [`clean::tidy`].
fn steps(tidy: &str, choices: &ChoiceViews) -> Answer {
    let text = plain(tidy);
    let folded = fold(&text);
    let view = ReplyView::new(&text, &folded, choices);
    None.or_else(|| contradiction(&view))
        .or_else(|| json(tidy, choices))
        .or_else(|| boxed(tidy, choices))
        .or_else(|| {
            let ticks = ticked(tidy, |item| read_part(item, choices))?;
            ticks.answer(stated(&view))
        })
        .unwrap_or_else(|| read_plain(&view))
}

/// Parses a part of a reply as a plain text.
pub(super) fn read_part(text: &str, choices: &ChoiceViews) -> Answer {
    let text = plain(text);
    read_plain(&ReplyView::new(&text, &fold(&text), choices))
}

/// The levels for plain text: a reply without markup, or a value in JSON, LaTeX or a tag.
pub(super) fn read_plain(view: &ReplyView<'_>) -> Answer {
    None.or_else(|| contradiction(view))
        .or_else(|| strict::read(view.text, &view.offered.texts))
        .or_else(|| stated(view))
        .or_else(|| yes_or_no(view))
        .or_else(|| first_line(view))
        .or_else(|| letters(view))
        .or_else(|| texts(view))
        .unwrap_or_else(|| Answer::Unparsed(unread_reason(view)))
}

/// Letters in brackets or before punctuation: "(B)", "B, because there is a stove".
fn letters(view: &ReplyView<'_>) -> Option<Answer> {
    let affirmed = view.affirmed_letters();
    let first = affirmed.clone().max_by_key(|letter| letter.delimiting)?;
    let Some(index) = first.choice else {
        return Some(Answer::Unparsed(UnreadReason::OutOfRange));
    };
    let has_other_letter = view.names.letters.iter().any(|name| name.state.counts() && name.choice != Some(index));
    let only_text = view
        .affirmed_texts()
        .next()
        .filter(|text| text.choice != Some(index) && view.affirmed_texts().all(|other| other.choice == text.choice));
    let reason = if has_other_letter || affirmed.chain(view.affirmed_texts()).any(|name| has_alternative(view, name)) {
        UnreadReason::Ambiguous
    } else if is_denied(view, index) {
        UnreadReason::Negated
    } else if first.delimiting < Delimiting::Firm && only_text.is_some() {
        UnreadReason::Contradiction
    } else {
        return Some(Answer::Chosen(index));
    };
    Some(Answer::Unparsed(reason))
}

/// The texts of choices, as whole words: "It is a kitchen."
fn texts(view: &ReplyView<'_>) -> Option<Answer> {
    let index = view.affirmed_texts().next()?.choice?;
    Some(if view.names.all().any(|name| name.choice != Some(index) && name.state.counts()) {
        Answer::Unparsed(UnreadReason::Ambiguous)
    } else if is_denied(view, index) {
        Answer::Unparsed(UnreadReason::Negated)
    } else {
        Answer::Chosen(index)
    })
}

/// True if a choice is denied or excluded anywhere in the reply.
fn is_denied(view: &ReplyView<'_>, index: usize) -> bool {
    view.names
        .all()
        .any(|name| name.choice == Some(index) && matches!(name.state, NameState::Denied | NameState::Excluded))
}

/// The reason why a reply without an affirmed choice was not read.
fn unread_reason(view: &ReplyView<'_>) -> UnreadReason {
    let states: Vec<NameState> = view.names.all().map(|name| name.state).collect();
    if declines(view.folded) {
        UnreadReason::Refused
    } else if states.contains(&NameState::Denied) || states.contains(&NameState::Excluded) {
        UnreadReason::Negated
    } else if states.contains(&NameState::Repeated) {
        UnreadReason::Ambiguous
    } else {
        UnreadReason::NoChoice
    }
}
