//! Lenient parsing: a sequence of levels; the first that finds something decides.
//!
//! 1. A letter with the text of another choice is a contradiction, wherever it stands.
//! 2. JSON with an answer key, `\boxed{}`, `<answer>`.
//! 3. Ticks and task lists.
//! 4. The strict parsing of the text without markup.
//! 5. The last stated answer: "the answer is B", "which leaves B".
//! 6. The first line alone, if it reads strictly; a leading "yes" or "no".
//! 7. The letters that are left, then the texts that are left.
//!
//! From level 5 on, only affirmed names count. A name does not count that is in a list of all choices, in a question, in a condition, a
//! color of the image, or denied ([`NameState`]). A level that finds two different answers accepts neither, and no later level is tried.

use super::contradiction::contradiction;
use super::first_line::first_line;
use super::stated::{alternative, stated};
use super::strict;
use super::structured::{boxed, json};
use super::ticks::{ticked, without_unknown};
use super::yes_no::yes_or_no;
use crate::choice_views::ChoiceViews;
use crate::names::{Delimiting, Name, NameState};
use crate::text::{clean, declines, fold, plain};
use crate::view::ReplyView;
use darkqa_ground::types::questions::{Answer, Choices, UnreadReason};

/// The lenient parsing of a reply without its reasoning.
pub(crate) fn read(text: &str, choices: &Choices) -> Answer {
    let choices = ChoiceViews::new(choices);
    let tidy = clean::tidy(text);
    let tidy = without_unknown(&tidy);
    // A model that goes on and asks itself the next question has answered ours before.
    let first = clean::before_next_turn(&tidy).map(|before| steps(before, &choices));
    match first {
        None | Some(Answer::Unparsed(UnreadReason::NoChoice | UnreadReason::Refused)) => {
            steps(&tidy, &choices)
        }
        Some(answer) => answer,
    }
}

/// All steps, on a text from [`clean::tidy`].
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

/// The reading of a part of a reply as a plain text of its own.
pub(super) fn read_part(text: &str, choices: &ChoiceViews) -> Answer {
    let text = plain(text);
    read_plain(&ReplyView::new(&text, &fold(&text), choices))
}

/// The steps for plain text: a reply without markup, or a value in JSON, LaTeX or a tag.
pub(super) fn read_plain(view: &ReplyView<'_>) -> Answer {
    None.or_else(|| contradiction(view))
        .or_else(|| strict::read(view.text, &view.offered.texts))
        .or_else(|| stated(view))
        .or_else(|| yes_or_no(view))
        .or_else(|| first_line(view))
        .or_else(|| letters(view))
        .or_else(|| texts(view))
        .unwrap_or_else(|| Answer::Unparsed(unread(view)))
}

/// Letters in brackets or before punctuation: "(B)", "B, because there is a stove".
fn letters(view: &ReplyView<'_>) -> Option<Answer> {
    let said = view.affirmed_letters();
    let first = said.clone().max_by_key(|letter| letter.delimiting)?;
    let Some(index) = first.choice else {
        return Some(Answer::Unparsed(UnreadReason::OutOfRange));
    };
    let another = |name: &Name| name.choice != Some(index);
    let mut counted = view.names.letters.iter().filter(|name| name.state.counts());
    let only_text = view.affirmed_texts().next().filter(|text| {
        another(text)
            && view
                .affirmed_texts()
                .all(|other| other.choice == text.choice)
    });
    let reason = if counted.any(another)
        || said
            .clone()
            .chain(view.affirmed_texts())
            .any(|name| alternative(view, name))
    {
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
    Some(
        if view
            .names
            .all()
            .any(|name| name.choice != Some(index) && name.state.counts())
        {
            Answer::Unparsed(UnreadReason::Ambiguous)
        } else if is_denied(view, index) {
            Answer::Unparsed(UnreadReason::Negated)
        } else {
            Answer::Chosen(index)
        },
    )
}

/// Whether a choice is denied anywhere.
fn is_denied(view: &ReplyView<'_>, index: usize) -> bool {
    view.names.all().any(|name| {
        name.choice == Some(index) && matches!(name.state, NameState::Denied | NameState::Excluded)
    })
}

/// The reason for a reply in which no choice is said to be there.
fn unread(view: &ReplyView<'_>) -> UnreadReason {
    let has = |states: &[NameState]| view.names.all().any(|name| states.contains(&name.state));
    if declines(view.folded) {
        UnreadReason::Refused
    } else if has(&[NameState::Denied, NameState::Excluded]) {
        UnreadReason::Negated
    } else if has(&[NameState::Repeated]) {
        UnreadReason::Ambiguous
    } else {
        UnreadReason::NoChoice
    }
}
