//! [`excluded`]: ranges of a text in which choices are ruled out.

use super::scope::ends_scope;
use crate::choice::name_index::Names;
use crate::choice::text::words::Role;
use crate::choice::text::{Boundary, Clauses, Element, Ranges};

/// Ranges that phrases such as "rule out" exclude (the rest of the clause) and phrases such as "can be ruled out" (the
/// clause before them).
pub(crate) fn excluded(clauses: &Clauses<'_>, names: &Names<'_>) -> Ranges {
    let mut exclusions =
        Exclusions { clauses, names, open: None, clause: 0, before_colon: 0, before_bracket: 0, ranges: Vec::new() };
    for (at, element) in clauses.elements.iter().enumerate() {
        if ends_scope(clauses, names, exclusions.open, at) {
            exclusions.close(element.start);
        }
        exclusions.begin_clause(at, element);
        exclusions.apply_word(at, element);
    }
    exclusions.close(clauses.folded.len());
    Ranges::new(exclusions.ranges)
}

/// A scan of a text from left to right for ranges in which names are excluded.
struct Exclusions<'a> {
    clauses: &'a Clauses<'a>,
    names: &'a Names<'a>,
    /// First byte of the scope of an exclusion that has not ended yet.
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
    /// Ends the open scope, if any.
    fn close(&mut self, end: usize) {
        self.ranges.extend(self.open.take().map(|start| (start, end)));
    }

    /// Tracks the start of the current clause. Text in brackets is a separate clause.
    fn begin_clause(&mut self, at: usize, element: &Element) {
        if element.ends_clause() {
            self.before_colon = if self.clauses.is_sign(at, &[':']) { self.clause } else { element.end };
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

    /// Opens a scope at an excluding word, or excludes the words before a predicate.
    fn apply_word(&mut self, at: usize, element: &Element) {
        let next = self.clauses.elements.get(at + 1);
        // "The wrong answer is A", "Wrong: A".
        let announces = self.clauses.is_sign(at + 1, &[':']) || next.is_some_and(|next| next.has(Role::Candidate));
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

    /// First byte of the subject that a predicate excludes: "A and C can be excluded", "A: wrong". `None` if the
    /// element at `at` is not such a predicate.
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
            let pronoun = !is_named && last && self.has_pronoun_subject(verb);
            return Some(self.names.last_start(element.start).filter(|_| pronoun).unwrap_or(self.clause));
        }
        // Without a verb, the element is a predicate only directly after a name.
        let joints = [':', '-', '–', '—', '(', ',', '=', '→', ')', ']'];
        let mut name = verb;
        while name > 0 && clauses.is_sign(name, &joints) {
            name -= 1;
        }
        let end = elements[name].end;
        self.names.start_of_name_ending_at(end)?;
        Some(if self.clause < end { self.clause } else { self.before_colon.min(end) })
    }

    /// True if the subject of a verb is only a pronoun.
    fn has_pronoun_subject(&self, verb: usize) -> bool {
        let elements = &self.clauses.elements;
        elements[..=verb]
            .iter()
            .rev()
            .take_while(|element| element.start >= self.clause)
            .all(|element| element.roles.has_any(&[Role::Pronoun, Role::Adverb, Role::Copula, Role::Modal]))
    }
}
