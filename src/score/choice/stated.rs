//! Answers that are announced: "the answer is B", "Answer: kitchen", "I'd go with (B)", "B is correct".

use std::sync::LazyLock;

use regex::Regex;

use super::clean::compiled;
use super::lenient;
use super::letters::{AFTER_A, AFTER_I, called_letter, hyphenated};
use super::markers::{self, Lead, Marker, MarkerKind};
use super::names::{Delimiting, Name, index_of, joins};
use super::plain::fold;
use super::view::ReplyView;
use crate::types::question::{Answer, UnreadReason};

/// One announcement.
#[derive(Debug, Clone, Copy)]
struct Announcement {
    /// Its first byte.
    at: usize,
    kind: MarkerKind,
    what: What,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum What {
    /// This is the answer, or what stands in the answer's place cannot be read.
    Is(Answer),
    /// This choice is not the answer.
    IsNot(usize),
}

/// The answer that a text announces: of those said to be the answer the last one; else the one that is decided for or
/// spoken of, where there is only one.
pub(super) fn stated(view: &ReplyView<'_>) -> Option<Answer> {
    let marks: Vec<Marker> = markers::markers(view.folded).collect();
    let mut sayings: Vec<Announcement> = praised(view).collect();
    let mut end = view.text.len();
    for mark in marks.into_iter().rev() {
        sayings.extend(saying(view, mark, end));
        if mark.kind == MarkerKind::Answer {
            end = mark.start;
        }
    }
    sayings.sort_by_key(|saying| saying.at);
    let of = |kind: MarkerKind| -> Vec<Announcement> {
        let same = sayings.iter().filter(|saying| saying.kind == kind);
        same.copied().collect()
    };
    last(&of(MarkerKind::Answer))
        .or_else(|| only(&of(MarkerKind::Decision), &[]))
        .or_else(|| only(&of(MarkerKind::Mention), &view.letters))
}

/// The last that was said to be the answer, unless it was taken back.
fn last(sayings: &[Announcement]) -> Option<Answer> {
    let readable = |answer: Answer| {
        !matches!(
            answer,
            Answer::Unparsed(UnreadReason::NoChoice | UnreadReason::Refused)
        )
    };
    let said = |saying: &Announcement| match saying.what {
        What::Is(answer) => Some((saying.at, answer)),
        What::IsNot(_) => None,
    };
    let (at, answer) = sayings
        .iter()
        .rev()
        .filter_map(said)
        .find(|(_, answer)| readable(*answer))
        .or_else(|| sayings.iter().rev().find_map(said))?;
    let back = |saying: &Announcement| {
        saying.at > at
            && matches!((saying.what, answer), (What::IsNot(a), Answer::Chosen(b)) if a == b)
    };
    Some(if sayings.iter().any(back) {
        Answer::Unparsed(UnreadReason::Negated)
    } else {
        answer
    })
}

/// The one choice that is spoken of; `beside` are letters that must not name another.
fn only(sayings: &[Announcement], beside: &[Name]) -> Option<Answer> {
    let mut chosen = None;
    for saying in sayings {
        match saying.what {
            What::Is(Answer::Chosen(index)) if chosen.is_none_or(|other| other == index) => {
                chosen = Some(index);
            }
            What::Is(Answer::Chosen(_)) => return Some(Answer::Unparsed(UnreadReason::Ambiguous)),
            What::Is(unparsed) => return Some(unparsed),
            What::IsNot(_) => {}
        }
    }
    let chosen = chosen?;
    for saying in sayings {
        match saying.what {
            What::IsNot(index) if index == chosen => {
                return Some(Answer::Unparsed(UnreadReason::Negated));
            }
            What::IsNot(_) => return Some(Answer::Unparsed(UnreadReason::Ambiguous)),
            What::Is(_) => {}
        }
    }
    let other = |name: &Name| name.choice != Some(chosen);
    Some(if beside.iter().any(other) {
        Answer::Unparsed(UnreadReason::Ambiguous)
    } else {
        Answer::Chosen(chosen)
    })
}

/// What a marker announces; `end` is where the next answer is announced.
fn saying(view: &ReplyView<'_>, mark: Marker, end: usize) -> Option<Announcement> {
    let lead = markers::lead(view.folded, mark.end);
    let kind = match mark.kind {
        MarkerKind::Answer if !lead.linked => MarkerKind::Mention,
        kind => kind,
    };
    let what = match announced(view, &lead) {
        Some((name, _)) if lead.denied || view.denies(&name) => What::IsNot(name.choice?),
        Some((_, answer)) => What::Is(answer),
        None if lead.colon && kind == MarkerKind::Answer => {
            let rest = view.text.get(*lead.steps.last()?..end)?.trim();
            What::Is(rest_of(view, rest)?)
        }
        None => return None,
    };
    Some(Announcement {
        at: mark.start,
        kind,
        what,
    })
}

/// What is said after "Answer:" in more words than a name: in the rest of the line, else in all that follows.
fn rest_of(view: &ReplyView<'_>, rest: &str) -> Option<Answer> {
    if rest.is_empty() {
        return None;
    }
    let line = rest.lines().next().unwrap_or_default();
    let [line, rest] =
        [line, rest].map(|text| lenient::spoken(&ReplyView::new(text, &fold(text), view.offered)));
    Some(match line {
        Answer::Unparsed(UnreadReason::NoChoice) => rest,
        line => line,
    })
}

/// The name that a marker leads to, with what it says once its surroundings are regarded.
fn announced(view: &ReplyView<'_>, lead: &Lead) -> Option<(Name, Answer)> {
    let far = *lead.steps.last()?;
    let longer = |name: &Name| name.end - name.start > 1;
    let name = view
        .text_from(far)
        .filter(longer)
        .or_else(|| letter_at(view, far))
        .or_else(|| lead.steps.iter().rev().find_map(|&at| view.text_at(at)))?;
    let after = &view.text[name.end..];
    if after.trim_start_matches([')', ']']).starts_with('?') {
        return None;
    }
    let Some(index) = name.choice else {
        return Some((name, Answer::Unparsed(UnreadReason::OutOfRange)));
    };
    let contradicts = |text: Name| text.choice != Some(index);
    let answer =
        if name.grip == Delimiting::Firm && view.labelled_text(&name).is_some_and(contradicts) {
            Answer::Unparsed(UnreadReason::Contradiction)
        } else if alternative(view, &name) {
            Answer::Unparsed(UnreadReason::Ambiguous)
        } else {
            Answer::Chosen(index)
        };
    Some((name, answer))
}

static ALTERNATIVE: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"\A[)\].]*\s*(?:,\s*(?:or|and)?\b|/|&|\+|;|(?:or|and|and/or|oder|und|ou|et|o|u|y|e|of|en|или|и|lub|i|veya|ve|أو|و|या|और)\b",
        r"|或者?|和|与|與|还是|または|か|と|또는|와|과|、)\s*(?:either\s+|option\s+|choice\s+|possibly\s+|maybe\s+|perhaps\s+)?"
    ))
});

/// Whether another choice is offered in the same breath: "B or C", "B/C", "kitchen or bathroom".
pub(super) fn alternative(view: &ReplyView<'_>, name: &Name) -> bool {
    let Some(link) = ALTERNATIVE.find(&view.folded[name.end..]) else {
        return false;
    };
    let at = name.end + link.end();
    let other = letter_at(view, at).or_else(|| view.text_at(at));
    other.is_some_and(|other| other.choice != name.choice && !view.denies(&other))
}

/// The letter that is named where one is expected, in either case, in brackets or bare.
fn letter_at(view: &ReplyView<'_>, at: usize) -> Option<Name> {
    let open = view.text[at..].starts_with(['(', '[']);
    let start = at + usize::from(open);
    let letter = view.text[start..]
        .chars()
        .next()
        .filter(char::is_ascii_alphabetic)?;
    let (left, right) = (&view.text[..start], &view.text[start + 1..]);
    let name = Name {
        start,
        end: start + 1,
        choice: index_of(letter).filter(|index| *index < view.offered.texts.len()),
        grip: Delimiting::Firm,
    };
    let after = right.chars().next();
    if joins(after) || hyphenated(left, right) || (after == Some('\'') && !turkish_copula(right)) {
        return None;
    }
    let words = right.trim_start_matches(' ');
    let ends = words.len() == right.len()
        || words.is_empty()
        || words.starts_with(['(', '-', '–', '—', '\n']);
    let fits = match letter {
        _ if open || ends || (letter.is_ascii_uppercase() && called_letter(left)) => true,
        'A' | 'a' => AFTER_A.is_match(words),
        'I' | 'i' => AFTER_I.is_match(words),
        'a'..='z' => AFTER_A.is_match(words) || view.labelled_text(&name).is_some(),
        _ => true,
    };
    fits.then_some(name)
}

/// "B'dir", "C'tir": Turkish "is", joined by an apostrophe.
fn turkish_copula(right: &str) -> bool {
    ["'dir", "'dır", "'dur", "'dür", "'tir", "'tır"]
        .iter()
        .any(|end| right.starts_with(end))
}

/// Names that are called the answer after they stand: "B is the correct answer".
fn praised<'a>(view: &'a ReplyView<'_>) -> impl Iterator<Item = Announcement> + 'a {
    let letters = view
        .letters
        .iter()
        .filter(|name| markers::praises_letter(&view.folded[name.end..]));
    let texts = view
        .texts
        .iter()
        .filter(|name| markers::praises_text(&view.folded[name.end..]));
    letters
        .chain(texts)
        .filter(|name| !view.denies(name))
        .map(|name| Announcement {
            at: name.start,
            kind: MarkerKind::Answer,
            what: What::Is(match name.choice {
                Some(index) => Answer::Chosen(index),
                None => Answer::Unparsed(UnreadReason::OutOfRange),
            }),
        })
}
