//! Conditional and counterfactual parts of a text: [`conditional`].
//!
//! [`questioned`]: ranges of a text in which choices are questioned.
//!
//! [`repetitions`]: lists of all choices in a text, which only repeat the prompt.
//!
//! The end of the scope of an exclusion or a question: [`ends_scope`].

use std::ops::Range;

use crate::choice::choice_views::ChoiceViews;
use crate::choice::name_index::Names;
use crate::choice::names::Name;
use crate::choice::text::tokens::Role;
use crate::choice::text::{Boundary, Clauses, Element, Ranges, TokenKind};

/// Ranges of conditions with their main clauses, and of the words before phrases such as "would need". A condition that
/// only forces a choice ("if I had to guess") is not included.
pub(crate) fn conditional(clauses: &Clauses<'_>) -> Ranges {
    let mut ranges = Vec::new();
    let (mut first, mut unmet) = (0, false);
    let elements = &clauses.elements;
    for (at, element) in elements.iter().enumerate() {
        // A comma ends neither the condition nor its main clause, and a colon may stand between them.
        let is_colon = clauses.is_sign(at, &[':', '：']);
        if element.boundary == Boundary::Sentence || (element.ends_clause() && !is_colon) {
            let found = conditional_ranges(clauses, first..at, unmet && continues_condition(clauses, first));
            unmet = !found.is_empty();
            ranges.extend(found);
            first = at + 1;
        }
    }
    let last = unmet && continues_condition(clauses, first);
    ranges.extend(conditional_ranges(clauses, first..elements.len(), last));
    Ranges::new(ranges)
}

/// True if a clause continues the condition before it: "Suppose there is a stove; then it is a kitchen."
fn continues_condition(clauses: &Clauses<'_>, first: usize) -> bool {
    clauses.elements.get(first).is_some_and(|element| element.slice(clauses.folded) == "then")
}

/// The roles of a phrase about more light, such as "with better lighting".
const MORE_LIGHT: [Role; 3] = [Role::Given, Role::Better, Role::LightNoun];

/// The conditional ranges in the clauses with these elements; all of them if they continue an earlier condition.
fn conditional_ranges(clauses: &Clauses<'_>, all: std::ops::Range<usize>, continues: bool) -> Vec<(usize, usize)> {
    let elements = &clauses.elements[all];
    let (Some(first), Some(last)) = (elements.first(), elements.last()) else {
        return Vec::new();
    };
    let head = elements.iter().find(|element| !element.has(Role::And) && !element.has(Role::Adverb)).unwrap_or(first);
    // "Were it brighter, I would …", "I would …, were it brighter".
    let inverted = head.has(Role::Inverted)
        || (any_has(elements, Role::ModalPast)
            && elements
                .iter()
                .zip(&elements[1..])
                .any(|(before, element)| before.boundary > Boundary::None && element.has(Role::Inverted)));
    // "With more light".
    let in_light =
        elements.windows(MORE_LIGHT.len()).any(|words| words.iter().zip(MORE_LIGHT).all(|(word, role)| word.has(role)));
    if continues || in_light || any_has(elements, Role::Condition) || inverted || is_unmet(elements, head) {
        return vec![(first.start, last.end)];
    }
    let forced = any_has(elements, Role::Forced);
    let mut ranges = Vec::new();
    let (mut part, mut expects) = (first.start, None);
    for element in elements {
        if element.boundary == Boundary::Part {
            ranges.extend(expects.take().map(|start| (start, element.start)));
            part = element.end;
        }
        // In "a bedroom would have a bed" and "a kitchen if that is a stove", the whole part of the clause is
        // uncertain.
        if element.has(Role::Expected) || (element.has(Role::If) && !forced) {
            expects = Some(part);
        }
    }
    ranges.extend(expects.map(|start| (start, last.end)));
    ranges
}

/// True if an "if" makes all elements uncertain, because they begin with it or are counterfactual.
fn is_unmet(elements: &[Element], head: &Element) -> bool {
    any_has(elements, Role::If)
        && !any_has(elements, Role::Forced)
        && (head.has(Role::If) || any_has(elements, Role::ModalPast))
}

fn any_has(elements: &[Element], role: Role) -> bool {
    elements.iter().any(|element| element.has(role))
}

/// Ranges of sentences with a question mark, and of the words after phrases such as "whether" and "you asked". A reply
/// that is only a name with a question mark is an unsure answer and not a question.
pub(crate) fn questioned(clauses: &Clauses<'_>, names: &Names<'_>) -> Ranges {
    let mut ranges = Vec::new();
    let (mut sentence, mut open) = (0, None);
    let is_unsure_answer = is_bare_name(clauses, names);
    for (at, element) in clauses.elements.iter().enumerate() {
        if ends_scope(clauses, names, open, at) {
            ranges.extend(open.take().map(|start| (start, element.start)));
        }
        if clauses.is_sign(at, &['?', '？', '؟']) && !is_unsure_answer {
            ranges.push((sentence, element.end));
        }
        if element.boundary == Boundary::Sentence {
            sentence = element.end;
        }
        if element.has(Role::Question) {
            open.get_or_insert(element.end);
        }
    }
    ranges.extend(open.map(|start| (start, clauses.folded.len())));
    Ranges::new(ranges)
}

/// True if the text is a name with question marks: "Kitchen?", "(B)?", "B. kitchen?", "The kitchen?".
fn is_bare_name(clauses: &Clauses<'_>, names: &Names<'_>) -> bool {
    let text = clauses.folded.trim_end_matches(['?', '？', '؟', '!', '.', ' ']);
    if text.len() == clauses.folded.len() {
        return false;
    }
    let text_end = text.trim_end_matches([')', ']']).len();
    if names.text_at(0).is_some_and(|name| name.end == text_end) {
        return true;
    }
    let letter = names.letters.first().filter(|letter| text[..letter.start].trim_matches(['(', '[', ' ']).is_empty());
    letter.is_some_and(|letter| {
        let text = names.labelled_text(letter);
        letter.end == text_end || text.is_some_and(|text| text.end == text_end)
    })
}

/// Maximum number of bytes between two choices of a list.
const MAX_GAP: usize = 24;

/// Ranges that list all choices in the order shown, by text or letter, with only labels and separators between them. A
/// question with two choices needs more evidence of a list ([`is_list_of_two`]).
pub(crate) fn repetitions(names: &Names<'_>, offered: &ChoiceViews) -> Ranges {
    let count = offered.texts.len();
    let by_text = lists(names, &names.texts, count, offered);
    let by_letter = lists(names, &names.letters, count, offered);
    Ranges::new(by_text.into_iter().chain(by_letter).collect())
}

/// The lists among names of one kind.
fn lists(names: &Names<'_>, all: &[Name], count: usize, offered: &ChoiceViews) -> Vec<(usize, usize)> {
    let mut lists = Vec::new();
    // Index of the first name of the current list, and number of its names so far.
    let (mut first, mut length) = (0, 0);
    for (at, name) in all.iter().enumerate() {
        let follows =
            length > 0 && name.choice == Some(length) && is_separator(names.folded, all[at - 1].end, name.start);
        if follows {
            length += 1;
        } else {
            (first, length) = (at, usize::from(name.choice == Some(0)));
        }
        if length == count {
            let (start, end) = with_labels(names.folded, all[first].start, name.end);
            if count > 2 || is_list_of_two(names, offered, &all[first..=at], start..end) {
                lists.push((start, end));
            }
            length = 0;
        }
    }
    lists
}

/// True if the text between two bytes consists of separators, labels and words such as "and".
fn is_separator(folded: &str, start: usize, end: usize) -> bool {
    let Some(gap) = folded.get(start..end).filter(|gap| gap.len() <= MAX_GAP) else {
        return false;
    };
    !gap.is_empty()
        && !gap.contains(['?', '!'])
        && gap
            .split(|c: char| !c.is_alphabetic())
            .all(|word| word.len() <= 1 || matches!(word, "and" | "or" | "the" | "an" | "option" | "choice"))
}

/// The range of a list, extended by the label before its first choice and the one after its last.
fn with_labels(folded: &str, start: usize, end: usize) -> (usize, usize) {
    let before = folded[..start].trim_end_matches(['(', '[', ')', ']', '.', ':', '-', ' ']);
    let label = before.ends_with('a') && !before[..before.len() - 1].ends_with(char::is_alphanumeric);
    let after = &folded[end..];
    let label_after = after
        .trim_start_matches(' ')
        .strip_prefix(['(', '['])
        .and_then(|rest| rest.get(1..2))
        .is_some_and(|close| matches!(close, ")" | "]"));
    (
        if label { before.len() - 1 } else { start },
        if label_after { end + after.len() - after.trim_start_matches(' ').len() + 3 } else { end },
    )
}

/// True if two choices are listed rather than stated in a sentence: with a heading or labels, alone on a line, or as
/// "yes or no".
fn is_list_of_two(names: &Names<'_>, offered: &ChoiceViews, list: &[Name], span: Range<usize>) -> bool {
    let Range { start, end } = span;
    let folded = names.folded;
    let (before, after) = (folded[..start].trim_end_matches(' '), folded[end..].trim_start_matches(['.', ' ']));
    let last_word = before.trim_end_matches(':').rsplit(|c: char| !c.is_alphabetic()).next();
    let headed = before.ends_with(':') && matches!(last_word, Some("options" | "choices" | "answers"));
    let labels = names
        .letters
        .iter()
        .filter(|letter| (start..end).contains(&letter.start))
        .filter(|letter| names.labelled_text(letter).is_some());
    let labelled = start < list[0].start && labels.count() >= 2;
    let gap = folded[list[0].end..list[1].start].trim();
    let paired = offered.yes_no.is_some() && matches!(gap, "or" | "/" | "and/or");
    let whole = (before.is_empty() || before.ends_with('\n')) && (after.is_empty() || after.starts_with('\n'));
    headed || labelled || paired || (whole && !gap.is_empty() && !gap.contains('.'))
}

/// True if the scope that begins at byte `open` ends at the element at `at`; false without an open scope.
///
/// A scope ends with its clause and at "only … remains". After a name it also ends at "leaves" and at a comma before an
/// independent clause ("I rule out A, it is B"). It does not end at a colon before the first name ("Ruled out: A"), nor
/// at the line breaks of a list after such a colon.
pub(super) fn ends_scope(clauses: &Clauses<'_>, names: &Names<'_>, open: Option<usize>, at: usize) -> bool {
    let Some(open) = open else {
        return false;
    };
    let element = &clauses.elements[at];
    match element.boundary {
        Boundary::None => (element.has(Role::Leaves) && names.any(open, element.start)) || only_remains(clauses, at),
        Boundary::Part => {
            let next = clauses.elements.get(at + 1);
            clauses.is_sign(at, &[','])
                && next.is_some_and(|next| next.has(Role::Assertion))
                && names.any(open, element.start)
        }
        Boundary::Clause | Boundary::Sentence => {
            let colon = clauses.is_sign(at, &[':']) || (at > 0 && clauses.is_sign(at - 1, &[':']));
            (!colon || names.any(open, element.start)) && !is_in_list(clauses, names, open, at)
        }
    }
}

/// Maximum number of elements between "only" and "remains".
const REMAINS_WITHIN: usize = 6;

/// True if "only … remains" begins at the element.
fn only_remains(clauses: &Clauses<'_>, at: usize) -> bool {
    clauses.elements[at].slice(clauses.folded) == "only"
        && clauses.elements[at + 1..]
            .iter()
            .take(REMAINS_WITHIN)
            .take_while(|element| !element.ends_clause())
            .any(|element| element.has(Role::Remains))
}

/// Maximum number of elements in a line of a list.
const LINE_WORDS: usize = 4;

/// True if the element is a line break before another line of a list of names; the list begins on a new line after byte
/// `open`.
fn is_in_list(clauses: &Clauses<'_>, names: &Names<'_>, open: usize, at: usize) -> bool {
    let elements = &clauses.elements;
    let first = names.first_start(open).map(|start| clauses.index(start));
    let begins_line = first.is_some_and(|first| {
        elements[first.saturating_sub(2)..first]
            .iter()
            .any(|before| before.kind == TokenKind::Break && before.start >= open)
    });
    if elements[at].kind != TokenKind::Break || !begins_line {
        return false;
    }
    let line: Vec<_> =
        elements[at + 1..].iter().take(LINE_WORDS + 1).take_while(|element| element.kind != TokenKind::Break).collect();
    let (Some(start), Some(end)) = (line.first(), line.last()) else {
        return false;
    };
    line.len() <= LINE_WORDS && names.any(start.start, end.end)
}
