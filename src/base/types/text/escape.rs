//! Escaping of hidden characters in untrusted text: [`escape_hidden`].
//!
//! A name in a data set, a run or a reply of an endpoint may contain characters that move the cursor of a terminal,
//! reverse the direction of a line, or are invisible. Control characters also make an SVG file invalid XML.

use std::borrow::Cow;
use std::fmt::Write as _;

/// The terminal styles that this program prints: bold, red, green, yellow, and reset.
const STYLES: [&str; 5] = ["\u{1b}[1m", "\u{1b}[31m", "\u{1b}[32m", "\u{1b}[33m", "\u{1b}[0m"];

/// True for a character that is invisible or changes the text around it: control characters except line feed and tab,
/// line separators, annotation marks, and Unicode's default-ignorable characters (direction marks, invisible letters,
/// tags) except the two variation selectors of emoji.
#[must_use]
pub fn is_hidden(c: char) -> bool {
    matches!(
        c,
        '\u{0}'..='\u{8}' | '\u{b}'..='\u{1f}' | '\u{7f}'..='\u{9f}' | '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}'..='\u{1160}'
            | '\u{17b4}'..='\u{17b5}' | '\u{180b}'..='\u{180f}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{3164}' | '\u{fe00}'..='\u{fe0d}' | '\u{feff}' | '\u{ffa0}' | '\u{fff0}'..='\u{fffb}'
            | '\u{1bca0}'..='\u{1bca3}' | '\u{1d173}'..='\u{1d17a}' | '\u{e0000}'..='\u{e0fff}'
    )
}

/// A text on one line, cut to `most` characters; a cut text ends in `…`.
#[must_use]
pub fn excerpt(text: &str, most: usize) -> String {
    let line = text.chars().map(|c| if c.is_control() { ' ' } else { c });
    if text.chars().nth(most).is_none() {
        return line.collect();
    }
    let head: String = line.take(most.saturating_sub(1)).collect();
    format!("{head}…")
}

/// Replaces each hidden character by its code, as `⟨U+202E⟩`.
#[must_use]
pub fn escape_hidden(text: &str) -> Cow<'_, str> {
    escape_where(text, is_hidden)
}

/// Replaces each character that `is_escaped` accepts by its code, as `⟨U+0009⟩`.
#[must_use]
pub fn escape_where(text: &str, is_escaped: impl Fn(char) -> bool) -> Cow<'_, str> {
    let Some(first) = text.find(&is_escaped) else {
        return Cow::Borrowed(text);
    };
    let mut escaped = String::with_capacity(text.len() + 8);
    escaped.push_str(&text[..first]);
    for c in text[first..].chars() {
        if is_escaped(c) {
            push_code(&mut escaped, c);
        } else {
            escaped.push(c);
        }
    }
    Cow::Owned(escaped)
}

/// Replaces hidden characters as [`escape_hidden`] does, but keeps the terminal styles that this program prints.
#[must_use]
pub fn escape_hidden_except_styles(text: &str) -> Cow<'_, str> {
    if !text.contains(is_hidden) {
        return Cow::Borrowed(text);
    }
    let mut escaped = String::with_capacity(text.len() + 8);
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        if let Some(style) = STYLES.iter().find(|style| rest.starts_with(**style)) {
            escaped.push_str(style);
            rest = &rest[style.len()..];
            continue;
        }
        if is_hidden(c) {
            push_code(&mut escaped, c);
        } else {
            escaped.push(c);
        }
        rest = &rest[c.len_utf8()..];
    }
    Cow::Owned(escaped)
}

/// Appends the code of a character, as `⟨U+202E⟩`.
fn push_code(text: &mut String, c: char) {
    let _ = write!(text, "⟨U+{:04X}⟩", u32::from(c));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_characters_become_codes() {
        for (text, expected) in [
            ("plain\ttext\n", "plain\ttext\n"),
            ("a\u{202e}b", "a⟨U+202E⟩b"),
            ("\u{1b}[31mred", "⟨U+001B⟩[31mred"),
            ("a\r\u{e0041}ü\u{ad}", "a⟨U+000D⟩⟨U+E0041⟩ü⟨U+00AD⟩"),
            ("a\u{3164}\u{34f}\u{e0101}", "a⟨U+3164⟩⟨U+034F⟩⟨U+E0101⟩"),
            ("⚠\u{fe0f} עברית", "⚠\u{fe0f} עברית"),
        ] {
            assert_eq!(escape_hidden(text), expected);
        }
    }

    #[test]
    fn own_styles_are_kept() {
        let text = "\u{1b}[1m\u{1b}[32m✓\u{1b}[0m \u{1b}[2J\u{1b}[8mhidden\r";
        let expected = "\u{1b}[1m\u{1b}[32m✓\u{1b}[0m ⟨U+001B⟩[2J⟨U+001B⟩[8mhidden⟨U+000D⟩";
        assert_eq!(escape_hidden_except_styles(text), expected);
        assert_eq!(escape_hidden_except_styles("as it is"), "as it is");
    }
}
