//! Stretches of a text in which names are taken out of the running: [`excluded`].

use super::reach::ends;
use crate::named::Names;
use crate::text::words::Role;
use crate::text::{Boundary, Clauses, Element, Ranges};

/// The names that "rule out" and its like exclude: those behind it in its clause; and before "can be ruled out" and its like,
/// those of its clause.
pub(crate) fn excluded(clauses: &Clauses<'_>, names: &Names<'_>) -> Ranges {
    let mut exclusions = Exclusions {
        clauses,
        names,
        open: None,
        clause: 0,
        before_colon: 0,
        before_bracket: 0,
        ranges: Vec::new(),
    };
    for (at, element) in clauses.elements.iter().enumerate() {
        if ends(clauses, names, exclusions.open, at) {
            exclusions.close(element.start);
        }
        exclusions.begin_clause(at, element);
        exclusions.word(at, element);
    }
    exclusions.close(clauses.folded.len());
    Ranges::new(exclusions.ranges)
}

/// The stretches in which names are excluded, found from left to right.
struct Exclusions<'a> {
    clauses: &'a Clauses<'a>,
    names: &'a Names<'a>,
    /// First byte of the reach of a denial that is not over.
    open: Option<usize>,
    /// First byte of the clause.
    clause: usize,
    /// First byte of the clause before the last colon.
    before_colon: usize,
    /// First byte of the clause before the last bracket.
    before_bracket: usize,
    ranges: Vec<(usize, usize)>,
}

impl Exclusions<'_> {
    fn close(&mut self, end: usize) {
        self.ranges
            .extend(self.open.take().map(|start| (start, end)));
    }

    /// Follows the beginning of the clause. What stands in brackets is one of its own.
    fn begin_clause(&mut self, at: usize, element: &Element) {
        if element.cuts() {
            self.before_colon = if self.clauses.is_sign(at, &[':']) {
                self.clause
            } else {
                element.end
            };
            self.clause = element.end;
        } else if self.clauses.is_sign(at, &['(']) {
            self.before_bracket = self.clause;
            self.clause = element.end;
        } else if self.clauses.is_sign(at, &[')']) {
            self.clause = self.before_bracket.max(self.before_colon);
        } else if element.boundary == Boundary::Part && element.has(Role::Subordinate) {
            self.clause = element.end;
        }
    }

    /// Begins the reach of a denial, or excludes what stands before a predicate.
    fn word(&mut self, at: usize, element: &Element) {
        let next = self.clauses.elements.get(at + 1);
        // "The wrong answer is A", "Wrong: A".
        let announces = self.clauses.is_sign(at + 1, &[':'])
            || next.is_some_and(|next| next.has(Role::Candidate));
        let mut opens = element.has(Role::Exclude) || (element.has(Role::Untrue) && announces);
        if let Some(start) = self.subject(at) {
            self.ranges.push((start, element.start));
            if self.names.any(start, element.start) && !self.clauses.is_sign(at - 1, &[',']) {
                return;
            }
            // "It would be wrong to say A".
            opens |= next.is_some_and(|next| next.boundary == Boundary::None);
        }
        if opens {
            self.open.get_or_insert(element.end);
        }
    }

    /// First byte of what a predicate of denial excludes: "A and C can be excluded", "A: wrong".
    fn subject(&self, at: usize) -> Option<usize> {
        let (clauses, elements) = (self.clauses, &self.clauses.elements);
        let element = &elements[at];
        let next = elements.get(at + 1);
        let last = next.is_none_or(|next| next.boundary > Boundary::None || next.has(Role::And));
        if !(element.has(Role::Excluded) || element.has(Role::ExcludedLast) && last) {
            return None;
        }
        let verb = clauses.verb_before(at)?;
        if elements[verb].has(Role::Copula) {
            let is_named = self.names.any(self.clause, element.start);
            // "It is wrong" refers to the last name.
            let pronoun = !is_named && last && self.is_pronoun(verb);
            return Some(
                self.names
                    .last_before(element.start)
                    .filter(|_| pronoun)
                    .unwrap_or(self.clause),
            );
        }
        // Without a verb, it is a predicate only directly after a name.
        let joints = [':', '-', '–', '—', '(', ',', '=', '→', ')', ']'];
        let mut name = verb;
        while name > 0 && clauses.is_sign(name, &joints) {
            name -= 1;
        }
        let end = elements[name].end;
        self.names.start_of(end)?;
        Some(if self.clause < end {
            self.clause
        } else {
            self.before_colon.min(end)
        })
    }

    /// Whether the clause of a verb has nothing but a pronoun before it.
    fn is_pronoun(&self, verb: usize) -> bool {
        let elements = &self.clauses.elements;
        elements[..=verb]
            .iter()
            .rev()
            .take_while(|element| element.start >= self.clause)
            .all(|element| {
                element
                    .roles
                    .has_any(&[Role::Pronoun, Role::Adverb, Role::Copula, Role::Modal])
            })
    }
}
