//! [`denied`]: ranges of a text in which choices are denied. A denied choice makes another choice ambiguous ("not A but
//! C").
//!
//! [`excluded`]: ranges of a text in which choices are ruled out.
//!
//! The word "no" as an answer or as a determiner ("no light reaches the sensor"): [`is_answer`].
//!
//! [`image_colors`]: colors that a text attributes to the image and not to an object in it.

use super::conditions::ends_scope;
use crate::choice::choice_views::{ChoiceViews, Naming};
use crate::choice::name_index::Names;
use crate::choice::names::Name;
use crate::choice::text::tokens::{Role, phrase_at};
use crate::choice::text::{Boundary, Clauses, Element, Ranges, Token, TokenKind, tokens};

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

/// Number of bytes that are examined after the start of "no".
const LOOK_AHEAD: usize = 64;

/// True if the "no" at `start..end` can be an answer: it is followed by the end, a line break, a punctuation mark or,
/// at the beginning of a clause, another clause ("No there is none"); and it is not part of an idiom ("no doubt").
pub(crate) fn is_answer(folded: &str, start: usize, end: usize) -> bool {
    let to = folded.floor_char_boundary(end + LOOK_AHEAD);
    let around = &folded[start..to];
    let words = tokens(around);
    let Some(next) = words.get(1) else {
        return true;
    };
    if phrase_at(around, &words).is_some_and(|(_, roles)| roles.has(Role::NoIdiom)) {
        return false;
    }
    if next.kind != TokenKind::Word {
        return next.kind == TokenKind::Break || ends_word(around, next);
    }
    let before = folded[..start].trim_end_matches(' ');
    let leads = before.is_empty() || before.ends_with(['.', ',', ';', ':', '!', '\n', '-', '–', '—', '(']);
    let leads_after_another =
        !before.is_empty() && (leads || [" and", " but", " a", " the"].iter().any(|word| before.ends_with(word)));
    phrase_at(around, std::slice::from_ref(next)).is_some_and(|(_, roles)| {
        (leads && roles.has(Role::ClauseStart)) || (leads_after_another && roles.has(Role::Preposition))
    })
}

/// True if a sign ends the word before it.
fn ends_word(text: &str, sign: &Token) -> bool {
    sign.is_sign(text, &['.', ',', ';', ':', '!', '?', ')', ']', '(', '-', '–', '—', '。', '→', '='])
}

/// Ranges of the color names that describe the image: "the image is black", "gray noise", "I only see black",
/// "completely black".
pub(crate) fn image_colors(clauses: &Clauses<'_>, texts: &[Name], offered: &ChoiceViews) -> Ranges {
    let described = texts
        .iter()
        .filter(|name| name.choice.is_some_and(|choice| offered.naming[choice] == Naming::Color))
        .filter(|name| describes_image(clauses, name));
    Ranges::new(described.map(|name| (name.start, name.end)).collect())
}

/// Number of elements before and after a color that are examined.
const WITHIN: usize = 12;

fn describes_image(clauses: &Clauses<'_>, name: &Name) -> bool {
    let elements = &clauses.elements;
    let first = elements.partition_point(|element| element.end <= name.start);
    let behind = clauses.index(name.end);
    // "Too dark" is one phrase.
    let denied = elements.get(first).is_some_and(|element| element.has(Role::Not));
    denied || before_noise(clauses, behind) || after_subject(clauses, first, behind)
}

/// True if a noun such as "noise" or "image" follows the color, perhaps after further colors: "gray noise", "black and
/// white image".
fn before_noise(clauses: &Clauses<'_>, behind: usize) -> bool {
    let elements = &clauses.elements;
    let mut at = behind;
    while at < behind + WITHIN {
        let Some(element) = elements.get(at) else {
            return false;
        };
        // "A brown area rug" is a rug.
        let modifies = elements.get(at + 1).is_some_and(|next| next.has(Role::Head));
        if element.has(Role::Noise) {
            return !modifies;
        }
        // "The black part of the image".
        let within = elements.get(at + 1).is_some_and(|next| next.has(Role::Within));
        if element.has(Role::Portion) && within {
            return elements[at + 1..].iter().take(4).any(|element| element.has(Role::Image));
        }
        let joins = element.roles.has_any(&[Role::And, Role::Or]) || clauses.is_sign(at, &[',']);
        let is_color = element.roles.has_any(&[Role::Color, Role::Shade]);
        if !joins && !is_color {
            return false;
        }
        at += 1;
    }
    false
}

/// True if the words before a color attribute it to the image: the subject of the sentence, "I only see", or
/// "completely" alone.
fn after_subject(clauses: &Clauses<'_>, first: usize, behind: usize) -> bool {
    let elements = &clauses.elements;
    let ends = elements.get(behind).is_none_or(|next| next.boundary > Boundary::None);
    let mut entirely = false;
    for at in (first.saturating_sub(WITHIN)..first).rev() {
        let element = &elements[at];
        let word = element.slice(clauses.folded);
        let begins = clauses.begins_part(at);
        entirely |= element.has(Role::Entirely);
        let alone = matches!(word, "only" | "just" | "nothing but");
        let sees_before = at > 0 && elements[at - 1].has(Role::See);
        if word == "pitch" || (element.has(Role::See) && ends && (!alone || begins || sees_before)) {
            return true;
        }
        if element.has(Role::Copula) {
            return element.has(Role::Image)
                || (entirely && element.has(Role::Pronoun))
                || has_image_subject(clauses, at, entirely);
        }
        // "Completely black.", "Picture: black."
        let heading = at > 0 && clauses.is_sign(at, &[':']) && elements[at - 1].has(Role::Image);
        if heading || (entirely && begins) {
            return true;
        }
        let comma = clauses.is_sign(at, &[',']) && at > 0 && is_color(clauses, at - 1);
        let joins = element.roles.has_any(&[Role::And, Role::Or]);
        if !(clauses.is_adverb(at) || is_color(clauses, at) || joins || comma || entirely) {
            return false;
        }
    }
    false
}

fn is_color(clauses: &Clauses<'_>, at: usize) -> bool {
    clauses.elements[at].roles.has_any(&[Role::Color, Role::Shade])
}

/// True if the subject of a verb is the image, or a pronoun in a clause with a word such as "entirely".
fn has_image_subject(clauses: &Clauses<'_>, verb: usize, entirely: bool) -> bool {
    let elements = &clauses.elements;
    let start = (verb.saturating_sub(WITHIN)..verb)
        .rev()
        .find(|at| elements[*at].boundary > Boundary::None || elements[*at].has(Role::And))
        .map_or(verb.saturating_sub(WITHIN), |at| at + 1);
    let subject = start..verb;
    if entirely && subject.len() == 1 && elements[start].has(Role::Pronoun) {
        return true;
    }
    subject.clone().any(|at| elements[at].has(Role::Image) && is_head(clauses, start, at))
}

/// True if an image noun is the head of the subject, as in "most of the image is black", and not a place, as in "the
/// sofa in the image is white".
fn is_head(clauses: &Clauses<'_>, start: usize, noun: usize) -> bool {
    let elements = &clauses.elements;
    let Some(within) = (start..noun)
        .rev()
        .find(|at| !is_determiner_or_color(clauses, *at))
        .filter(|at| elements[*at].has(Role::Within))
    else {
        return true;
    };
    within > start && elements[within - 1].has(Role::Portion)
}

fn is_determiner_or_color(clauses: &Clauses<'_>, at: usize) -> bool {
    const DETERMINERS: [&str; 9] = ["the", "this", "a", "that", "given", "provided", "your", "entire", "whole"];
    let element = &clauses.elements[at];
    is_color(clauses, at) || (element.kind == TokenKind::Word && DETERMINERS.contains(&element.slice(clauses.folded)))
}
