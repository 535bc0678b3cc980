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
//!
//! [`stated`]: announced answers, as "the answer is B", "Answer: kitchen", "I'd go with (B)", "B is correct".
//!
//! Answers in structured form: JSON with an answer key, `\boxed{}`, `<answer>`.

use std::sync::LazyLock;

use regex::Regex;
use serde_json::Value;

use super::steps::{contradiction, first_line, ticked, without_unknown, yes_or_no};
use super::strict;
use crate::choice::choice_views::ChoiceViews;
use crate::choice::letters::{AFTER_A, AFTER_I, is_abbreviated, is_called_letter, is_hyphenated};
use crate::choice::markers::{self, Lead, Marker, MarkerKind};
use crate::choice::names::{Delimiting, Name, NameState, continues_word, index_of_letter};
use crate::choice::text::plain::compiled;
use crate::choice::text::tokens::Role;
use crate::choice::text::{declines, fold, plain};
use crate::choice::view::ReplyView;
use darkqa_base::types::questions::{Answer, Choices, UnreadReason};

/// The lenient parsing of a reply without its reasoning.
pub(crate) fn read(text: &str, choices: &Choices) -> Answer {
    let choices = ChoiceViews::new(choices);
    let tidy = plain::tidy(text);
    let tidy = without_unknown(&tidy);
    // If the model continues with a next question of its own, its answer is before that question.
    let first = plain::before_next_turn(&tidy).map(|before| steps(before, &choices));
    match first {
        None | Some(Answer::Unparsed(UnreadReason::NoChoice | UnreadReason::Refused)) => steps(&tidy, &choices),
        Some(answer) => answer,
    }
}

/// All levels, on a text from [`plain::tidy`].
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
fn read_part(text: &str, choices: &ChoiceViews) -> Answer {
    let text = plain(text);
    read_plain(&ReplyView::new(&text, &fold(&text), choices))
}

/// The levels for plain text: a reply without markup, or a value in JSON, LaTeX or a tag.
fn read_plain(view: &ReplyView<'_>) -> Answer {
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
    let [line, rest] = [line, rest].map(|text| read_plain(&ReplyView::new(text, &fold(text), view.offered)));
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
fn has_alternative(view: &ReplyView<'_>, name: &Name) -> bool {
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

/// JSON keys whose value is the answer, in lower case without spaces and punctuation.
const KEYS: [&str; 24] = [
    "answer",
    "ans",
    "choice",
    "option",
    "finalanswer",
    "correctanswer",
    "correctoption",
    "correctchoice",
    "answerchoice",
    "answeroption",
    "answerletter",
    "selectedoption",
    "selectedchoice",
    "selectedanswer",
    "selected",
    "selection",
    "chosenoption",
    "letter",
    "youranswer",
    "bestanswer",
    "finalchoice",
    "答案",
    "정답",
    "回答",
];

/// JSON keys of the answer inside an object that is the value of an answer key.
const INNER_KEYS: [&str; 5] = ["text", "label", "value", "name", "id"];

static TAGGED: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?is)(?:<(?:final[_ -]?)?(?:answer|choice|option)>|\[answer\])",
        r"(.*?)(?:</(?:final[_ -]?)?(?:answer|choice|option)>|\[/answer\]|\n\n|\z)"
    ))
});

/// Maximum length of a LaTeX box, in bytes. An answer is shorter.
const BOX_BYTES: usize = 2000;

/// The answer under an answer key in the JSON objects of a text. If any object has such a key, later levels are not
/// tried, even if its value cannot be parsed.
pub(super) fn json(tidy: &str, choices: &ChoiceViews) -> Option<Answer> {
    let mut answers = Vec::new();
    let mut from = 0;
    while let Some(at) = tidy[from..].find('{') {
        let start = from + at;
        let mut values = serde_json::Deserializer::from_str(&tidy[start..]).into_iter::<Value>();
        // The cost of a failed attempt is limited by the depth, which `serde_json` bounds, so the scan stays linear.
        from = match values.next() {
            Some(Ok(value)) => {
                for (key, value) in value.as_object().into_iter().flatten() {
                    if KEYS.contains(&normalize_key(key).as_str()) {
                        answers.push(value_answer(value, choices));
                    }
                }
                start + values.byte_offset()
            }
            _ => start + 1,
        };
    }
    common_answer(&answers)
}

/// A key in lower case without spaces and punctuation.
fn normalize_key(key: &str) -> String {
    key.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// The answer in a JSON value. A number is parsed as a choice's text, never as its index.
fn value_answer(value: &Value, choices: &ChoiceViews) -> Answer {
    let unread = Answer::Unparsed(UnreadReason::NoChoice);
    match value {
        Value::String(text) => text_answer(text, choices),
        Value::Number(number) => text_answer(&number.to_string(), choices),
        Value::Array(values) => {
            let answers: Vec<Answer> = values.iter().map(|value| value_answer(value, choices)).collect();
            common_answer(&answers).unwrap_or(unread)
        }
        Value::Object(fields) => {
            let answers: Vec<Answer> = fields
                .iter()
                .filter(|(key, _)| {
                    let key = normalize_key(key);
                    KEYS.contains(&key.as_str()) || INNER_KEYS.contains(&key.as_str())
                })
                .map(|(_, value)| value_answer(value, choices))
                .collect();
            common_answer(&answers).unwrap_or(unread)
        }
        Value::Null | Value::Bool(_) => unread,
    }
}

/// The answer in `\boxed{…}` and `<answer>…</answer>`.
pub(super) fn boxed(tidy: &str, choices: &ChoiceViews) -> Option<Answer> {
    let tagged = TAGGED.captures_iter(tidy).filter_map(|found| found.get(1)).map(|inner| inner.as_str());
    let answers: Vec<Answer> = boxes(tidy)
        .chain(tagged)
        .filter(|inner| !inner.trim().is_empty())
        .map(|inner| text_answer(inner, choices))
        .collect();
    common_answer(&answers)
}

/// Contents of LaTeX boxes, up to the closing brace of each.
fn boxes(text: &str) -> impl Iterator<Item = &str> {
    const OPENINGS: [&str; 3] = ["\\boxed", "\\fbox", "\\framebox"];
    OPENINGS.into_iter().flat_map(move |opening| {
        text.match_indices(opening).filter_map(move |(at, _)| {
            let inner = text[at + opening.len()..].trim_start().strip_prefix('{')?;
            let inner = &inner[..inner.floor_char_boundary(BOX_BYTES)];
            let mut depth = 1_usize;
            inner
                .char_indices()
                .find(|(_, c)| {
                    match c {
                        '{' => depth += 1,
                        '}' => depth -= 1,
                        _ => {}
                    }
                    depth == 0
                })
                .map(|(end, _)| &inner[..end])
        })
    })
}

fn text_answer(text: &str, choices: &ChoiceViews) -> Answer {
    read_part(text, choices)
}

/// The answer on which all answers agree. Answers that could not be read are ignored if others could be read.
fn common_answer(answers: &[Answer]) -> Option<Answer> {
    let mut readable = answers.iter().filter(|answer| {
        !matches!(answer, Answer::Unparsed(UnreadReason::NoChoice | UnreadReason::Empty | UnreadReason::Refused))
    });
    let first = *readable.next().or(answers.first())?;
    let same = readable.all(|answer| *answer == first);
    Some(if same { first } else { Answer::Unparsed(UnreadReason::Ambiguous) })
}
