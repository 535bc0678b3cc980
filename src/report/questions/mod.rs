//! Reports on a set of questions: statistics as a table, as files and as a figure, checks by people, and comparison
//! with another set.

pub(crate) mod against;
pub(crate) mod checks;
pub(crate) mod figure;
pub(crate) mod review;

use std::fmt::Display;

use against::AppearanceComparison;
use serde::Serialize;

use crate::error::{Error, Result};
use crate::report::text::csv as files;
use crate::report::text::table::ColumnKind::{Count, Text};
use crate::report::text::table::TableBuilder;
use crate::report::text::terminal;
use crate::types::Family;
use crate::types::text::counted;
use darkqa_questions::summary::{Baselines, CandidateCounts, QuestionSummary};
use darkqa_score::answers::checks::Checks;

/// Maximum number of reasons in a row of the table.
const MAX_REASONS: usize = 3;

/// Table for the terminal: questions by family, with the scores of answering without images and the number of valid
/// candidates.
#[must_use]
pub(crate) fn table(summary: &QuestionSummary) -> String {
    let families = Family::PAPER.iter().filter_map(|family| {
        let candidates = summary.candidates.get(family)?;
        Some((family.name(), Some(candidates)))
    });
    let total = summary.baselines.get(Family::TOTAL);
    let rows = families.chain(total.map(|_| (Family::TOTAL, None)));
    let table = TableBuilder::new("questions", rows)
        .column(Text, "terminal family", |(family, _)| *family)
        .column(Count, "terminal questions", |(_, candidates)| {
            candidates.map_or(summary.questions, |counts| counts.asked as usize)
        })
        .column(Count, "terminal chance %", |(family, _)| baseline_text(summary, family, |base| base.chance))
        .column(Count, "terminal majority %", |(family, _)| baseline_text(summary, family, |base| base.majority as f64))
        .column(Count, "terminal prior %", |(family, _)| baseline_text(summary, family, |base| base.prior))
        .column(Count, "terminal candidates that hold", |(_, candidates)| {
            candidates.map_or(String::new(), |counts| counts.viable.to_string())
        })
        .column(Text, "terminal why others do not", |(_, candidates)| candidates.map_or(String::new(), reasons))
        .build();
    let notes: String = notes(summary).into_iter().map(|note| note + "\n").collect();
    terminal::table(&[table]) + &notes
}

/// Score of a way to answer without images, in percent. `right` reads the expected number of right answers.
fn baseline_text(summary: &QuestionSummary, family: &str, right: fn(&Baselines) -> f64) -> String {
    let baselines = summary.baselines.get(family).filter(|baselines| baselines.questions > 0);
    baselines
        .map_or("–".to_owned(), |baselines| format!("{:.1}", 100.0 * right(baselines) / baselines.questions as f64))
}

/// Most frequent reasons for rejected candidates, with counts.
fn reasons(candidates: &CandidateCounts) -> String {
    let mut rejected: Vec<(String, u64)> =
        candidates.rejections.iter().map(|(reason, count)| (variant_words(reason), *count)).collect();
    rejected.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    let reasons: Vec<String> =
        rejected.iter().take(MAX_REASONS).map(|(reason, count)| format!("{reason} {count}")).collect();
    reasons.join(", ")
}

/// Notes below the table.
fn notes(summary: &QuestionSummary) -> Vec<String> {
    let mut notes = vec![format!(
        "{} about {} of {}; prior: the commonest answer to the same words in other scenes",
        counted(summary.questions, "question"),
        counted(summary.frames, "frame"),
        counted(summary.scenes, "scene")
    )];
    let candidates = summary.candidates.values();
    let unbalanced: u64 = candidates.clone().map(|counts| counts.unbalanced).sum();
    let rejected: u64 = candidates.map(|counts| counts.rejected).sum();
    if unbalanced > 0 {
        notes.push(format!("{unbalanced} more were left out to even out the answers (--balance {})", summary.balance));
    }
    if rejected > 0 {
        notes.push(format!("{rejected} more were rejected by a person"));
    }
    let [both, same] = summary.room_agreement;
    if both > 0 {
        notes.push(format!("rooms: {same} of {both} that are both seen and stated agree"));
    }
    if summary.dark > 0 {
        notes.push(format!("too dark to ask about: {}", counted(summary.dark, "frame")));
    }
    if summary.failed > 0 {
        notes.push(format!("no questions, because measuring failed: {}", counted(summary.failed, "frame")));
    }
    if !summary.unknown.is_empty() {
        let ids: Vec<String> = summary.unknown.keys().take(8).map(u16::to_string).collect();
        notes.push(format!(
            "{} not in classes.json and read as unlabelled, for example {} (--strict makes this an error)",
            counted(summary.unknown.len(), "number"),
            ids.join(", ")
        ));
    }
    notes
}

/// Serialized name of an enum variant, with spaces for underscores.
fn variant_words<T: serde::Serialize>(value: &T) -> String {
    let json = serde_json::to_value(value).unwrap_or_default();
    json.as_str().unwrap_or_default().replace('_', " ")
}

/// Content of the JSON file: the summary, checks by people, and a comparison with another set.
#[derive(Serialize)]
struct SummaryFile<'a> {
    #[serde(flatten)]
    summary: &'a QuestionSummary,
    #[serde(skip_serializing_if = "Option::is_none")]
    checks: Option<serde_json::Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    against: Option<&'a AppearanceComparison>,
}

/// Serializes the summary as JSON, with the checks by people and a comparison with another set, if there are any.
///
/// # Errors
/// If the statistics cannot be serialized.
pub(crate) fn json(
    summary: &QuestionSummary,
    checks: &Checks,
    against: Option<&AppearanceComparison>,
) -> Result<String> {
    let file = SummaryFile { summary, checks: (!checks.is_empty()).then(|| checks::json(checks)), against };
    serde_json::to_string_pretty(&file).map(|text| text + "\n").map_err(|e| Error::data("statistics", e))
}

/// Writes all counts as CSV with the columns `table, row, column, count`.
///
/// # Errors
/// If the statistics cannot be written.
pub(crate) fn csv(summary: &QuestionSummary) -> Result<Vec<u8>> {
    let mut rows: Vec<[String; 4]> = Vec::new();
    let mut row = |table: &str, row: &dyn Display, column: &str, count: &dyn Display| {
        rows.push([table, &row.to_string(), column, &count.to_string()].map(str::to_owned));
    };
    for (name, count) in [
        ("scenes", summary.scenes),
        ("frames", summary.frames),
        ("failed", summary.failed),
        ("dark", summary.dark),
        ("questions", summary.questions),
        ("repeats", summary.repeats),
    ] {
        row("all", &name, "", &count);
    }
    for (family, candidates) in &summary.candidates {
        let name = family.name();
        row("candidates", &name, "viable", &candidates.viable);
        row("candidates", &name, "asked", &candidates.asked);
        row("candidates", &name, "not_chosen", &candidates.not_chosen);
        row("candidates", &name, "rejected", &candidates.rejected);
        row("candidates", &name, "unbalanced", &candidates.unbalanced);
        for (reason, count) in &candidates.rejections {
            row("fallen", &name, &variant_words(reason), count);
        }
    }
    for (questions, frames) in &summary.per_frame {
        row("per_frame", questions, "frames", frames);
    }
    for (family, answers) in &summary.answers {
        for (answer, count) in answers {
            row("answers", &family.name(), answer, count);
        }
    }
    for (words, count) in &summary.texts {
        row("texts", words, "", count);
    }
    for (choices, count) in &summary.choices {
        row("choices", choices, "questions", count);
    }
    for (family, subjects) in &summary.polarity {
        for (about, [yes, no]) in subjects {
            row(family.name(), about, "yes", yes);
            row(family.name(), about, "no", no);
        }
    }
    for (class, coverage) in &summary.classes {
        row("classes", class, "pixels", &coverage.pixels);
        row("classes", class, "segments", &coverage.segments);
        row("classes", class, "frames", &coverage.frames);
        row("classes", class, "questions", &coverage.questions);
    }
    for (room, counts) in &summary.rooms {
        row("rooms", room, "frames", &counts.frames);
        row("rooms", room, "questions", &counts.questions);
    }
    for (gap, count) in &summary.gaps {
        row("gaps_mm", gap, "questions", count);
    }
    for (family, base) in &summary.baselines {
        row("baselines", family, "questions", &base.questions);
        row("baselines", family, "chance", &base.chance);
        row("baselines", family, "majority", &base.majority);
        row("baselines", family, "prior", &base.prior);
    }
    let table = TableBuilder::new("statistics", rows)
        .column(Text, "csv table", |[table, ..]| table.clone())
        .column(Text, "csv row", |[_, row, ..]| row.clone())
        .column(Text, "csv column", |[.., column, _]| column.clone())
        .column(Count, "csv count", |[.., count]| count.clone())
        .build();
    files::csv(&[table])
}
