//! Terminal text of a report on questions without true answers: [`text`].

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use super::agreement_report::AgreementReport;
use super::levels::{levels, notes};
use super::measure::HOW_TO_READ;
use crate::report::finding_groups::FindingGroups;
use crate::report::short::findings::findings;
use crate::report::text::noise_profiles::NoiseProfiles;
use crate::report::text::terminal::{render, table};
use crate::report::text::wrapped::wrapped;
use crate::runs::report_length::ReportLength;
use crate::types::manifests::RunManifest;
use crate::types::text::{counted, plural};
use darkqa_score::accuracies::Health;

/// Renders the report as text. `runs` are the manifests with the folders of their runs.
#[must_use]
pub(crate) fn text(report: &AgreementReport<'_>, runs: &[(&RunManifest, &Path)], length: ReportLength) -> String {
    let groups = FindingGroups::new(&report.sentences);
    let mut text = findings(&head(report), &report.alerts, &groups, length, HOW_TO_READ);
    match length {
        ReportLength::Findings => return text,
        ReportLength::Summary => text += &short_tables(report),
        ReportLength::Full => text += &render(&report.tables),
    }
    if let Some(question) = NoiseProfiles::new(&report.found.grid.subjects).open_question() {
        text += &wrapped(" ", &question, " ");
    }
    for (_, folder) in runs {
        let _ = writeln!(text, "run: {}", folder.display());
    }
    text
}

/// Table of each axis with a wrapped heading, and the notes.
fn short_tables(report: &AgreementReport<'_>) -> String {
    let mut text = String::new();
    for levels in levels(report.found) {
        text += &wrapped(" ", levels.heading.as_deref().unwrap_or_default(), " ");
        text += &table(&[levels]);
    }
    for note in notes(report.found) {
        text += &wrapped(" ", &note, "   ");
    }
    text
}

/// Head line with the numbers of models, questions, images and replies.
pub(super) fn head(report: &AgreementReport<'_>) -> String {
    let found = report.found;
    let items = &found.grid.items;
    let models = found.models();
    let who = match &models[..] {
        [one] => (*one).to_owned(),
        several => counted(several.len(), "model"),
    };
    let questions: BTreeSet<_> = items.iter().map(|item| &*item.asked.question).collect();
    let frames: BTreeSet<_> = items.iter().map(|item| &*item.asked.frame).collect();
    let replies: usize = found.health.iter().map(|health| health.replies).sum();
    let failed: usize = found.health.iter().map(Health::failures).sum();
    format!(
        "{who} · {} without answers · {} · {}, {failed} failed · intervals by {}",
        counted(questions.len(), "question"),
        counted(frames.len(), "image"),
        plural(replies, "reply", "replies"),
        found.unit
    )
}
