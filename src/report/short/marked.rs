//! Alerts and findings as lines of the terminal, with their signs in colour: [`alert`] and [`sentence`].
//!
//! Colours stand in the text as ANSI sequences; whoever prints it takes them out where the terminal has none. A sign or a word says
//! the same as each colour.

use clap::builder::styling::{AnsiColor, Style};

use super::foot::BELOW;
use crate::sentences::{Sentence, Tone};
use crate::text::alert::Alert;
use crate::text::wrapped::wrapped;
use crate::types::shown_text::shown;

/// An alert, wrapped.
pub(in crate::report) fn alert(alert: &Alert) -> String {
    marked(
        &wrapped("! ", &shown(&alert.text), "  "),
        1,
        colour(AnsiColor::Yellow),
    )
}

/// A sentence with its sign, and its detail beneath.
pub(in crate::report) fn sentence(sentence: &Sentence) -> String {
    let sign = format!(" {}  ", sentence.tone.sign());
    let style = match sentence.tone {
        Tone::Better => colour(AnsiColor::Green),
        Tone::Worse => colour(AnsiColor::Red),
        Tone::NotShown | Tone::Note => Style::new().bold(),
    };
    let text = wrapped(&sign, &shown(&sentence.text), "    ");
    marked(&text, 2, style) + &wrapped("    ", &shown(&sentence.detail), "    ")
}

/// A table with its marks of what is below the words alone in red.
pub(super) fn table(text: &str) -> String {
    let style = colour(AnsiColor::Red);
    shown(text).replace(BELOW, &format!("{style}{BELOW}{style:#}"))
}

fn colour(colour: AnsiColor) -> Style {
    Style::new().bold().fg_color(Some(colour.into()))
}

/// Lines of which the first `sign` letters are in a style.
fn marked(lines: &str, sign: usize, style: Style) -> String {
    let at = lines.char_indices().nth(sign);
    let (sign, rest) = lines.split_at(at.map_or(lines.len(), |(at, _)| at));
    format!("{style}{sign}{style:#}{rest}")
}
