//! Accuracy by level: a row a model, variant and enhancer.

use crate::report::ladder::{Ladder, LadderRow};
use crate::report::table::ColumnKind::Count;
use crate::report::table::{ColumnKind, Table, TableCell, TableFormat, TableRow};
use crate::report::terminal::{differing, texts};
use crate::report::words::percent;
use crate::score::accuracy::{AccuracyCell, AccuracySummary};
use crate::score::choice::ReadingMode;
use crate::score::findings::Findings;
use crate::types::UnreadReason;

pub(super) fn levels(findings: &Findings<'_>) -> Table {
    let summary = &findings.summary;
    let strict = summary.of(None, ReadingMode::Strict);
    let ladder = Ladder::new(strict.map(|cell| (&cell.subject, cell)));
    let mut table = ladder
        .layout("levels", |cell| {
            cell.map_or(TableCell::Blank, |cell| accuracy(summary, cell))
        })
        .page(
            "accuracy",
            "Accuracy in % by level, with half of the 95 % interval",
        )
        .column(Count, "terminal n", |line| replies(line))
        .column(Count, "terminal unparsed", |line| {
            let strict = line.sum(|cell| cell.unparsed).to_string();
            let lenient =
                |cell: &AccuracyCell| lenient(summary, cell).map_or(0, |cell| cell.unparsed);
            let lenient = line.sum(lenient).to_string();
            format!("{strict}{}", differing(&strict, &lenient))
        })
        .column(Count, "terminal failed", |line| {
            line.sum(|cell| cell.failed)
        })
        .made();
    add_always(&mut table, &ladder);
    table.heading = Some(
        "Accuracy in %: strict ± half of the 95 % interval (lenient where it differs); n replies at each level"
            .to_owned(),
    );
    table.latex = Some(format!(
        "Accuracy in \\% (strict reading) with half of the 95\\,\\% interval by {}; {} items.",
        findings.unit,
        findings.grid.items.len()
    ));
    table.notes = notes(summary, &ladder);
    table
}

fn lenient<'a>(summary: &'a AccuracySummary, strict: &AccuracyCell) -> Option<&'a AccuracyCell> {
    summary.cell(
        &strict.subject,
        strict.family.as_ref(),
        ReadingMode::Lenient,
    )
}

fn accuracy(summary: &AccuracySummary, cell: &AccuracyCell) -> TableCell {
    let Some(strict) = cell.accuracy else {
        return TableCell::Missing;
    };
    if cell.subject.view.is_none() {
        return TableCell::Guess(strict);
    }
    match lenient(summary, cell).and_then(|cell| cell.accuracy) {
        Some(lenient) => TableCell::Strict(strict, lenient.value),
        None => TableCell::Estimate(strict),
    }
}

/// How many replies stand behind the numbers of a series, from the least to the most.
fn replies(line: &LadderRow<'_, AccuracyCell>) -> String {
    let replies = line.steps().map(AccuracyCell::replies);
    match (replies.clone().min(), replies.max()) {
        (Some(least), Some(most)) if least != most => format!("{least}–{most}"),
        (least, _) => least.unwrap_or(0).to_string(),
    }
}

/// The share of questions that were answered rightly every time.
fn always(cell: &AccuracyCell) -> Option<String> {
    Some(percent(cell.always?.value))
}

/// Adds to the terminal, below each series that was asked more than once, how often it was right every time.
fn add_always(table: &mut Table, ladder: &Ladder<'_, AccuracyCell>) {
    for (place, steps) in ladder.series.values().enumerate().rev() {
        if steps.values().all(|cell| cell.always.is_none()) {
            continue;
        }
        let levels = ladder.levels.iter();
        let at = levels.map(
            |level| match steps.get(level).and_then(|cell| always(cell)) {
                Some(share) => TableCell::Text(share),
                None => TableCell::Blank,
            },
        );
        let names = [
            TableCell::Blank,
            "  right every time".into(),
            TableCell::Blank,
            TableCell::Blank,
        ];
        let row = TableRow {
            cells: names.into_iter().chain(at).collect(),
            hidden_in: vec![TableFormat::Page, TableFormat::Latex],
        };
        table.rows.insert(place + 1, row);
    }
}

/// The lines below the table: models without images, chance, and why replies could not be read.
fn notes(summary: &AccuracySummary, ladder: &Ladder<'_, AccuracyCell>) -> Vec<String> {
    let floors = ladder.floors.iter().map(|(_, cell)| *cell);
    let (chance, blind): (Vec<&AccuracyCell>, Vec<&AccuracyCell>) =
        floors.partition(|cell| cell.subject.view.is_none());
    let mut notes: Vec<String> = blind.into_iter().map(|cell| floor(summary, cell)).collect();
    let mut all = summary.of(None, ReadingMode::Strict);
    let asked = if all.any(|cell| cell.always.is_some()) {
        "orders of choices"
    } else {
        "questions"
    };
    let chance = chance.into_iter().filter_map(|cell| cell.accuracy);
    notes.extend(chance.map(|chance| {
        let share = 100.0 * chance.value;
        format!("chance: {share:.2} over {} {asked}", chance.n)
    }));
    notes.extend(unread(summary));
    notes
}

fn floor(summary: &AccuracySummary, cell: &AccuracyCell) -> String {
    let accuracy = texts(ColumnKind::Accuracy, &accuracy(summary, cell)).concat();
    let always = always(cell).map(|share| format!(", right every time {share}"));
    let unparsed = cell.unparsed.to_string();
    let lenient = lenient(summary, cell).map(|cell| cell.unparsed.to_string());
    let lenient = lenient.map(|lenient| differing(&unparsed, &lenient));
    format!(
        "{} without images: {accuracy}, n {}{}, unparsed {unparsed}{}, failed {}",
        cell.subject.model,
        cell.replies(),
        always.unwrap_or_default(),
        lenient.unwrap_or_default(),
        cell.failed
    )
}

/// Why replies could not be read, if that is not the model's own way of answering.
fn unread(summary: &AccuracySummary) -> Option<String> {
    let reasons = [
        (
            UnreadReason::Truncated,
            "cut at the token limit (--max-tokens)",
        ),
        (UnreadReason::Refused, "refused"),
        (UnreadReason::Filtered, "withheld by a filter"),
        (UnreadReason::Empty, "empty"),
    ];
    let counts = reasons.iter().filter_map(|(why, what)| {
        let count = summary.unread.get(why).filter(|count| **count > 0)?;
        Some(format!("{count} {what}"))
    });
    let counts: Vec<String> = counts.collect();
    (!counts.is_empty()).then(|| format!("of the unparsed replies {}", counts.join(", ")))
}
