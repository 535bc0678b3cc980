//! Answers that are announced: "the answer is B", "Answer: kitchen", "I'd go with (B)", "B is correct".

use std::sync::LazyLock;

use regex::Regex;

use super::clean::compiled;
use super::lenient;
use super::letters::{AFTER_A, AFTER_I, called_letter, hyphenated};
use super::markers::{self, Lead, Marker, MarkerKind};
use super::names::{Delimiting, Name, continues_word, index_of};
use super::plain::fold;
use super::view::ReplyView;
use crate::types::question::{Answer, UnreadReason};

/// A statement about a choice at one place in a reply.
#[derive(Debug, Clone, Copy)]
struct Announcement {
    /// First byte of the announcement.
    at: usize,
    kind: MarkerKind,
    statement: Statement,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Statement {
    /// This is the answer, or the text in its place cannot be read.
    Is(Answer),
    /// This choice is not the answer.
    IsNot(usize),
}

/// The answer that a text announces: the last one that is stated to be the answer, else the only one that is chosen, else
/// the only one that is mentioned.
pub(super) fn stated(view: &ReplyView<'_>) -> Option<Answer> {
    let found: Vec<Marker> = markers::markers(view.folded).collect();
    let mut announcements: Vec<Announcement> = confirmed(view).collect();
    let mut end = view.text.len();
    for marker in found.into_iter().rev() {
        announcements.extend(announcement(view, marker, end));
        if marker.kind == MarkerKind::Answer {
            end = marker.start;
        }
    }
    announcements.sort_by_key(|announcement| announcement.at);
    let of = |kind: MarkerKind| -> Vec<Announcement> {
        let same = announcements
            .iter()
            .filter(|announcement| announcement.kind == kind);
        same.copied().collect()
    };
    last(&of(MarkerKind::Answer))
        .or_else(|| only(&of(MarkerKind::Decision), &[]))
        .or_else(|| only(&of(MarkerKind::Mention), &view.letters))
}

/// The last answer that is stated, unless it is denied later.
fn last(announcements: &[Announcement]) -> Option<Answer> {
    let readable = |answer: Answer| {
        !matches!(
            answer,
            Answer::Unparsed(UnreadReason::NoChoice | UnreadReason::Refused)
        )
    };
    let answer_of = |announcement: &Announcement| match announcement.statement {
        Statement::Is(answer) => Some((announcement.at, answer)),
        Statement::IsNot(_) => None,
    };
    let (at, answer) = announcements
        .iter()
        .rev()
        .filter_map(answer_of)
        .find(|(_, answer)| readable(*answer))
        .or_else(|| announcements.iter().rev().find_map(answer_of))?;
    let retracts = |announcement: &Announcement| {
        announcement.at > at
            && matches!((announcement.statement, answer), (Statement::IsNot(a), Answer::Chosen(b)) if a == b)
    };
    Some(if announcements.iter().any(retracts) {
        Answer::Unparsed(UnreadReason::Negated)
    } else {
        answer
    })
}

/// The only choice that is announced; `other_letters` must not name another one.
fn only(announcements: &[Announcement], other_letters: &[Name]) -> Option<Answer> {
    let mut chosen = None;
    for announcement in announcements {
        match announcement.statement {
            Statement::Is(Answer::Chosen(index)) if chosen.is_none_or(|other| other == index) => {
                chosen = Some(index);
            }
            Statement::Is(Answer::Chosen(_)) => {
                return Some(Answer::Unparsed(UnreadReason::Ambiguous));
            }
            Statement::Is(unparsed) => return Some(unparsed),
            Statement::IsNot(_) => {}
        }
    }
    let chosen = chosen?;
    for announcement in announcements {
        match announcement.statement {
            Statement::IsNot(index) if index == chosen => {
                return Some(Answer::Unparsed(UnreadReason::Negated));
            }
            Statement::IsNot(_) => return Some(Answer::Unparsed(UnreadReason::Ambiguous)),
            Statement::Is(_) => {}
        }
    }
    let other = |name: &Name| name.choice != Some(chosen);
    Some(if other_letters.iter().any(other) {
        Answer::Unparsed(UnreadReason::Ambiguous)
    } else {
        Answer::Chosen(chosen)
    })
}

/// The announcement of a marker; `end` is the byte at which the next answer is announced.
fn announcement(view: &ReplyView<'_>, marker: Marker, end: usize) -> Option<Announcement> {
    let lead = markers::lead(view.folded, marker.end);
    let kind = match marker.kind {
        MarkerKind::Answer if !lead.linked => MarkerKind::Mention,
        kind => kind,
    };
    let statement = match announced(view, &lead) {
        Some((name, _)) if lead.denied || view.denies(&name) => Statement::IsNot(name.choice?),
        Some((_, answer)) => Statement::Is(answer),
        None if lead.colon && kind == MarkerKind::Answer => {
            let rest = view.text.get(*lead.steps.last()?..end)?.trim();
            Statement::Is(read_rest(view, rest)?)
        }
        None => return None,
    };
    Some(Announcement {
        at: marker.start,
        kind,
        statement,
    })
}

/// The answer after "Answer:" if more than a name follows: from the rest of the line, else from all the rest.
fn read_rest(view: &ReplyView<'_>, rest: &str) -> Option<Answer> {
    if rest.is_empty() {
        return None;
    }
    let line = rest.lines().next().unwrap_or_default();
    let [line, rest] = [line, rest]
        .map(|text| lenient::read_plain(&ReplyView::new(text, &fold(text), view.offered)));
    Some(match line {
        Answer::Unparsed(UnreadReason::NoChoice) => rest,
        line => line,
    })
}

/// The name that a marker leads to, and the answer that it gives in its context.
fn announced(view: &ReplyView<'_>, lead: &Lead) -> Option<(Name, Answer)> {
    let last_step = *lead.steps.last()?;
    let longer = |name: &Name| name.end - name.start > 1;
    let name = view
        .text_from(last_step)
        .filter(longer)
        .or_else(|| letter_at(view, last_step))
        .or_else(|| lead.steps.iter().rev().find_map(|&at| view.text_at(at)))?;
    let after = &view.text[name.end..];
    if after.trim_start_matches([')', ']']).starts_with('?') {
        return None;
    }
    let Some(index) = name.choice else {
        return Some((name, Answer::Unparsed(UnreadReason::OutOfRange)));
    };
    let contradicts = |text: Name| text.choice != Some(index);
    let answer = if name.delimiting == Delimiting::Firm
        && view.labelled_text(&name).is_some_and(contradicts)
    {
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

/// Whether another choice follows as an alternative: "B or C", "B/C", "kitchen or bathroom".
pub(super) fn alternative(view: &ReplyView<'_>, name: &Name) -> bool {
    let Some(link) = ALTERNATIVE.find(&view.folded[name.end..]) else {
        return false;
    };
    let at = name.end + link.end();
    let other = letter_at(view, at).or_else(|| view.text_at(at));
    other.is_some_and(|other| other.choice != name.choice && !view.denies(&other))
}

/// The letter at a byte where one is expected: upper or lower case, with or without brackets.
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
        delimiting: Delimiting::Firm,
    };
    let after = right.chars().next();
    if continues_word(after)
        || hyphenated(left, right)
        || (after == Some('\'') && !turkish_copula(right))
    {
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

/// Names that the text after them calls the answer: "B is the correct answer".
fn confirmed<'a>(view: &'a ReplyView<'_>) -> impl Iterator<Item = Announcement> + 'a {
    let letters = view
        .letters
        .iter()
        .filter(|name| markers::confirms_letter(&view.folded[name.end..]));
    let texts = view
        .texts
        .iter()
        .filter(|name| markers::confirms_text(&view.folded[name.end..]));
    letters
        .chain(texts)
        .filter(|name| !view.denies(name))
        .map(|name| Announcement {
            at: name.start,
            kind: MarkerKind::Answer,
            statement: Statement::Is(match name.choice {
                Some(index) => Answer::Chosen(index),
                None => Answer::Unparsed(UnreadReason::OutOfRange),
            }),
        })
}
