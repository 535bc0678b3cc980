//! Alerts and findings as lines of the terminal, with their signs in colour: [`alert`], [`summary`], [`signed`] and [`sentence`].
//!
//! Colours stand in the text as ANSI sequences; whoever prints it takes them out where the terminal has none. A sign or a word states
//! the same as each colour.

use clap::builder::styling::{AnsiColor, Style};

use super::foot::BELOW;
use crate::sentences::{Sentence, Tone};
use crate::text::alert::Alert;
use crate::text::wrapped::wrapped;
use crate::types::text::escape_hidden;

/// An alert, wrapped.
pub(super) fn alert(alert: &Alert) -> String {
    marked(
        &wrapped("! ", &escape_hidden(&alert.text), "  "),
        1,
        colour(AnsiColor::Yellow),
    )
}

/// A sentence with its sign, and its detail beneath.
pub(super) fn sentence(sentence: &Sentence) -> String {
    let first = format!(" {}  ", sentence.tone.sign());
    let text = wrapped(&first, &escape_hidden(&sentence.text), "    ");
    signed(&text, 2, sentence.tone) + &wrapped("    ", &escape_hidden(&sentence.detail), "    ")
}

/// Lines whose sign ends at a column, in the colour of the tone.
pub(super) fn signed(lines: &str, end: usize, tone: Tone) -> String {
    let style = match tone {
        Tone::Better => colour(AnsiColor::Green),
        Tone::Worse => colour(AnsiColor::Red),
        Tone::NotShown | Tone::Note => Style::new().bold(),
    };
    marked(lines, end, style)
}

/// The summary of a report, in bold.
pub(super) fn summary(text: &str) -> String {
    let lines = wrapped(" ", &escape_hidden(text), " ");
    let style = Style::new().bold();
    format!("{style}{}{style:#}\n", lines.trim_end())
}

/// The title of a group of findings.
pub(super) fn heading(title: &str) -> String {
    format!(" {title}\n")
}

/// A table with its marks of what is below the score without images in red.
pub(super) fn table(text: &str) -> String {
    let style = colour(AnsiColor::Red);
    escape_hidden(text).replace(BELOW, &format!("{style}{BELOW}{style:#}"))
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
