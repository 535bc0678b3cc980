//! Replies of models as text that a page can show: [`readable`].

use std::fmt::Write;

use crate::types::text::escape_hidden;

/// Maximum number of characters of a text on a page.
const MAX_CHARS: usize = 4_000;

/// A text in which hidden characters are written as ⟨U+202E⟩: controls, direction marks and invisible characters. A text of
/// more than [`MAX_CHARS`] characters is cut, with a note at its end.
#[must_use]
pub(crate) fn readable(text: &str) -> String {
    let cut = text.char_indices().nth(MAX_CHARS);
    let kept = cut.map_or(text, |(at, _)| &text[..at]);
    let mut visible = escape_hidden(kept).into_owned();
    let all = text.chars().count();
    if all > MAX_CHARS {
        let _ = write!(visible, " … ({all} characters, cut here)");
    }
    visible
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
