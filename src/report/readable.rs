//! What models said, as a page can show it: [`readable`].

use std::fmt::Write;

/// The most characters of a text that are shown.
const MOST: usize = 4_000;

/// A text with its hidden signs written out as ⟨U+202E⟩: controls, and what turns the direction of text or shows nothing. One that
/// is longer than a page has room for is cut, and says so.
#[must_use]
pub(super) fn readable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len().min(MOST));
    for c in text.chars().take(MOST) {
        if is_hidden(c) {
            let _ = write!(shown, "⟨U+{:04X}⟩", u32::from(c));
        } else {
            shown.push(c);
        }
    }
    let all = text.chars().count();
    if all > MOST {
        let _ = write!(shown, " … ({all} characters, cut here)");
    }
    shown
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
    fn hidden_signs_are_written_out_and_long_texts_cut() {
        assert_eq!(readable("a\u{202e}b\u{0}\n"), "a⟨U+202E⟩b⟨U+0000⟩\n");
        let long = readable(&"ü".repeat(MOST + 1));
        assert!(long.ends_with("ü … (4001 characters, cut here)"));
    }
}
