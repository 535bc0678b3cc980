//! Text in lines of one width: [`wrapped`].

use crate::text::width::columns;

/// Width of the text in characters, where the terminal has room for it.
pub(crate) const WIDTH: usize = 80;

/// Text in lines of [`WIDTH`] characters, or as many as the terminal has; the first begins with `first`, the others with `rest`.
pub(crate) fn wrapped(first: &str, text: &str, rest: &str) -> String {
    wrapped_to(WIDTH.min(columns()), [first, text, rest])
}

/// Text in lines of `width` characters, as by [`wrapped`].
pub(crate) fn wrapped_to(width: usize, [first, text, rest]: [&str; 3]) -> String {
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
