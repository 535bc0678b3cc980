//! The lenient reading: level after level, and the first that finds something decides.

use super::clean;
use super::names::{Delimiting, Name};
use super::plain::{fold, plain};
use super::refusal::declines;
use super::stated::{alternative, stated};
use super::strict;
use super::view::{ChoiceViews, ReplyView};
use super::written::{boxed, json};
use crate::types::question::{Answer, Choices, UnreadReason};

/// Reads a reply, reasoning left out already.
pub(super) fn read(text: &str, choices: &Choices) -> Answer {
    let offered = ChoiceViews::new(choices);
    let tidy = clean::tidy(text);
    // A model that runs on and asks itself the next question has answered ours before.
    let first = clean::before_next_turn(&tidy).map(|before| levels(before, &offered));
    match first {
        None | Some(Answer::Unparsed(UnreadReason::NoChoice | UnreadReason::Refused)) => {
            levels(&tidy, &offered)
        }
        Some(answer) => answer,
    }
}

/// All levels, on a tidied text.
fn levels(tidy: &str, offered: &ChoiceViews) -> Answer {
    let text = plain(tidy);
    let folded = fold(&text);
    let view = ReplyView::new(&text, &folded, offered);
    None.or_else(|| contradiction(&view))
        .or_else(|| json(tidy, offered))
        .or_else(|| boxed(tidy, offered))
        .unwrap_or_else(|| spoken(&view))
}

/// The levels that need no form: of a reply without markup, or of a value in a form.
pub(super) fn spoken(view: &ReplyView<'_>) -> Answer {
    None.or_else(|| contradiction(view))
        .or_else(|| strict::read(view.text, &view.offered.texts))
        .or_else(|| yes_or_no(view))
        .or_else(|| denial(view))
        .or_else(|| stated(view))
        .or_else(|| letters(view))
        .or_else(|| texts(view))
        .unwrap_or_else(|| nothing(view))
}

/// A letter with the text of another choice: "B. bathroom".
fn contradiction(view: &ReplyView<'_>) -> Option<Answer> {
    let labels = view
        .letters
        .iter()
        .filter(|letter| letter.grip == Delimiting::Firm);
    let mut wrong = labels.filter_map(|letter| {
        let text = view.labelled_text(letter)?;
        (text.choice != letter.choice).then_some(letter.choice)
    });
    let why = match wrong.next()? {
        Some(_) => UnreadReason::Contradiction,
        None => UnreadReason::OutOfRange,
    };
    Some(Answer::Unparsed(why))
}

/// The leading word, where yes and no are offered: "Yes, there is no lamp".
fn yes_or_no(view: &ReplyView<'_>) -> Option<Answer> {
    /// What "no" is part of at the beginning of a reply that does not answer.
    const NOT_AN_ANSWER: [&str; 8] = [
        "idea",
        "clue",
        "image",
        "picture",
        "way",
        "answer",
        "information",
        "visible",
    ];
    let (yes, no) = view.offered.yes_no?;
    let word = view.folded.split(|c: char| !c.is_alphanumeric()).next()?;
    let (said, other) = match word {
        "yes" => (yes, no),
        "no" => (no, yes),
        _ => return None,
    };
    let next = view.folded[word.len()..]
        .strip_prefix(' ')
        .unwrap_or_default();
    let next = next
        .split(|c: char| !c.is_alphanumeric())
        .next()
        .unwrap_or_default();
    if word == "no" && NOT_AN_ANSWER.contains(&next) {
        return None;
    }
    let named = |names: &[Name]| {
        names
            .iter()
            .any(|name| name.choice == Some(other) && name.grip > Delimiting::Loose)
    };
    Some(if named(&view.texts) || named(&view.letters) {
        Answer::Unparsed(UnreadReason::Ambiguous)
    } else {
        Answer::Chosen(said)
    })
}

/// The only choice named, and never but to deny it: "This is not a kitchen".
fn denial(view: &ReplyView<'_>) -> Option<Answer> {
    let names = || view.letters.iter().chain(&view.texts);
    let first = names().next()?.choice?;
    let denied = |name: &Name| name.choice == Some(first) && view.denies(name);
    names().all(denied).then(|| negated(view))
}

/// Letters in brackets or before punctuation: "(B)", "B, because there is a stove".
fn letters(view: &ReplyView<'_>) -> Option<Answer> {
    let held = view
        .letters
        .iter()
        .filter(|letter| letter.grip > Delimiting::Loose);
    let first = held.clone().max_by_key(|letter| letter.grip)?;
    let Some(index) = first.choice else {
        return Some(Answer::Unparsed(UnreadReason::OutOfRange));
    };
    let another = |name: &Name| name.choice != Some(index);
    let contradicts = |letter: &Name| {
        view.labelled_text(letter)
            .is_some_and(|text| another(&text))
    };
    let only_text = !view.texts.is_empty()
        && view
            .texts
            .iter()
            .all(|text| text.choice == view.texts[0].choice);
    let why = if view.letters.iter().any(another)
        || held
            .clone()
            .chain(&view.texts)
            .any(|name| alternative(view, name))
    {
        UnreadReason::Ambiguous
    } else if held.clone().any(|letter| view.denies(letter)) {
        return Some(negated(view));
    } else if held.clone().any(contradicts)
        || (first.grip < Delimiting::Firm && only_text && another(&view.texts[0]))
    {
        UnreadReason::Contradiction
    } else {
        return Some(Answer::Chosen(index));
    };
    Some(Answer::Unparsed(why))
}

/// The texts of choices, as whole words: "It is a kitchen."
fn texts(view: &ReplyView<'_>) -> Option<Answer> {
    let first = view.texts.first()?.choice?;
    let another = |name: &Name| name.choice != Some(first);
    if view.texts.iter().any(another) || view.letters.iter().any(another) {
        return Some(Answer::Unparsed(UnreadReason::Ambiguous));
    }
    if view.texts.iter().any(|name| view.denies(name)) {
        return Some(negated(view));
    }
    Some(Answer::Chosen(first))
}

/// Why a choice that is named only beside a "not" was not read.
fn negated(view: &ReplyView<'_>) -> Answer {
    Answer::Unparsed(if declines(view.folded) {
        UnreadReason::Refused
    } else {
        UnreadReason::Negated
    })
}

/// Why nothing at all was read.
fn nothing(view: &ReplyView<'_>) -> Answer {
    Answer::Unparsed(if declines(view.folded) {
        UnreadReason::Refused
    } else {
        UnreadReason::NoChoice
    })
}
