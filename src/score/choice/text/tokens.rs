//! The words and signs of a text: [`tokens`].

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
