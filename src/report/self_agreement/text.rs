//! The text of a report without true answers in the terminal: [`text`].

use std::fmt::Write;
use std::path::Path;

use super::agreement_report::AgreementReport;
use super::levels::{levels, notes};
use super::measure::HOW_TO_READ;
use crate::report::short::marked;
use crate::text::alert::lines;
use crate::text::light_readings::LightReadings;
use crate::text::terminal::{line, render, table};
use crate::text::words::counted;
use crate::text::wrapped::wrapped;
use crate::types::manifest::RunManifest;
use darkqa_score::health::Health;

/// How much of a report is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TextLength {
    /// The findings alone.
    Findings,
    /// The findings and the table of levels.
    Short,
    /// Everything.
    Full,
}

/// The report as text. `runs` are the runs with their folders.
#[must_use]
pub(crate) fn text(
    report: &AgreementReport<'_>,
    runs: &[(&RunManifest, &Path)],
    length: TextLength,
) -> String {
    let mut text = String::new();
    if length == TextLength::Full {
        text += &lines(&report.alerts);
        for sentence in &report.sentences {
            text += &marked::sentence(sentence);
        }
        text += &line([" ", HOW_TO_READ, " "]);
        text.push('\n');
        text += &render(&report.tables);
    } else {
        text += &findings(report);
    }
    if length == TextLength::Short {
        text += &short_tables(report);
    }
    if length != TextLength::Findings {
        let readings = LightReadings::of(&report.found.grid.subjects);
        let open = readings.open_question();
        text += &open.map_or_else(String::new, |open| wrapped(" ", &open, " "));
        for (_, folder) in runs {
            let _ = writeln!(text, "run: {}", folder.display());
        }
    }
    text
}

/// The head, the alerts and the sentences.
fn findings(report: &AgreementReport<'_>) -> String {
    let mut text = head(report) + "\n";
    for alert in &report.alerts {
        text += &marked::alert(alert);
    }
    for sentence in &report.sentences {
        text += &marked::sentence(sentence);
    }
    text + &wrapped(" ", HOW_TO_READ, " ")
}

/// The table of each axis, within the width of a terminal as far as its levels allow, and the notes.
fn short_tables(report: &AgreementReport<'_>) -> String {
    let mut text = String::from("\n");
    for part in levels(report.found) {
        text += &wrapped(" ", part.heading.as_deref().unwrap_or_default(), " ");
        text += &table(&[part]);
    }
    for note in notes(report.found) {
        text += &wrapped(" ", &note, "   ");
    }
    text
}

/// Numbers of models, questions, images and replies.
pub(super) fn head(report: &AgreementReport<'_>) -> String {
    let found = report.found;
    let items = &found.grid.items;
    let models = found.models();
    let who = match &models[..] {
        [one] => (*one).to_owned(),
        several => counted(several.len(), "model"),
    };
    let questions = items.iter().map(|item| &*item.asked.question);
    let questions: std::collections::BTreeSet<_> = questions.collect();
    let frames = items.iter().map(|item| &*item.asked.frame);
    let frames: std::collections::BTreeSet<_> = frames.collect();
    let replies: usize = found.health.iter().map(|health| health.replies).sum();
    let failed: usize = found.health.iter().map(Health::failures).sum();
    format!(
        "{who} · {} without answers · {} · {replies} replies, {failed} failed · intervals by {}",
        counted(questions.len(), "question"),
        counted(frames.len(), "image"),
        found.unit
    )
}
