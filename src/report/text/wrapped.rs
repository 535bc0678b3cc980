//! Text wrapped into lines: [`wrapped`].

use crate::report::text::width::columns;

/// Maximum width of a line in characters.
pub(crate) const WIDTH: usize = 80;

/// Wraps a text at [`WIDTH`] characters, or at the width of a narrower terminal. The first line begins with `first`,
/// the others with `rest`.
pub(crate) fn wrapped(first: &str, text: &str, rest: &str) -> String {
    wrapped_to(WIDTH.min(columns()), first, text, rest)
}

/// Wraps a text at `width` characters. The first line begins with `first`, the others with `rest`.
pub(crate) fn wrapped_to(width: usize, first: &str, text: &str, rest: &str) -> String {
    let mut lines = String::new();
    let mut line = first.to_owned();
    let mut is_empty = true;
    for word in text.split(' ') {
        if !is_empty && line.chars().count() + 1 + word.chars().count() > width {
            lines += line.trim_end();
            lines.push('\n');
            rest.clone_into(&mut line);
            is_empty = true;
        }
        if !is_empty {
            line.push(' ');
        }
        line += word;
        is_empty = false;
    }
    lines + line.trim_end() + "\n"
}
