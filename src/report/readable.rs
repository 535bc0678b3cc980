//! Replies of models as text that a page can show: [`readable`].

use std::fmt::Write;

/// Maximum number of characters of a text on a page.
const MAX_CHARS: usize = 4_000;

/// A text in which hidden characters are written as ⟨U+202E⟩: controls, direction marks and invisible characters. A text of
/// more than [`MAX_CHARS`] characters is cut, with a note at its end.
#[must_use]
pub(super) fn readable(text: &str) -> String {
    let mut visible = String::with_capacity(text.len().min(MAX_CHARS));
    for c in text.chars().take(MAX_CHARS) {
        if is_hidden(c) {
            let _ = write!(visible, "⟨U+{:04X}⟩", u32::from(c));
        } else {
            visible.push(c);
        }
    }
    let all = text.chars().count();
    if all > MAX_CHARS {
        let _ = write!(visible, " … ({all} characters, cut here)");
    }
    visible
}

fn is_hidden(c: char) -> bool {
    matches!(
        c,
        '\u{0}'..='\u{8}' | '\u{b}'..='\u{1f}' | '\u{7f}'..='\u{9f}' | '\u{ad}' | '\u{61c}' | '\u{115f}' | '\u{180e}'
            | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}'
            | '\u{fff9}'..='\u{fffb}'
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_characters_are_written_out_and_long_texts_cut() {
        assert_eq!(readable("a\u{202e}b\u{0}\n"), "a⟨U+202E⟩b⟨U+0000⟩\n");
        let long = readable(&"ü".repeat(MAX_CHARS + 1));
        assert!(long.ends_with("ü … (4001 characters, cut here)"));
    }
}
