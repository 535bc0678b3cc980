//! Single steps of the lenient parsing.
//!
//! [`contradiction`]: a letter with the text of another choice, anywhere in a reply.
//!
//! [`first_line`]: a first line that is an answer on its own.
//!
//! Ticks, crosses and task lists: [`ticked`], [`without_unknown`].
//!
//! [`yes_or_no`]: a leading "yes" or "no".

use std::borrow::Cow;
use std::sync::LazyLock;

use regex::Regex;

use super::strict;
use crate::choice::names::{Delimiting, Name, NameState};
use crate::choice::text::Boundary;
use crate::choice::text::plain::compiled;
use crate::choice::text::tokens::Role;
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

/// The first line, if it parses strictly. It is ambiguous if another line parses strictly as another choice, or if
/// another choice follows a retraction ("On reflection, it is C").
pub(super) fn first_line(view: &ReplyView<'_>) -> Option<Answer> {
    let (line, rest) = view.text.split_once('\n')?;
    let index = strict_choice(view, line)?;
    if view.state(0) == NameState::Repeated {
        return None;
    }
    let mut at = line.len() + 1;
    let mut differs = false;
    for other in rest.lines() {
        let listed = view.state(at) != NameState::Affirmed;
        differs |= !listed && other != line && strict_choice(view, other).is_some_and(|other| other != index);
        at += other.len() + 1;
    }
    let is_retracted = view
        .clauses
        .elements
        .iter()
        .find(|element| element.start > line.len() && element.has(Role::Retraction))
        .is_some_and(|retraction| {
            view.names.all().any(|name| {
                name.start > retraction.start
                    && name.choice != Some(index)
                    && name.delimiting > Delimiting::Loose
                    && name.is_affirmed()
            })
        });
    Some(if differs || is_retracted { Answer::Unparsed(UnreadReason::Ambiguous) } else { Answer::Chosen(index) })
}

/// The choice that the strict parsing finds in a line.
fn strict_choice(view: &ReplyView<'_>, line: &str) -> Option<usize> {
    match strict::read(line.trim(), &view.offered.texts) {
        Some(Answer::Chosen(index)) => Some(index),
        _ => None,
    }
}

/// A mark for yes or no.
static MARK: LazyLock<Regex> = LazyLock::new(|| compiled(r"(?P<yes>[✓✔✅☑👍]|\[[xX]\])|(?P<no>[✗✘❌❎✖👎☐]|\[ \])"));

/// A mark that may mean either yes or no.
const UNKNOWN: char = '☒';

/// Meaning of a mark for the item next to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ItemMark {
    Yes,
    No,
}

/// The choices that a text ticks and crosses.
#[derive(Debug, Default)]
pub(super) struct Ticks {
    ticked: Vec<usize>,
    crossed: Vec<usize>,
    /// True if the text contains more than [`MAX_MARKS`] marks.
    has_too_many: bool,
}

/// Maximum number of marks that are parsed. A reply with more repeats itself and is not evaluated.
const MAX_MARKS: usize = 100;

impl Ticks {
    /// The only choice that is ticked. Without ticks, `stated` if it is not crossed. Several ticks, or a tick and
    /// another stated answer, are ambiguous. `None` if no item with a mark names a choice.
    pub(super) fn answer(&self, stated: Option<Answer>) -> Option<Answer> {
        let stated = stated.filter(|answer| matches!(answer, Answer::Chosen(_)));
        let ambiguous = Some(Answer::Unparsed(UnreadReason::Ambiguous));
        match (self.ticked.first(), stated) {
            _ if self.has_too_many => ambiguous,
            (None, _) if self.crossed.is_empty() => None,
            (None, Some(Answer::Chosen(index))) if !self.crossed.contains(&index) => stated,
            (None, _) => Some(Answer::Unparsed(UnreadReason::Negated)),
            (Some(first), _) if self.ticked.iter().any(|other| other != first) => ambiguous,
            (Some(first), _) if self.crossed.contains(first) => ambiguous,
            (Some(first), Some(answer)) if answer != Answer::Chosen(*first) => ambiguous,
            (Some(first), _) => Some(Answer::Chosen(*first)),
        }
    }
}

/// Removes the lines with a mark of unknown meaning.
pub(super) fn without_unknown(tidy: &str) -> Cow<'_, str> {
    if !tidy.contains(UNKNOWN) {
        return Cow::Borrowed(tidy);
    }
    let lines: Vec<&str> = tidy.lines().filter(|line| !line.contains(UNKNOWN)).collect();
    Cow::Owned(lines.join("\n"))
}

/// The ticked and crossed choices of a text; `read` parses an item. `None` without marks.
///
/// A line with one mark is one item. In a line with several marks, the items follow the marks if the line begins with a
/// mark, otherwise they precede the marks.
pub(super) fn ticked(tidy: &str, read: impl Fn(&str) -> Answer) -> Option<Ticks> {
    if !MARK.is_match(tidy) {
        return None;
    }
    let mut ticks = Ticks::default();
    if MARK.find_iter(tidy).nth(MAX_MARKS).is_some() {
        ticks.has_too_many = true;
        return Some(ticks);
    }
    for line in tidy.lines() {
        for (mark, item) in items(line) {
            let Answer::Chosen(index) = read(item.trim_matches([' ', '|', ':', ',', '-', '\t'])) else {
                continue;
            };
            match mark {
                ItemMark::Yes => ticks.ticked.push(index),
                ItemMark::No => ticks.crossed.push(index),
            }
        }
    }
    Some(ticks)
}

/// The items of a line, each with its mark.
fn items(line: &str) -> Vec<(ItemMark, &str)> {
    let marks: Vec<(ItemMark, usize, usize)> = MARK
        .captures_iter(line)
        .filter_map(|found| {
            let whole = found.get(0)?;
            let mark = if found.name("yes").is_some() { ItemMark::Yes } else { ItemMark::No };
            Some((mark, whole.start(), whole.end()))
        })
        .collect();
    let leads = marks.first().is_some_and(|(_, start, _)| is_blank(&line[..*start]));
    if let [(mark, start, end)] = *marks {
        let item = if leads {
            &line[end..]
        } else if is_blank(&line[end..]) {
            &line[..start]
        } else {
            line
        };
        return vec![(mark, item)];
    }
    let mut items = Vec::with_capacity(marks.len());
    for (at, (mark, start, end)) in marks.iter().enumerate() {
        let item = if leads {
            &line[*end..marks.get(at + 1).map_or(line.len(), |(_, next, _)| *next)]
        } else {
            &line[at.checked_sub(1).map_or(0, |before| marks[before].2)..*start]
        };
        items.push((*mark, item));
    }
    items
}

/// True if a text contains only spaces, bullets and table rules.
fn is_blank(text: &str) -> bool {
    text.trim_matches([' ', '\t', '|', '-', '*', '+', '•']).is_empty()
}

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
