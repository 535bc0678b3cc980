//! How far a denial or a question reaches: [`ends`].

use crate::named::Names;
use crate::text::words::Role;
use crate::text::{Boundary, Clauses, TokenKind};

/// Whether the reach of a denial that begins at byte `open` ends at an element.
///
/// It ends with the clause, at "leaves" or "only … remains", and at a comma that begins a clause of its own; all but the first
/// behind a name ("I rule out A, it is B"). A colon before the first name does not end it ("Ruled out: A"), nor do the line
/// breaks of a list behind such a colon.
pub(super) fn ends(
    clauses: &Clauses<'_>,
    names: &Names<'_>,
    open: Option<usize>,
    at: usize,
) -> bool {
    let Some(open) = open else {
        return false;
    };
    let element = &clauses.elements[at];
    let named = || names.any(open, element.start);
    let comma = || {
        let next = clauses.elements.get(at + 1);
        clauses.is_sign(at, &[',']) && next.is_some_and(|next| next.has(Role::Assertion))
    };
    match element.boundary {
        Boundary::None => (element.has(Role::Leaves) && named()) || only_remains(clauses, at),
        Boundary::Part => comma() && named(),
        Boundary::Clause | Boundary::Sentence => {
            let colon = clauses.is_sign(at, &[':']) || (at > 0 && clauses.is_sign(at - 1, &[':']));
            (!colon || named()) && !is_in_list(clauses, names, open, at)
        }
    }
}

/// Number of elements between "only" and "remains".
const REMAINS_WITHIN: usize = 6;

/// Whether "only … remains" begins at an element.
fn only_remains(clauses: &Clauses<'_>, at: usize) -> bool {
    let ahead = clauses.elements[at + 1..].iter().take(REMAINS_WITHIN);
    clauses.elements[at].slice(clauses.folded) == "only"
        && ahead
            .take_while(|element| !element.cuts())
            .any(|element| element.has(Role::Remains))
}

/// Maximum number of elements of a line of a list.
const LINE_WORDS: usize = 4;

/// Whether a line break stands between two lines of a list of names that begins on a line of its own behind byte `open`.
fn is_in_list(clauses: &Clauses<'_>, names: &Names<'_>, open: usize, at: usize) -> bool {
    let elements = &clauses.elements;
    let is_break = |at: usize| elements[at].kind == TokenKind::Break;
    let first = names.first_from(open).map(|start| clauses.index(start));
    let begins_line = first.is_some_and(|first| {
        (first.saturating_sub(2)..first)
            .any(|before| is_break(before) && elements[before].start >= open)
    });
    if !is_break(at) || !begins_line {
        return false;
    }
    let line: Vec<_> = elements[at + 1..]
        .iter()
        .take(LINE_WORDS + 1)
        .take_while(|element| element.kind != TokenKind::Break)
        .collect();
    let (Some(start), Some(end)) = (line.first(), line.last()) else {
        return false;
    };
    line.len() <= LINE_WORDS && names.any(start.start, end.end)
}
