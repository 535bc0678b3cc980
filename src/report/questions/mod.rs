//! Statistics of a set of questions: a table, files of all counts, and a figure.

pub(crate) mod against;
pub(crate) mod checks;
pub(crate) mod figure;
pub(crate) mod review;

use std::fmt::{Display, Write as _};

use against::LookComparison;
use serde::Serialize;

use crate::error::{Error, Result};
use crate::text::csv as files;
use crate::text::table::ColumnKind::{Count, Text};
use crate::text::table::TableBuilder;
use crate::text::terminal;
use crate::text::words::counted;
use crate::types::Family;
use darkqa_questions::summary::{Baselines, CandidateCounts, QuestionSummary};
use darkqa_score::answers::checks::Checks;

/// Maximum number of reasons in a line of the table.
const REASONS: usize = 3;

/// The table for the terminal: questions by family, with their candidates and with the scores of answering without images.
#[must_use]
pub(crate) fn table(summary: &QuestionSummary) -> String {
    let families = Family::PAPER.iter().filter_map(|family| {
        let candidates = summary.candidates.get(family)?;
        Some((family.name(), Some(candidates)))
    });
    let whole = summary.baselines.get(Family::TOTAL);
    let rows = families.chain(whole.map(|_| (Family::TOTAL, None)));
    let share = |family: &str, right: fn(&Baselines) -> f64| {
        let base = summary
            .baselines
            .get(family)
            .filter(|base| base.questions > 0);
        base.map_or("–".to_owned(), |base| {
            format!("{:.1}", 100.0 * right(base) / base.questions as f64)
        })
    };
    let table = TableBuilder::new("questions", rows)
        .column(Text, "terminal family", |(family, _)| *family)
        .column(Count, "terminal questions", |(_, candidates)| {
            candidates.map_or(summary.questions, |counts| counts.asked as usize)
        })
        .column(Count, "terminal chance %", |(family, _)| {
            share(family, |base| base.chance)
        })
        .column(Count, "terminal majority %", |(family, _)| {
            share(family, |base| base.majority as f64)
        })
        .column(Count, "terminal prior %", |(family, _)| {
            share(family, |base| base.prior)
        })
        .column(Count, "terminal candidates that hold", |(_, candidates)| {
            candidates.map_or(String::new(), |counts| counts.viable.to_string())
        })
        .column(Text, "terminal why others do not", |(_, candidates)| {
            candidates.map_or(String::new(), reasons)
        })
        .build();
    let mut text = terminal::table(&[table]);
    notes(summary, &mut text);
    text
}

/// The most frequent reasons for rejected candidates, with counts.
fn reasons(candidates: &CandidateCounts) -> String {
    let mut rejected: Vec<(String, u64)> = candidates
        .rejections
        .iter()
        .map(|(reason, count)| (variant_words(reason), *count))
        .collect();
    rejected.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    let reasons: Vec<String> = rejected
        .iter()
        .take(REASONS)
        .map(|(reason, count)| format!("{reason} {count}"))
        .collect();
    reasons.join(", ")
}

/// Appends the notes below the table.
fn notes(summary: &QuestionSummary, text: &mut String) {
    let mut note = |line: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{line}");
    };
    note(format!(
        "{} about {} of {}; prior: the commonest answer to the same words in other scenes",
        counted(summary.questions, "question"),
        counted(summary.frames, "frame"),
        counted(summary.scenes, "scene")
    ));
    let sum = |count: fn(&CandidateCounts) -> u64| -> u64 {
        summary.candidates.values().map(count).sum()
    };
    let (unbalanced, rejected) = (sum(|c| c.unbalanced), sum(|c| c.rejected));
    if unbalanced > 0 {
        note(format!(
            "{unbalanced} more were left out to even out the answers (--balance {})",
            summary.balance
        ));
    }
    if rejected > 0 {
        note(format!("{rejected} more were rejected by a person"));
    }
    let [both, same] = summary.room_agreement;
    if both > 0 {
        note(format!(
            "rooms: {same} of {both} that are both seen and stated agree"
        ));
    }
    if summary.dark > 0 {
        note(format!(
            "too dark to ask about: {}",
            counted(summary.dark, "frame")
        ));
    }
    if summary.failed > 0 {
        note(format!(
            "no questions, because measuring failed: {}",
            counted(summary.failed, "frame")
        ));
    }
    if !summary.unknown.is_empty() {
        let ids: Vec<String> = summary.unknown.keys().take(8).map(u16::to_string).collect();
        note(format!(
            "{} not in classes.json and read as unlabelled, for example {} (--strict makes this an error)",
            counted(summary.unknown.len(), "number"),
            ids.join(", ")
        ));
    }
}

/// The serialised name of a unit variant, with spaces.
fn variant_words<T: serde::Serialize>(value: &T) -> String {
    let json = serde_json::to_value(value).unwrap_or_default();
    json.as_str().unwrap_or_default().replace('_', " ")
}

/// The summary, with what people found about the questions and the comparison with another set.
#[derive(Serialize)]
struct WrittenSummary<'a> {
    #[serde(flatten)]
    summary: &'a QuestionSummary,
    #[serde(skip_serializing_if = "Option::is_none")]
    checks: Option<serde_json::Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    against: Option<&'a LookComparison>,
}

/// The summary as JSON, with what people found about the questions and the comparison with another set, if there is one.
///
/// # Errors
/// If the statistics cannot be written.
pub(crate) fn json(
    summary: &QuestionSummary,
    checks: &Checks,
    against: Option<&LookComparison>,
) -> Result<String> {
    let wrong = |e: serde_json::Error| Error::data("statistics", e);
    let written = WrittenSummary {
        summary,
        checks: (!checks.is_empty()).then(|| checks::json(checks)),
        against,
    };
    Ok(serde_json::to_string_pretty(&written).map_err(wrong)? + "\n")
}

/// All counts as CSV: `table, row, column, count`.
///
/// # Errors
/// If the statistics cannot be written.
pub(crate) fn csv(summary: &QuestionSummary) -> Result<Vec<u8>> {
    let mut rows: Vec<[String; 4]> = Vec::new();
    let mut row = |table: &str, row: &dyn Display, column: &str, count: &dyn Display| {
        rows.push([table, &row.to_string(), column, &count.to_string()].map(str::to_owned));
    };
    for (what, count) in [
        ("scenes", summary.scenes),
        ("frames", summary.frames),
        ("failed", summary.failed),
        ("dark", summary.dark),
        ("questions", summary.questions),
        ("repeats", summary.repeats),
    ] {
        row("all", &what, "", &count);
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
