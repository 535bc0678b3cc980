//! The end of the scope of an exclusion or a question: [`ends_scope`].

use crate::choice::name_index::Names;
use crate::choice::text::words::Role;
use crate::choice::text::{Boundary, Clauses, TokenKind};

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
