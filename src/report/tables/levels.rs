//! Accuracy by level: a row a model, variant and enhancer.

use crate::report::ladder::{Ladder, Line};
use crate::report::table::Kind::Count;
use crate::report::table::{Cell, Format, Kind, Row, Table};
use crate::report::terminal::{differing, texts};
use crate::report::words::percent;
use crate::score::accuracy::{Cell as Score, Summary};
use crate::score::choice::Mode;
use crate::score::findings::Findings;
use crate::types::UnreadReason;

pub(super) fn levels(findings: &Findings<'_>) -> Table {
    let summary = &findings.summary;
    let strict = summary.of(None, Mode::Strict);
    let ladder = Ladder::new(strict.map(|cell| (&cell.subject, cell)));
    let mut table = ladder
        .layout("levels", |cell| {
            cell.map_or(Cell::Blank, |cell| accuracy(summary, cell))
        })
        .page(
            "accuracy",
            "Accuracy in % by level, with half of the 95 % interval",
        )
        .column(Count, "terminal n", |line| replies(line))
        .column(Count, "terminal unparsed", |line| {
            let strict = line.sum(|cell| cell.unparsed).to_string();
            let lenient = |cell: &Score| lenient(summary, cell).map_or(0, |cell| cell.unparsed);
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

fn lenient<'a>(summary: &'a Summary, strict: &Score) -> Option<&'a Score> {
    summary.cell(&strict.subject, strict.family.as_ref(), Mode::Lenient)
}

fn accuracy(summary: &Summary, cell: &Score) -> Cell {
    let Some(strict) = cell.accuracy else {
        return Cell::Missing;
    };
    if cell.subject.view.is_none() {
        return Cell::Guess(strict);
    }
    match lenient(summary, cell).and_then(|cell| cell.accuracy) {
        Some(lenient) => Cell::Strict(strict, lenient.value),
        None => Cell::Estimate(strict),
    }
}

/// How many replies stand behind the numbers of a series, from the least to the most.
fn replies(line: &Line<'_, Score>) -> String {
    let replies = line.steps().map(Score::replies);
    match (replies.clone().min(), replies.max()) {
        (Some(least), Some(most)) if least != most => format!("{least}–{most}"),
        (least, _) => least.unwrap_or(0).to_string(),
    }
}

/// The share of questions that were answered rightly every time.
fn always(cell: &Score) -> Option<String> {
    Some(percent(cell.always?.value))
}

/// Adds to the terminal, below each series that was asked more than once, how often it was right every time.
fn add_always(table: &mut Table, ladder: &Ladder<'_, Score>) {
    for (place, steps) in ladder.series.values().enumerate().rev() {
        if steps.values().all(|cell| cell.always.is_none()) {
            continue;
        }
        let levels = ladder.levels.iter();
        let at = levels.map(
            |level| match steps.get(level).and_then(|cell| always(cell)) {
                Some(share) => Cell::Text(share),
                None => Cell::Blank,
            },
        );
        let names = [
            Cell::Blank,
            "  right every time".into(),
            Cell::Blank,
            Cell::Blank,
        ];
        let row = Row {
            cells: names.into_iter().chain(at).collect(),
            hidden_in: vec![Format::Page, Format::Latex],
        };
        table.rows.insert(place + 1, row);
    }
}

/// The lines below the table: models without images, chance, and why replies could not be read.
fn notes(summary: &Summary, ladder: &Ladder<'_, Score>) -> Vec<String> {
    let floors = ladder.floors.iter().map(|(_, cell)| *cell);
    let (chance, blind): (Vec<&Score>, Vec<&Score>) =
        floors.partition(|cell| cell.subject.view.is_none());
    let mut notes: Vec<String> = blind.into_iter().map(|cell| floor(summary, cell)).collect();
    let mut all = summary.of(None, Mode::Strict);
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

fn floor(summary: &Summary, cell: &Score) -> String {
    let accuracy = texts(Kind::Accuracy, &accuracy(summary, cell)).concat();
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

/// UnreadReason replies could not be read, if that is not the model's own way of answering.
fn unread(summary: &Summary) -> Option<String> {
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
