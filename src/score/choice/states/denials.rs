//! [`denied`]: ranges of a text in which choices are denied. A denied choice makes another choice ambiguous ("not A but
//! C").

use crate::choice::name_index::Names;
use crate::choice::text::words::Role;
use crate::choice::text::{Boundary, Clauses, Ranges};

/// Ranges of the names that words such as "not" deny: after the word in its part of the clause, and directly before it.
pub(crate) fn denied(clauses: &Clauses<'_>, names: &Names<'_>) -> Ranges {
    Ranges::new([scopes_after_not(clauses), subjects_before_not(clauses, names)].concat())
}

/// Maximum number of elements after the first comma of a list such as "no lamp, sofa, or table".
const LIST_WITHIN: usize = 24;

/// Maximum number of elements of an item in such a list.
const ITEM_WORDS: usize = 3;

/// Scopes of words such as "not", to the end of the part of the clause. A comma directly after "not" does not end the
/// scope ("it is not, I think, a kitchen"), nor does a comma in a list that ends with "or".
fn scopes_after_not(clauses: &Clauses<'_>) -> Vec<(usize, usize)> {
    let elements = &clauses.elements;
    let mut ranges = Vec::new();
    let mut open: Option<usize> = None;
    // Before this element, the end of a part of the clause does not end the scope.
    let mut until = 0;
    for (at, element) in elements.iter().enumerate() {
        if let Some(start) = open
            && element.boundary > Boundary::None
        {
            if at >= until && at > 0 {
                until = skip_insertion(clauses, at).unwrap_or(0);
            }
            // "Not the answer: B".
            let heading = at > 0 && clauses.is_sign(at, &[':']) && elements[at - 1].has(Role::Candidate);
            if (element.ends_clause() || at >= until) && !heading {
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

/// Maximum number of elements of a parenthesis between two commas.
const PARENTHESIS_WITHIN: usize = 12;

/// The index after the insertion that a sign begins, if the scope of "not" continues after it: a bracket or a
/// parenthesis between two commas directly after "not", or the rest of a list.
fn skip_insertion(clauses: &Clauses<'_>, at: usize) -> Option<usize> {
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
        return Some(within.into_iter().find(|at| clauses.is_sign(*at, &[','])).unwrap_or(at) + 1);
    }
    list_end(clauses, at)
}

/// The index after a list of short items that continues after a comma and ends with "or" or "nor".
fn list_end(clauses: &Clauses<'_>, comma: usize) -> Option<usize> {
    let mut words = 0;
    let mut closes = false;
    for (at, element) in clauses.elements.iter().enumerate().skip(comma + 1).take(LIST_WITHIN) {
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

/// Names directly before words such as "not": "B is not correct", "kitchen isn't", "B is no option", "C不是".
fn subjects_before_not(clauses: &Clauses<'_>, names: &Names<'_>) -> Vec<(usize, usize)> {
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
        let start = names.start_of_name_ending_at(subject.end).or(letter);
        ranges.extend(start.map(|start| (start, subject.end)));
    }
    ranges
}

/// Index of the last element of the subject that the element at `at` denies; `None` if the element denies no subject.
fn subject_end(clauses: &Clauses<'_>, at: usize) -> Option<usize> {
    let elements = &clauses.elements;
    let element = &elements[at];
    let word = element.slice(clauses.folded);
    let before = at - 1;
    if element.has(Role::NotBehind) || (element.has(Role::Not) && (word.ends_with("n't") || word.starts_with("can"))) {
        return Some(before);
    }
    if element.has(Role::Absent) {
        let verb = clauses.verb_before(at);
        if let Some(verb) = verb.filter(|verb| *verb > 0 && elements[*verb].has(Role::Copula)) {
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
