//! A text cut into words, phrases and clauses, once for all steps: [`Clauses`].

use super::tokens::{Token, TokenKind};
use super::words::{Role, Roles, phrase_at};

/// Unit of the text that ends at an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Boundary {
    /// Nothing.
    None,
    /// A part of a clause: a comma, a bracket, a dash, "because".
    Part,
    /// A clause: a semicolon, a colon, "but".
    Clause,
    /// A sentence: a point, a question mark, an exclamation mark, the end of a line.
    Sentence,
}

/// Maximum number of adverbs between a verb and its predicate.
const MAX_ADVERBS: usize = 8;

/// One word, phrase or sign of a text.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Element {
    /// First byte.
    pub(crate) start: usize,
    /// The byte after the last byte.
    pub(crate) end: usize,
    pub(crate) kind: TokenKind,
    pub(crate) roles: Roles,
    pub(crate) boundary: Boundary,
}

impl Element {
    /// The element's characters in the text that it comes from.
    pub(crate) fn slice<'a>(&self, folded: &'a str) -> &'a str {
        &folded[self.start..self.end]
    }

    pub(crate) fn has(&self, role: Role) -> bool {
        self.roles.has(role)
    }

    /// Whether a clause ends here.
    pub(crate) fn cuts(&self) -> bool {
        self.boundary >= Boundary::Clause
    }
}

/// The elements of a text.
pub(crate) struct Clauses<'a> {
    pub(crate) folded: &'a str,
    pub(crate) elements: Vec<Element>,
}

impl<'a> Clauses<'a> {
    /// The elements of a text in lower case, of these tokens.
    pub(crate) fn new(folded: &'a str, tokens: &[Token]) -> Self {
        let mut elements = Vec::with_capacity(tokens.len());
        let mut at = 0;
        while let Some(first) = tokens.get(at) {
            let (count, mut roles) =
                phrase_at(folded, &tokens[at..]).unwrap_or((1, Roles::default()));
            if count > 1 {
                roles = roles.with(inner(folded, &tokens[at..at + count]));
            }
            let end = tokens[at + count - 1].end;
            elements.push(Element {
                start: first.start,
                end,
                kind: first.kind,
                roles,
                boundary: boundary(first.kind, roles, &folded[first.start..end]),
            });
            at += count;
        }
        Self { folded, elements }
    }

    /// Index of the first element that begins at a byte or behind it.
    pub(crate) fn index(&self, byte: usize) -> usize {
        self.elements
            .partition_point(|element| element.start < byte)
    }

    /// The element that begins at a byte, with spaces before it.
    pub(crate) fn from(&self, byte: usize) -> Option<&Element> {
        let element = self.elements.get(self.index(byte))?;
        self.folded[byte..element.start]
            .trim()
            .is_empty()
            .then_some(element)
    }

    /// Whether an element is one of these signs.
    pub(crate) fn is_sign(&self, at: usize, signs: &[char]) -> bool {
        self.elements.get(at).is_some_and(|element| {
            element.kind == TokenKind::Sign && element.slice(self.folded).starts_with(signs)
        })
    }

    /// Whether a clause or a part of one ends before an element, or the text begins with it.
    pub(crate) fn begins(&self, at: usize) -> bool {
        at == 0 || self.elements[at - 1].boundary > Boundary::None
    }

    /// Whether an element may stand between a verb and its predicate.
    pub(crate) fn is_adverb(&self, at: usize) -> bool {
        let element = &self.elements[at];
        element.has(Role::Adverb) || element.slice(self.folded).ends_with("ly")
    }

    /// Index of the element before a predicate, behind adverbs: its verb, if it has one.
    pub(crate) fn verb_before(&self, at: usize) -> Option<usize> {
        let mut verb = at.checked_sub(1)?;
        let first = verb.saturating_sub(MAX_ADVERBS);
        while verb > first && self.is_adverb(verb) {
            verb -= 1;
        }
        Some(verb)
    }

    /// Makes the sign at a byte end nothing: the point of "B. kitchen".
    pub(crate) fn join(&mut self, byte: usize) {
        let at = self.index(byte);
        if let Some(element) = self
            .elements
            .get_mut(at)
            .filter(|element| element.start == byte)
        {
            element.boundary = Boundary::None;
        }
    }
}

/// The roles of a phrase that follow from its words: "it is" has a pronoun and a verb; "i'd say" is counterfactual.
fn inner(folded: &str, words: &[Token]) -> Roles {
    const ANY: Roles = Roles::from_role(Role::ModalPast).with(Roles::from_role(Role::Image));
    const FIRST: Roles = ANY.with(Roles::from_role(Role::Pronoun));
    const LAST: Roles = ANY.with(Roles::from_role(Role::Copula));
    let own = |at: usize| {
        let known = phrase_at(folded, std::slice::from_ref(&words[at]));
        known.map_or(Roles::default(), |(_, roles)| roles)
    };
    let last = words.len() - 1;
    let middle = (1..last).fold(Roles::default(), |roles, at| roles.with(own(at).both(ANY)));
    middle.with(own(0).both(FIRST)).with(own(last).both(LAST))
}

/// Unit of the text that ends at an element.
fn boundary(kind: TokenKind, roles: Roles, characters: &str) -> Boundary {
    match kind {
        TokenKind::Break => Boundary::Sentence,
        TokenKind::Word if roles.has(Role::Cut) => Boundary::Clause,
        TokenKind::Word if roles.has(Role::Subordinate) => Boundary::Part,
        TokenKind::Word => Boundary::None,
        TokenKind::Sign => match characters.chars().next() {
            Some('.' | '!' | '?' | '。' | '！' | '？' | '।' | '؟') => Boundary::Sentence,
            Some(';' | ':' | '；' | '：' | '؛') => Boundary::Clause,
            Some(',' | '(' | ')' | '、' | '،' | '—' | '–' | '-') => Boundary::Part,
            _ => Boundary::None,
        },
    }
}
