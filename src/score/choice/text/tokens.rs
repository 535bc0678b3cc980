//! The words and signs of a text: [`tokens`].
//!
//! Vocabulary of lenient parsing: [`Role`], [`phrase_at`].
//!
//! The lists are data, in `words.toml`. A phrase is looked up word by word; no list is searched as a regular
//! expression.

use std::collections::{BTreeMap, HashMap};
use std::sync::LazyLock;

use serde::Deserialize;

use super::plain::fold;
use crate::choice::names::is_unspaced;

/// The kind of a token.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TokenKind {
    /// A word or a number; in a script without spaces between words, a single character.
    Word,
    /// Any other character that is not a space.
    Sign,
    /// The end of a line.
    Break,
}

/// One word or sign of a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Token {
    /// First byte.
    pub(crate) start: usize,
    /// The byte after the last byte.
    pub(crate) end: usize,
    pub(crate) kind: TokenKind,
}

impl Token {
    /// The token's part of the text.
    pub(crate) fn slice<'a>(&self, text: &'a str) -> &'a str {
        &text[self.start..self.end]
    }

    /// True if the token is one of these signs.
    pub(crate) fn is_sign(&self, text: &str, signs: &[char]) -> bool {
        self.kind == TokenKind::Sign && self.slice(text).starts_with(signs)
    }
}

/// Every token of a text, from left to right. An apostrophe inside a word belongs to the word, as do a full stop or
/// comma between digits ("2.5") and the full stops of an abbreviation ("e.g.").
pub(crate) fn tokens(text: &str) -> Vec<Token> {
    let mut tokens: Vec<Token> = Vec::with_capacity(text.len() / 4);
    let mut previous = ' ';
    for (start, c) in text.char_indices() {
        let end = start + c.len_utf8();
        let last = tokens.last_mut().filter(|last| last.end == start && last.kind == TokenKind::Word);
        match last {
            Some(last) if continues_token(text, last, previous, c, end) => last.end = end,
            _ if c == '\n' => tokens.push(Token { start, end, kind: TokenKind::Break }),
            _ if c.is_whitespace() => {}
            _ if c.is_alphanumeric() || c == '_' => tokens.push(Token { start, end, kind: TokenKind::Word }),
            _ => tokens.push(Token { start, end, kind: TokenKind::Sign }),
        }
        previous = c;
    }
    tokens
}

/// True if a character that ends at byte `end` continues the word before it.
fn continues_token(text: &str, word: &Token, previous: char, c: char, end: usize) -> bool {
    if !matches!(c, '\'' | ',' | '.') {
        return is_spaced_word_char(c) && (is_spaced_word_char(previous) || matches!(previous, '\'' | '.' | ','));
    }
    let mut after = text[end..].chars();
    let (next, second) = (after.next().unwrap_or(' '), after.next().unwrap_or(' '));
    match c {
        '\'' => is_spaced_word_char(previous) && is_spaced_word_char(next),
        _ if previous.is_numeric() => next.is_numeric(),
        ',' => false,
        _ => {
            let letters = word.slice(text);
            let begins_abbreviation = letters.len() == 1 && next.is_alphabetic() && !second.is_alphabetic();
            begins_abbreviation || (letters.len() <= 5 && letters.contains('.') && !next.is_alphanumeric())
        }
    }
}

/// True if a character is part of a word in a script with spaces between words.
fn is_spaced_word_char(c: char) -> bool {
    c.is_ascii_alphanumeric() || ((c.is_alphanumeric() || c == '_') && !is_unspaced(c))
}

/// The lists of words and phrases.
const WORDS: &str = include_str!("../words.toml");

/// Function of a phrase in a reply. `words.toml` has a list of phrases for each role.
///
/// "Excluding" a name leaves the answer among the other choices. "Denying" a name keeps it as a rival: another choice
/// is then ambiguous.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Role {
    /// Excludes the names after it.
    Exclude,
    /// As a predicate, excludes the names before it.
    Excluded,
    /// As `Excluded`, but only at the end of a clause.
    ExcludedLast,
    /// Excludes together with a [`Role::Candidate`].
    Untrue,
    /// A word for a choice, such as "option".
    Candidate,
    /// Denies the names after it.
    Not,
    /// Denies the name directly before it.
    NotBehind,
    /// As a predicate, denies the name directly before it.
    Absent,
    /// Looks like a denial or a boundary but is neither.
    Neutral,
    /// Ends the reach of denials.
    Cut,
    /// Ends the reach of "not".
    Subordinate,
    /// Joins a letter and a text that mean the same.
    Apposition,
    /// Begins an independent clause after a comma.
    Assertion,
    /// A verb before a predicate.
    Copula,
    /// A verb before "not".
    Modal,
    /// A word between a verb and its predicate.
    Adverb,
    /// Announces the remaining choices.
    Leaves,
    /// Marks the name before it as the only one that remains.
    Remains,
    /// Joins alternatives.
    Or,
    /// Joins names.
    And,
    /// Begins a question.
    Question,
    /// Begins a condition.
    If,
    /// A verb of a counterfactual.
    ModalPast,
    /// Marks a clause as counterfactual.
    Condition,
    /// A preposition of [`Role::Better`] light.
    Given,
    /// A comparative such as "more", before a [`Role::LightNoun`].
    Better,
    /// Light, or an image.
    LightNoun,
    /// Begins a condition at the start of a clause.
    Inverted,
    /// Marks the words before it as a description of expectations.
    Expected,
    /// A condition that only forces a choice, as "if I had to guess".
    Forced,
    /// Retracts an earlier statement.
    Retraction,
    /// A word between "or" and a name.
    Hedge,
    /// "No" in a phrase that is not an answer.
    NoIdiom,
    /// Begins a clause.
    ClauseStart,
    /// A preposition after a "no" that is an answer.
    Preposition,
    /// A noun that the name before it modifies, as "lamp" in "table lamp".
    Head,
    /// A color.
    Color,
    /// A word for brightness.
    Shade,
    /// A word for a place.
    Place,
    /// A number.
    Number,
    /// A subject that means the image.
    Image,
    /// A subject that may mean the image.
    Pronoun,
    /// Makes a pronoun refer to the image.
    Entirely,
    /// A phrase that only a color is seen.
    See,
    /// A noun that makes a color before it a property of the image.
    Noise,
    /// A preposition before an image noun that is not the subject.
    Within,
    /// A part of the image.
    Portion,
}

/// A set of roles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Roles(u64);

impl Roles {
    /// The set of one role.
    pub(crate) const fn from_role(role: Role) -> Self {
        Self(1 << role as u64)
    }

    /// True if the set contains this role.
    pub(crate) const fn has(self, role: Role) -> bool {
        self.0 & (1 << role as u64) != 0
    }

    /// True if the set contains any of these roles.
    pub(crate) fn has_any(self, roles: &[Role]) -> bool {
        roles.iter().any(|role| self.has(*role))
    }

    /// The roles that are in either set.
    pub(super) const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The roles that are in both sets.
    pub(super) const fn intersection(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

/// One phrase of the vocabulary.
#[derive(Debug)]
struct Phrase {
    /// The words after the first one.
    rest: Vec<String>,
    roles: Roles,
}

/// All phrases by their first word, longest first.
static PHRASES: LazyLock<HashMap<String, Vec<Phrase>>> = LazyLock::new(|| {
    let mut phrases = HashMap::<String, Vec<Phrase>>::new();
    for (role, list) in lists() {
        for phrase in list {
            let mut words = words_of(&phrase).into_iter();
            let first = words.next().unwrap_or_default();
            let rest: Vec<String> = words.collect();
            let same_start = phrases.entry(first).or_default();
            match same_start.iter_mut().find(|phrase| phrase.rest == rest) {
                Some(known) => known.roles = known.roles.union(Roles::from_role(role)),
                None => same_start.push(Phrase { rest, roles: Roles::from_role(role) }),
            }
        }
    }
    for same_start in phrases.values_mut() {
        same_start.sort_by_key(|phrase| std::cmp::Reverse(phrase.rest.len()));
    }
    phrases
});

/// The lists of `words.toml`.
#[expect(clippy::expect_used, reason = "the file is compiled in and parsed by the tests")]
pub(crate) fn lists() -> BTreeMap<Role, Vec<String>> {
    toml::from_str(WORDS).expect("words.toml has the lists of `Role`")
}

/// The words of a phrase, tokenized like a reply.
fn words_of(phrase: &str) -> Vec<String> {
    let folded = fold(phrase);
    tokens(&folded).iter().map(|word| word.slice(&folded).to_owned()).collect()
}

/// The longest phrase that begins with the first of these tokens: its number of tokens and its roles. An unlisted
/// contraction with "not" is [`Role::Not`].
pub(crate) fn phrase_at(folded: &str, tokens: &[Token]) -> Option<(usize, Roles)> {
    let first = tokens.first().filter(|token| token.kind == TokenKind::Word)?;
    let word = first.slice(folded);
    let listed = PHRASES.get(word).into_iter().flatten().find(|phrase| {
        phrase.rest.len() < tokens.len()
            && phrase.rest.iter().zip(&tokens[1..]).all(|(word, token)| token.slice(folded) == word)
    });
    match listed {
        Some(phrase) => Some((phrase.rest.len() + 1, phrase.roles)),
        None if word.ends_with("n't") && word.len() > 3 => Some((1, Roles::from_role(Role::Not))),
        None => None,
    }
}
