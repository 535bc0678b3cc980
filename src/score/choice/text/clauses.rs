//! [`Clauses`]: a text cut into words, phrases and clauses.

use super::tokens::{Role, Roles, Token, TokenKind, phrase_at};

/// The largest unit of the text that ends at an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Boundary {
    /// No unit ends here.
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
    /// The element's part of the text.
    pub(crate) fn slice<'a>(&self, folded: &'a str) -> &'a str {
        &folded[self.start..self.end]
    }

    pub(crate) fn has(&self, role: Role) -> bool {
        self.roles.has(role)
    }

    /// True if a clause or sentence ends at the element.
    pub(crate) fn ends_clause(&self) -> bool {
        self.boundary >= Boundary::Clause
    }
}

/// The elements of a text.
pub(crate) struct Clauses<'a> {
    pub(crate) folded: &'a str,
    pub(crate) elements: Vec<Element>,
}

impl<'a> Clauses<'a> {
    /// Groups the tokens of a text in lower case into elements.
    pub(crate) fn new(folded: &'a str, tokens: &[Token]) -> Self {
        let mut elements = Vec::with_capacity(tokens.len());
        let mut at = 0;
        while let Some(first) = tokens.get(at) {
            let (count, mut roles) = phrase_at(folded, &tokens[at..]).unwrap_or((1, Roles::default()));
            if count > 1 {
                roles = roles.union(word_roles(folded, &tokens[at..at + count]));
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

    /// Index of the first element that begins at a byte or after it.
    pub(crate) fn index(&self, byte: usize) -> usize {
        self.elements.partition_point(|element| element.start < byte)
    }

    /// The next element after a byte, if only spaces are between them.
    pub(crate) fn element_at(&self, byte: usize) -> Option<&Element> {
        let element = self.elements.get(self.index(byte))?;
        self.folded[byte..element.start].trim().is_empty().then_some(element)
    }

    /// True if the element at an index is one of these signs.
    pub(crate) fn is_sign(&self, at: usize, signs: &[char]) -> bool {
        self.elements
            .get(at)
            .is_some_and(|element| element.kind == TokenKind::Sign && element.slice(self.folded).starts_with(signs))
    }

    /// True if the element at an index begins a clause or a part of one.
    pub(crate) fn begins_part(&self, at: usize) -> bool {
        at == 0 || self.elements[at - 1].boundary > Boundary::None
    }

    /// True for an adverb, which may be between a verb and its predicate.
    pub(crate) fn is_adverb(&self, at: usize) -> bool {
        let element = &self.elements[at];
        element.has(Role::Adverb) || element.slice(self.folded).ends_with("ly")
    }

    /// Index of the element before a predicate and its adverbs, which is the verb if there is one.
    pub(crate) fn verb_before(&self, at: usize) -> Option<usize> {
        let mut verb = at.checked_sub(1)?;
        let first = verb.saturating_sub(MAX_ADVERBS);
        while verb > first && self.is_adverb(verb) {
            verb -= 1;
        }
        Some(verb)
    }

    /// Removes the boundary of the sign at a byte, because the full stop in "B. kitchen" ends no sentence.
    pub(crate) fn remove_boundary(&mut self, byte: usize) {
        let at = self.index(byte);
        if let Some(element) = self.elements.get_mut(at).filter(|element| element.start == byte) {
            element.boundary = Boundary::None;
        }
    }
}

/// Roles that a phrase inherits from its words: "it is" has a pronoun and a verb; "i'd say" is counterfactual.
fn word_roles(folded: &str, words: &[Token]) -> Roles {
    const ANY: Roles = Roles::from_role(Role::ModalPast).union(Roles::from_role(Role::Image));
    const FIRST: Roles = ANY.union(Roles::from_role(Role::Pronoun));
    const LAST: Roles = ANY.union(Roles::from_role(Role::Copula));
    let last = words.len() - 1;
    words
        .iter()
        .enumerate()
        .map(|(at, word)| {
            let inherited = match at {
                0 => FIRST,
                at if at == last => LAST,
                _ => ANY,
            };
            phrase_at(folded, std::slice::from_ref(word))
                .map_or(Roles::default(), |(_, roles)| roles.intersection(inherited))
        })
        .fold(Roles::default(), Roles::union)
}

/// The largest unit of the text that ends at an element.
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
