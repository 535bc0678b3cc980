//! Replies of models as text for an HTML page: [`readable`].

use std::fmt::Write;

use crate::types::text::escape_hidden;

/// Maximum number of characters of a text on a page.
const MAX_CHARS: usize = 4_000;

/// Escapes hidden characters as codes such as ⟨U+202E⟩, and cuts a text of more than [`MAX_CHARS`] characters, with a
/// note at its end.
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
    fn hidden_characters_are_escaped_and_long_texts_cut() {
        assert_eq!(readable("a\u{202e}b\u{0}\n"), "a⟨U+202E⟩b⟨U+0000⟩\n");
        let long = readable(&"ü".repeat(MAX_CHARS + 1));
        assert!(long.ends_with("ü … (4001 characters, cut here)"));
    }
}
