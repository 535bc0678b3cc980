//! Text that came from outside, as it may be shown: [`shown`].
//!
//! A name in a data set, a run or a reply of an endpoint may hold characters that move a terminal, turn the direction of a line, or are
//! not seen at all; and a control character makes an SVG file no XML.

use std::borrow::Cow;
use std::fmt::Write as _;

/// The colours of this program's own text on a terminal: bold, red, green, yellow, and none.
const STYLES: [&str; 5] = [
    "\u{1b}[1m",
    "\u{1b}[31m",
    "\u{1b}[32m",
    "\u{1b}[33m",
    "\u{1b}[0m",
];

/// Whether a character is not seen as itself: a control but line feed and tab, a line separator, an annotation mark, or one that
/// Unicode calls ignorable by default (direction marks, invisible letters, tags), but the two selectors of the form of an emoji.
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

/// A text on one line, in at most `most` characters: a longer one ends in `…`.
#[must_use]
pub fn excerpt(text: &str, most: usize) -> String {
    let line = text.chars().map(|c| if c.is_control() { ' ' } else { c });
    if text.chars().nth(most).is_none() {
        return line.collect();
    }
    let head: String = line.take(most.saturating_sub(1)).collect();
    format!("{head}…")
}

/// A text with each hidden character as `⟨U+202E⟩`.
#[must_use]
pub fn shown(text: &str) -> Cow<'_, str> {
    written_out(text, is_hidden)
}

/// A text with each character that is to be written out as `⟨U+0009⟩`.
#[must_use]
pub fn written_out(text: &str, is_written_out: impl Fn(char) -> bool) -> Cow<'_, str> {
    let Some(first) = text.find(&is_written_out) else {
        return Cow::Borrowed(text);
    };
    let mut shown = String::with_capacity(text.len() + 8);
    shown.push_str(&text[..first]);
    for c in text[first..].chars() {
        if is_written_out(c) {
            push_code(&mut shown, c);
        } else {
            shown.push(c);
        }
    }
    Cow::Owned(shown)
}

/// A text for a terminal as [`shown`], with the colours that this program uses left in it.
#[must_use]
pub fn shown_in_colours(text: &str) -> Cow<'_, str> {
    if !text.contains(is_hidden) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 8);
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let style = STYLES.iter().find(|style| rest.starts_with(**style));
        if let Some(style) = style {
            shown.push_str(style);
            rest = &rest[style.len()..];
            continue;
        }
        if is_hidden(c) {
            push_code(&mut shown, c);
        } else {
            shown.push(c);
        }
        rest = &rest[c.len_utf8()..];
    }
    Cow::Owned(shown)
}

/// Adds the code of a character, as `⟨U+202E⟩`.
fn push_code(shown: &mut String, c: char) {
    let _ = write!(shown, "⟨U+{:04X}⟩", u32::from(c));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_characters_are_written_out() {
        for (text, expected) in [
            ("plain\ttext\n", "plain\ttext\n"),
            ("a\u{202e}b", "a⟨U+202E⟩b"),
            ("\u{1b}[31mred", "⟨U+001B⟩[31mred"),
            ("a\r\u{e0041}ü\u{ad}", "a⟨U+000D⟩⟨U+E0041⟩ü⟨U+00AD⟩"),
            ("a\u{3164}\u{34f}\u{e0101}", "a⟨U+3164⟩⟨U+034F⟩⟨U+E0101⟩"),
            ("⚠\u{fe0f} עברית", "⚠\u{fe0f} עברית"),
        ] {
            assert_eq!(shown(text), expected);
        }
    }

    #[test]
    fn on_a_terminal_only_colours_stay() {
        let text = "\u{1b}[1m\u{1b}[32m✓\u{1b}[0m \u{1b}[2J\u{1b}[8mhidden\r";
        let expected = "\u{1b}[1m\u{1b}[32m✓\u{1b}[0m ⟨U+001B⟩[2J⟨U+001B⟩[8mhidden⟨U+000D⟩";
        assert_eq!(shown_in_colours(text), expected);
        assert_eq!(shown_in_colours("as it is"), "as it is");
    }
}
