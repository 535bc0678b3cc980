//! The words and signs of a text: [`tokens`].

use crate::names::unspaced;

/// The kind of a token.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TokenKind {
    /// A word or a number; in a script without spaces, a character.
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
    /// The token's characters in the text that it comes from.
    pub(crate) fn slice<'a>(&self, text: &'a str) -> &'a str {
        &text[self.start..self.end]
    }

    /// Whether the token is this sign.
    pub(crate) fn is_sign(&self, text: &str, signs: &[char]) -> bool {
        self.kind == TokenKind::Sign && self.slice(text).starts_with(signs)
    }
}

/// Every token of a text, from left to right. An apostrophe inside a word belongs to it, and so does a point or a comma
/// between digits ("2.5") or a point of an abbreviation ("e.g.").
pub(crate) fn tokens(text: &str) -> Vec<Token> {
    let mut tokens: Vec<Token> = Vec::with_capacity(text.len() / 4);
    let mut previous = ' ';
    for (start, c) in text.char_indices() {
        let end = start + c.len_utf8();
        let last = tokens
            .last_mut()
            .filter(|last| last.end == start && last.kind == TokenKind::Word);
        match last {
            Some(last) if joins(text, last, previous, c, end) => last.end = end,
            _ if c == '\n' => tokens.push(Token {
                start,
                end,
                kind: TokenKind::Break,
            }),
            _ if c.is_whitespace() => {}
            _ if c.is_alphanumeric() || c == '_' => tokens.push(Token {
                start,
                end,
                kind: TokenKind::Word,
            }),
            _ => tokens.push(Token {
                start,
                end,
                kind: TokenKind::Sign,
            }),
        }
        previous = c;
    }
    tokens
}

/// Whether a character that ends at byte `end` belongs to the word before it.
fn joins(text: &str, word: &Token, previous: char, c: char, end: usize) -> bool {
    if !matches!(c, '\'' | ',' | '.') {
        return spelled(c) && (spelled(previous) || matches!(previous, '\'' | '.' | ','));
    }
    let mut after = text[end..].chars();
    let (next, second) = (after.next().unwrap_or(' '), after.next().unwrap_or(' '));
    match c {
        '\'' => spelled(previous) && spelled(next),
        _ if previous.is_numeric() => next.is_numeric(),
        ',' => false,
        _ => {
            let letters = word.slice(text);
            let begins = letters.len() == 1 && next.is_alphabetic() && !second.is_alphabetic();
            begins || (letters.len() <= 5 && letters.contains('.') && !next.is_alphanumeric())
        }
    }
}

/// Whether a character is part of a word of a script that writes spaces.
fn spelled(c: char) -> bool {
    c.is_ascii_alphanumeric() || ((c.is_alphanumeric() || c == '_') && !unspaced(c))
}
