//! [`stated`]: announced answers, as "the answer is B", "Answer: kitchen", "I'd go with (B)", "B is correct".

use super::lenient;
use crate::choice::letters::{AFTER_A, AFTER_I, is_abbreviated, is_called_letter, is_hyphenated};
use crate::choice::markers::{self, Lead, Marker, MarkerKind};
use crate::choice::names::{Delimiting, Name, NameState, continues_word, index_of_letter};
use crate::choice::text::fold;
use crate::choice::text::words::Role;
use crate::choice::view::ReplyView;
use darkqa_base::types::questions::{Answer, UnreadReason};

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
    /// The answer, or the reason why the text in its place cannot be parsed.
    Is(Answer),
    /// The choice is not the answer.
    IsNot(usize),
}

/// The answer that a text announces: the last statement of the answer, otherwise the only decision, otherwise the only
/// mention.
pub(super) fn stated(view: &ReplyView<'_>) -> Option<Answer> {
    let mut found: Vec<Marker> = markers::markers(view.folded).chain(leftovers(view)).collect();
    found.sort_by_key(|marker| marker.start);
    let mut announcements: Vec<Announcement> = confirmed(view).collect();
    let mut end = view.text.len();
    for marker in found.into_iter().rev() {
        // Questions, counterfactuals and repetitions of the prompt announce nothing.
        if matches!(view.state(marker.start), NameState::Questioned | NameState::Conditional | NameState::Repeated) {
            continue;
        }
        announcements.extend(announcement(view, marker, end));
        if marker.kind == MarkerKind::Answer {
            end = marker.start;
        }
    }
    announcements.sort_by_key(|announcement| announcement.at);
    let [answers, decisions, mentions] = [MarkerKind::Answer, MarkerKind::Decision, MarkerKind::Mention]
        .map(|kind| announcements.iter().filter(|announcement| announcement.kind == kind).copied().collect::<Vec<_>>());
    last_answer(view, &answers).or_else(|| only_choice(&decisions, None)).or_else(|| only_choice(&mentions, Some(view)))
}

/// Markers such as "which leaves", after a choice was denied: "A and C are out, which leaves B".
fn leftovers<'a>(view: &'a ReplyView<'_>) -> impl Iterator<Item = Marker> + 'a {
    let first = view
        .names
        .all()
        .filter(|name| matches!(name.state, NameState::Denied | NameState::Excluded))
        .map(|name| name.start)
        .min()
        .unwrap_or(usize::MAX);
    view.clauses
        .elements
        .iter()
        .filter(move |element| element.has(Role::Leaves) && element.start > first)
        .map(|element| Marker { start: element.start, end: element.end, kind: MarkerKind::Remainder })
}

/// The last answer that is stated, unless it is denied later. Answers that could not be read are ignored if others
/// could be read.
fn last_answer(view: &ReplyView<'_>, announcements: &[Announcement]) -> Option<Answer> {
    let mut answers = announcements.iter().rev().filter_map(|announcement| match announcement.statement {
        Statement::Is(answer) => Some((announcement.at, answer)),
        Statement::IsNot(_) => None,
    });
    let last = answers.clone().next();
    let (at, answer) = answers
        .find(|(_, answer)| !matches!(answer, Answer::Unparsed(UnreadReason::NoChoice | UnreadReason::Refused)))
        .or(last)?;
    let Answer::Chosen(chosen) = answer else {
        return Some(answer);
    };
    Some(
        if announcements
            .iter()
            .any(|announcement| announcement.at > at && announcement.statement == Statement::IsNot(chosen))
            || view
                .names
                .all()
                .any(|name| name.start > at && name.choice == Some(chosen) && name.state == NameState::Excluded)
        {
            Answer::Unparsed(UnreadReason::Negated)
        } else {
            answer
        },
    )
}

/// The only choice that is announced. With a view, another choice in the reply, named by a letter or affirmed by its
/// text, makes the answer ambiguous.
fn only_choice(announcements: &[Announcement], view: Option<&ReplyView<'_>>) -> Option<Answer> {
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
    let names_other = view.is_some_and(|view| {
        view.names
            .letters
            .iter()
            .filter(|name| name.state.counts())
            .chain(view.affirmed_texts())
            .any(|name| name.choice != Some(chosen))
    });
    Some(if names_other { Answer::Unparsed(UnreadReason::Ambiguous) } else { Answer::Chosen(chosen) })
}

/// The announcement after a marker; `end` is the byte at which the next answer is announced.
fn announcement(view: &ReplyView<'_>, marker: Marker, end: usize) -> Option<Announcement> {
    let lead = markers::lead(&view.clauses, marker.end);
    let kind = match marker.kind {
        MarkerKind::Answer if !lead.is_linked => MarkerKind::Mention,
        MarkerKind::Remainder => MarkerKind::Answer,
        kind => kind,
    };
    let statement = match announced_name(view, &lead) {
        Some((name, answer)) => match view.state(name.start) {
            NameState::Affirmed => Statement::Is(answer),
            NameState::Denied => Statement::IsNot(name.choice?),
            NameState::Excluded
            | NameState::ImageColor
            | NameState::Conditional
            | NameState::Questioned
            | NameState::Repeated => {
                return None;
            }
        },
        None if lead.has_colon && kind == MarkerKind::Answer => {
            let rest = view.text.get(*lead.steps.last()?..end)?.trim();
            Statement::Is(read_rest(view, rest)?)
        }
        None => return None,
    };
    Some(Announcement { at: marker.start, kind, statement })
}

/// The answer after "Answer:" if more than a name follows: from the rest of the line, otherwise from the rest of the
/// text.
fn read_rest(view: &ReplyView<'_>, rest: &str) -> Option<Answer> {
    if rest.is_empty() {
        return None;
    }
    let line = rest.lines().next().unwrap_or_default();
    let [line, rest] = [line, rest].map(|text| lenient::read_plain(&ReplyView::new(text, &fold(text), view.offered)));
    Some(match line {
        Answer::Unparsed(UnreadReason::NoChoice) => rest,
        line => line,
    })
}

/// The name after a marker, and the answer that it gives in its context.
fn announced_name(view: &ReplyView<'_>, lead: &Lead) -> Option<(Name, Answer)> {
    let last_step = *lead.steps.last()?;
    let name = view
        .names
        .text_from(last_step)
        .filter(|name| name.end - name.start > 1)
        .or_else(|| letter_at(view, last_step))
        .or_else(|| lead.steps.iter().rev().find_map(|&at| view.names.text_at(at)))?;
    let after = &view.text[name.end..];
    if after.trim_start_matches([')', ']']).starts_with('?') {
        return None;
    }
    let Some(index) = name.choice else {
        return Some((name, Answer::Unparsed(UnreadReason::OutOfRange)));
    };
    let answer = if name.delimiting == Delimiting::Firm
        && view.names.labelled_text(&name).is_some_and(|text| text.choice != Some(index))
    {
        Answer::Unparsed(UnreadReason::Contradiction)
    } else if has_alternative(view, &name) {
        Answer::Unparsed(UnreadReason::Ambiguous)
    } else {
        Answer::Chosen(index)
    };
    Some((name, answer))
}

/// True if another choice follows as an alternative: "B or C", "B/C", "kitchen or bathroom".
pub(super) fn has_alternative(view: &ReplyView<'_>, name: &Name) -> bool {
    let clauses = &view.clauses;
    let mut at = clauses.index(name.end);
    while clauses.is_sign(at, &[')', ']', '.']) {
        at += 1;
    }
    let comma = clauses.is_sign(at, &[',']);
    at += usize::from(comma);
    let joined = clauses.is_sign(at, &['/', '&', '+', ';', '、'])
        || clauses.elements.get(at).is_some_and(|element| element.roles.has_any(&[Role::Or, Role::And]));
    at += usize::from(joined);
    if !comma && !joined {
        return false;
    }
    while clauses.elements.get(at).is_some_and(|element| element.has(Role::Hedge)) {
        at += 1;
    }
    let Some(element) = clauses.elements.get(at) else {
        return false;
    };
    let other = letter_at(view, element.start).or_else(|| view.names.text_at(element.start));
    other.is_some_and(|other| other.choice != name.choice && view.state(other.start) == NameState::Affirmed)
}

/// The letter at a byte where one is expected: upper or lower case, with or without brackets.
fn letter_at(view: &ReplyView<'_>, at: usize) -> Option<Name> {
    let open = view.text[at..].starts_with(['(', '[']);
    let start = at + usize::from(open);
    let letter = view.text[start..].chars().next().filter(char::is_ascii_alphabetic)?;
    let (left, right) = (&view.text[..start], &view.text[start + 1..]);
    let name = Name {
        start,
        end: start + 1,
        choice: index_of_letter(letter).filter(|index| *index < view.offered.texts.len()),
        delimiting: Delimiting::Firm,
        state: NameState::Affirmed,
    };
    let after = right.chars().next();
    if continues_word(after)
        || is_hyphenated(left, right)
        || is_abbreviated(left, right)
        || (after == Some('\'') && !has_turkish_copula(right))
    {
        return None;
    }
    let words = right.trim_start_matches(' ');
    let ends = words.len() == right.len() || words.is_empty() || words.starts_with(['(', '-', '–', '—', '\n']);
    let fits = match letter {
        _ if open || ends || (letter.is_ascii_uppercase() && is_called_letter(left)) => true,
        'A' | 'a' => AFTER_A.is_match(words),
        'I' | 'i' => AFTER_I.is_match(words),
        'a'..='z' => AFTER_A.is_match(words) || view.names.labelled_text(&name).is_some(),
        _ => true,
    };
    fits.then_some(name)
}

/// True if a Turkish "is" follows, joined by an apostrophe: "B'dir", "C'tir".
fn has_turkish_copula(right: &str) -> bool {
    ["'dir", "'dır", "'dur", "'dür", "'tir", "'tır"].iter().any(|end| right.starts_with(end))
}

/// Announcements of names that are confirmed by the text after them: "B is the correct answer", "only B remains".
fn confirmed<'a>(view: &'a ReplyView<'_>) -> impl Iterator<Item = Announcement> + 'a {
    let letters = view
        .names
        .letters
        .iter()
        .filter(|name| markers::confirms_letter(&view.folded[name.end..]) || remains(view, name));
    let texts =
        view.names.texts.iter().filter(|name| markers::confirms_text(&view.folded[name.end..]) || remains(view, name));
    letters.chain(texts).filter(|name| name.is_affirmed()).map(|name| Announcement {
        at: name.start,
        kind: MarkerKind::Answer,
        statement: Statement::Is(match name.choice {
            Some(index) => Answer::Chosen(index),
            None => Answer::Unparsed(UnreadReason::OutOfRange),
        }),
    })
}

/// Maximum number of elements from "only" to a name: "only option B".
const ONLY_WITHIN: usize = 3;

/// True if a name is stated to be the only one that remains: "only B remains", or "B remains" after an excluded name.
fn remains(view: &ReplyView<'_>, name: &Name) -> bool {
    let elements = &view.clauses.elements;
    let mut behind = view.clauses.index(name.end);
    while view.clauses.is_sign(behind, &[')', ']']) {
        behind += 1;
    }
    let Some(verb) = elements.get(behind).filter(|element| element.has(Role::Remains)) else {
        return false;
    };
    let first = view.clauses.index(name.start);
    let only =
        elements[first.saturating_sub(ONLY_WITHIN)..first].iter().any(|element| element.slice(view.folded) == "only");
    let verb = verb.slice(view.folded);
    let is_left = verb.starts_with("remain") || verb.ends_with("left");
    only || (is_left && view.names.all().any(|other| other.state == NameState::Excluded && other.start < name.start))
}
