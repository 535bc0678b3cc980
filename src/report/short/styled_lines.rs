//! Lines of a terminal report with coloured signs: [`alert`], [`summary`], [`sentence`], [`heading`] and [`table`].
//!
//! Colours are ANSI sequences; the code that prints a text removes them if the terminal has no colours. A sign or a
//! word always has the same meaning as the colour.

use clap::builder::styling::{AnsiColor, Style};

use super::foot::BELOW;
use crate::report::sentences::{Sentence, Tone};
use crate::report::text::alert::Alert;
use crate::report::text::wrapped::wrapped;
use crate::types::text::escape_hidden;

/// Wrapped text of an alert with its sign.
pub(super) fn alert(alert: &Alert) -> String {
    style_start(&wrapped("! ", &escape_hidden(&alert.text), "  "), 1, colour(AnsiColor::Yellow))
}

/// Wrapped text of a sentence with its sign, and its detail below.
pub(super) fn sentence(sentence: &Sentence) -> String {
    let first = format!(" {}  ", sentence.tone.sign());
    let text = wrapped(&first, &escape_hidden(&sentence.text), "    ");
    colour_sign(&text, 2, sentence.tone) + &wrapped("    ", &escape_hidden(&sentence.detail), "    ")
}

/// Applies the colour of a tone to the first `end` characters, at the end of which the sign is.
pub(super) fn colour_sign(lines: &str, end: usize, tone: Tone) -> String {
    let style = match tone {
        Tone::Better => colour(AnsiColor::Green),
        Tone::Worse => colour(AnsiColor::Red),
        Tone::NotShown | Tone::Note => Style::new().bold(),
    };
    style_start(lines, end, style)
}

/// Summary of a report, in bold.
pub(super) fn summary(text: &str) -> String {
    let lines = wrapped(" ", &escape_hidden(text), " ");
    let style = Style::new().bold();
    format!("{style}{}{style:#}\n", lines.trim_end())
}

/// Title of a group of findings.
pub(super) fn heading(title: &str) -> String {
    format!(" {title}\n")
}

/// Applies red to the marks of accuracies below the accuracy without images in a table.
pub(super) fn table(text: &str) -> String {
    let style = colour(AnsiColor::Red);
    escape_hidden(text).replace(BELOW, &format!("{style}{BELOW}{style:#}"))
}

fn colour(colour: AnsiColor) -> Style {
    Style::new().bold().fg_color(Some(colour.into()))
}

/// Applies a style to the first `count` characters of a text.
fn style_start(text: &str, count: usize, style: Style) -> String {
    let end = text.char_indices().nth(count).map_or(text.len(), |(index, _)| index);
    let (start, rest) = text.split_at(end);
    format!("{style}{start}{style:#}{rest}")
}
