//! Stretches of a text in which names are denied, and stay in the way of other names: [`denied`].

use crate::named::Names;
use crate::text::words::Role;
use crate::text::{Boundary, Clauses, Ranges};

/// The names that "not" and its like deny: those behind it in its part of a clause, and the one directly before it.
pub(crate) fn denied(clauses: &Clauses<'_>, names: &Names<'_>) -> Ranges {
    Ranges::new([before(clauses), behind(clauses, names)].concat())
}

/// Number of elements in which "no lamp, sofa, or table" is recognized behind a comma.
const LIST_WITHIN: usize = 24;

/// Number of elements of an item of such a list.
const ITEM_WORDS: usize = 3;

/// The reach of "not" and its like: to the end of the clause's part. A comma directly behind "not" does not end it ("it is
/// not, I think, a kitchen"), nor one in a list that ends with "or".
fn before(clauses: &Clauses<'_>) -> Vec<(usize, usize)> {
    let elements = &clauses.elements;
    let mut ranges = Vec::new();
    let mut open: Option<usize> = None;
    // Index of the element up to which no part of the clause ends the reach.
    let mut until = 0;
    for (at, element) in elements.iter().enumerate() {
        if let Some(start) = open
            && element.boundary > Boundary::None
        {
            if at >= until && at > 0 {
                until = passed(clauses, at).unwrap_or(0);
            }
            // "Not the answer: B".
            let heading =
                at > 0 && clauses.is_sign(at, &[':']) && elements[at - 1].has(Role::Candidate);
            if (element.cuts() || at >= until) && !heading {
                ranges.push((start, element.start));
                open = None;
            }
        }
        if element.has(Role::Not) {
            open.get_or_insert(element.end);
        }
    }
    ranges.extend(open.map(|start| (start, clauses.folded.len())));
    ranges
}

/// Number of elements of a parenthesis between two commas.
const PARENTHESIS_WITHIN: usize = 12;

/// The index behind what a sign begins, if the reach of "not" passes it: a bracket directly behind "not", a parenthesis between
/// two commas directly behind it, or the rest of a list.
fn passed(clauses: &Clauses<'_>, at: usize) -> Option<usize> {
    let before = clauses.elements[at - 1];
    let word = before.slice(clauses.folded);
    if clauses.is_sign(at, &['(']) {
        return before.has(Role::Not).then_some(at + 1);
    }
    if !clauses.is_sign(at, &[',']) {
        return None;
    }
    if word == "not" || word.ends_with("n't") {
        let within = at + 1..at + PARENTHESIS_WITHIN;
        return Some(
            within
                .into_iter()
                .find(|at| clauses.is_sign(*at, &[',']))
                .unwrap_or(at)
                + 1,
        );
    }
    list(clauses, at)
}

/// The index behind a list of short items that goes on behind a comma and ends with "or" or "nor".
fn list(clauses: &Clauses<'_>, comma: usize) -> Option<usize> {
    let mut words = 0;
    let mut closes = false;
    for (at, element) in clauses
        .elements
        .iter()
        .enumerate()
        .skip(comma + 1)
        .take(LIST_WITHIN)
    {
        let is_comma = clauses.is_sign(at, &[',']);
        if element.boundary > Boundary::None && (!is_comma || closes) {
            return closes.then_some(at);
        }
        if is_comma {
            words = 0;
            continue;
        }
        closes |= element.has(Role::Or) || element.slice(clauses.folded) == "nor";
        words += 1;
        if words > ITEM_WORDS && !closes {
            return None;
        }
    }
    closes.then_some(clauses.elements.len())
}

/// The names directly before "not": "B is not correct", "kitchen isn't", "B is no option", "C不是".
fn behind(clauses: &Clauses<'_>, names: &Names<'_>) -> Vec<(usize, usize)> {
    let elements = &clauses.elements;
    let mut ranges = Vec::new();
    for at in 1..elements.len() {
        let Some(mut before) = subject_end(clauses, at) else {
            continue;
        };
        if before > 0 && elements[before].has(Role::Modal) {
            before -= 1;
        }
        while before > 0 && clauses.is_sign(before, &[')', ']']) {
            before -= 1;
        }
        let subject = elements[before];
        // A lower-case letter may be a name as well: "answer c is wrong".
        let letter = (subject.start + 1 == subject.end).then_some(subject.start);
        let start = names.start_of(subject.end).or(letter);
        ranges.extend(start.map(|start| (start, subject.end)));
    }
    ranges
}

/// Index of the element before a denial of the subject and its verb; `None` if an element is none.
fn subject_end(clauses: &Clauses<'_>, at: usize) -> Option<usize> {
    let elements = &clauses.elements;
    let element = &elements[at];
    let word = element.slice(clauses.folded);
    let before = at - 1;
    if element.has(Role::NotBehind)
        || (element.has(Role::Not) && (word.ends_with("n't") || word.starts_with("can")))
    {
        return Some(before);
    }
    if element.has(Role::Absent) {
        let verb = clauses.verb_before(at).filter(|verb| *verb > 0);
        let verb = verb.filter(|verb| elements[*verb].has(Role::Copula));
        if let Some(verb) = verb {
            return Some(verb - 1);
        }
    }
    let next = elements.get(at + 1);
    let ends = next.is_none_or(|next| next.boundary > Boundary::None);
    if matches!(word, "not" | "never") {
        let verb = elements[before].has(Role::Modal) && before > 0;
        // "The kitchen, never."
        let comma = ends && before > 0 && clauses.is_sign(before, &[',']);
        return (verb || ends).then_some(before - usize::from(verb || comma));
    }
    None
}
