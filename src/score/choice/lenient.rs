//! The lenient reading: a sequence of steps, of which the first that finds something decides.

use super::clean;
use super::names::{Delimiting, Name};
use super::plain::{fold, plain};
use super::refusal::declines;
use super::stated::{alternative, stated};
use super::strict;
use super::structured::{boxed, json};
use super::view::{ChoiceViews, ReplyView};
use crate::types::question::{Answer, Choices, UnreadReason};

/// The lenient reading of a reply without its reasoning.
pub(super) fn read(text: &str, choices: &Choices) -> Answer {
    let choices = ChoiceViews::new(choices);
    let tidy = clean::tidy(text);
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
        .unwrap_or_else(|| read_plain(&view))
}

/// The steps for plain text: a reply without markup, or a value in JSON, LaTeX or a tag.
pub(super) fn read_plain(view: &ReplyView<'_>) -> Answer {
    None.or_else(|| contradiction(view))
        .or_else(|| strict::read(view.text, &view.offered.texts))
        .or_else(|| yes_or_no(view))
        .or_else(|| denial(view))
        .or_else(|| stated(view))
        .or_else(|| letters(view))
        .or_else(|| texts(view))
        .unwrap_or_else(|| unread(view))
}

/// A letter with the text of another choice: "B. bathroom".
fn contradiction(view: &ReplyView<'_>) -> Option<Answer> {
    let labels = view
        .letters
        .iter()
        .filter(|letter| letter.delimiting == Delimiting::Firm);
    let mut wrong = labels.filter_map(|letter| {
        let text = view.labelled_text(letter)?;
        (text.choice != letter.choice).then_some(letter.choice)
    });
    let reason = match wrong.next()? {
        Some(_) => UnreadReason::Contradiction,
        None => UnreadReason::OutOfRange,
    };
    Some(Answer::Unparsed(reason))
}

/// The leading word, if yes and no are among the choices: "Yes, there is no lamp".
fn yes_or_no(view: &ReplyView<'_>) -> Option<Answer> {
    /// Words after a leading "no" of a reply that does not answer.
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
    let (chosen, other) = match word {
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
            .any(|name| name.choice == Some(other) && name.delimiting > Delimiting::Loose)
    };
    Some(if named(&view.texts) || named(&view.letters) {
        Answer::Unparsed(UnreadReason::Ambiguous)
    } else {
        Answer::Chosen(chosen)
    })
}

/// The only choice named, and always denied: "This is not a kitchen".
fn denial(view: &ReplyView<'_>) -> Option<Answer> {
    let names = || view.letters.iter().chain(&view.texts);
    let first = names().next()?.choice?;
    let denied = |name: &Name| name.choice == Some(first) && view.denies(name);
    names().all(denied).then(|| negated(view))
}

/// Letters in brackets or before punctuation: "(B)", "B, because there is a stove".
fn letters(view: &ReplyView<'_>) -> Option<Answer> {
    let delimited = view
        .letters
        .iter()
        .filter(|letter| letter.delimiting > Delimiting::Loose);
    let first = delimited.clone().max_by_key(|letter| letter.delimiting)?;
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
    let reason = if view.letters.iter().any(another)
        || delimited
            .clone()
            .chain(&view.texts)
            .any(|name| alternative(view, name))
    {
        UnreadReason::Ambiguous
    } else if delimited.clone().any(|letter| view.denies(letter)) {
        return Some(negated(view));
    } else if delimited.clone().any(contradicts)
        || (first.delimiting < Delimiting::Firm && only_text && another(&view.texts[0]))
    {
        UnreadReason::Contradiction
    } else {
        return Some(Answer::Chosen(index));
    };
    Some(Answer::Unparsed(reason))
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

/// The reason for a choice that is named only with a denial.
fn negated(view: &ReplyView<'_>) -> Answer {
    Answer::Unparsed(if declines(view.folded) {
        UnreadReason::Refused
    } else {
        UnreadReason::Negated
    })
}

/// The reason for a reply that names no choice.
fn unread(view: &ReplyView<'_>) -> Answer {
    Answer::Unparsed(if declines(view.folded) {
        UnreadReason::Refused
    } else {
        UnreadReason::NoChoice
    })
}
