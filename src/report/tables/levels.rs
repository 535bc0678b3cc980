//! Table of accuracy by level, with a row for each model, variant and enhancer.
//!
//! Table of accuracy by family, with a row for each model in a condition. An accuracy is marked if it is detected to be
//! below that of a model without images.

use super::sections::ACCURACY;
use crate::text::ladder::{Ladder, LadderRow};
use crate::text::latex::escape;
use crate::text::table::ColumnKind::{self, Count, Percent, Text};
use crate::text::table::{ColumnHeads, Table, TableBuilder, TableCell, TableFormat, TableRow};
use crate::text::terminal::{differing, texts};
use crate::text::words::{ends, family as family_name, marked_reference, percent};
use darkqa_base::types::degradations::Axis;
use darkqa_base::types::text::{counted, plural};
use darkqa_base::types::{Family, UnreadReason};
use darkqa_score::accuracies::{AccuracyCell, AccuracySummary};
use darkqa_score::choice::ParsingMode;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;

/// Name of the tables of accuracies or scores by level.
pub const LEVELS: &str = "levels";

/// Tables over all items and, if the models were asked different items, also over the items that they share.
pub(super) fn levels(findings: &Findings<'_>) -> Vec<Table> {
    let mut tables = summary_tables(findings, &findings.summary, "");
    if let Some(common) = &findings.common {
        let items =
            format!(" on the {} that all models with images answered", counted(common.shared_questions, "question"));
        for mut table in summary_tables(findings, &common.summary, &items) {
            table.latex = Some(format!("Accuracy in \\%{items}."));
            tables.push(table);
        }
    }
    tables
}

/// One table for each axis. `items` is a caption text about the items; empty for all items.
fn summary_tables(findings: &Findings<'_>, summary: &AccuracySummary, items: &str) -> Vec<Table> {
    let strict = summary.family_cells(None, ParsingMode::Strict);
    let ladder = Ladder::new(strict.map(|cell| (&cell.subject, cell))).with_pairs(findings);
    let notes = notes(summary, &ladder);
    let mut tables: Vec<Table> = ladder
        .by_axis()
        .into_iter()
        .map(|(axis, ladder)| axis_table(findings, summary, items, axis, &ladder))
        .collect();
    if let Some(last) = tables.last_mut() {
        last.notes = notes;
    }
    tables
}

fn axis_table(
    findings: &Findings<'_>,
    summary: &AccuracySummary,
    items: &str,
    axis: Axis,
    ladder: &Ladder<'_, AccuracyCell>,
) -> Table {
    let caption = match (items, axis == Axis::LIGHT) {
        ("", true) => "Accuracy in % by level, with 95 % intervals".to_owned(),
        (_, true) => format!("Accuracy in % by level{items}"),
        (_, false) => format!("Accuracy in % by {} of {}{items}", axis.title, axis.cause),
    };
    let mut table = ladder
        .table(LEVELS, &findings.grid.listing, |cell| {
            cell.map_or(TableCell::Blank, |cell| accuracy_cell(summary, cell))
        })
        .page(ACCURACY, &caption)
        .column(Count, "terminal n", |line| replies(line))
        .column(Count, "terminal unparsed", |line| {
            let strict = line.sum(|cell| cell.unparsed).to_string();
            let lenient = line.sum(|cell| lenient_cell(summary, cell).map_or(0, |cell| cell.unparsed)).to_string();
            format!("{strict}{}", differing(&strict, &lenient))
        })
        .column(Count, "terminal failed", |line| line.sum(|cell| cell.failed))
        .build();
    add_detail_rows(&mut table, ladder);
    let of = if axis == Axis::LIGHT { String::new() } else { format!(" by {} of {}", axis.title, axis.cause) };
    table.heading = Some(if items.is_empty() {
        format!(
            "Accuracy in %{of}: strict (lenient where it differs); n replies at each level; 95 %: how far the widest interval reaches down and up"
        )
    } else {
        format!("Accuracy in %{of}{items}")
    });
    table.latex = Some(format!(
        "Accuracy in \\%{of} (strict parsing) with 95\\,\\% intervals by {}; {}.",
        findings.unit,
        counted(findings.grid.items.len(), "item")
    ));
    table
}

/// Result of lenient parsing for the subject and family of a strict result.
fn lenient_cell<'a>(summary: &'a AccuracySummary, strict: &AccuracyCell) -> Option<&'a AccuracyCell> {
    summary.cell(&strict.subject, strict.family.as_ref(), ParsingMode::Lenient)
}

/// Table cell of an accuracy by strict parsing, with lenient parsing where it was computed.
fn accuracy_cell(summary: &AccuracySummary, cell: &AccuracyCell) -> TableCell {
    let Some(strict) = cell.accuracy else {
        return TableCell::Missing;
    };
    if cell.subject.view.is_none() {
        return TableCell::Guess(strict);
    }
    match lenient_cell(summary, cell).and_then(|cell| cell.accuracy) {
        Some(lenient) => TableCell::Strict(strict, lenient.value),
        None => TableCell::Estimate(strict),
    }
}

/// Smallest and largest number of replies at a level of a series, as text.
fn replies(line: &LadderRow<'_, AccuracyCell>) -> String {
    let replies = line.cells().map(AccuracyCell::replies);
    match (replies.clone().min(), replies.max()) {
        (Some(min), Some(max)) if min != max => format!("{min}–{max}"),
        (min, _) => min.unwrap_or(0).to_string(),
    }
}

/// Percentage of questions that were answered correctly every time; `None` if each was asked only once.
fn always_right(cell: &AccuracyCell) -> Option<String> {
    Some(percent(cell.always?.value))
}

/// Accuracy in percent if all missing replies were wrong, and if all were right; `None` if no reply is missing.
fn range_of_missing(cell: &AccuracyCell) -> Option<String> {
    let [wrong, right] = cell.bounds()?.map(percent);
    Some(format!("{wrong}–{right}"))
}

/// Name of a detail of accuracies, and its text for an accuracy.
type DetailRow = (&'static str, fn(&AccuracyCell) -> Option<String>);

/// Adds rows below each series, where they have a value: the share of questions that was right every time, the range of
/// accuracies that the missing replies allow, and the accuracy with all true answers weighted alike. Only the terminal
/// has these rows.
fn add_detail_rows(table: &mut Table, ladder: &Ladder<'_, AccuracyCell>) {
    let details: [DetailRow; 3] = [
        ("  balanced", |cell| cell.balanced.map(percent)),
        ("  missing wrong–right", range_of_missing),
        ("  right every time", always_right),
    ];
    for (index, row) in ladder.rows().iter().enumerate().rev() {
        let LadderRow::Series(_, cells) = row else {
            continue;
        };
        for (name, value) in details {
            if cells.values().all(|cell| value(cell).is_none()) {
                continue;
            }
            let values = ladder.levels.iter().map(|level| match cells.get(level).and_then(|cell| value(cell)) {
                Some(value) => TableCell::Text(value),
                None => TableCell::Blank,
            });
            let names = [TableCell::Blank, name.into(), TableCell::Blank, TableCell::Blank];
            let row = TableRow {
                cells: names.into_iter().chain(values).collect(),
                group: table.rows[index].group.clone(),
                hidden_in: vec![TableFormat::Page, TableFormat::Latex],
                ..TableRow::default()
            };
            table.rows.insert(index + 1, row);
        }
    }
}

/// Notes below the table: models without images, chance, and reasons for unreadable replies.
fn notes(summary: &AccuracySummary, ladder: &Ladder<'_, AccuracyCell>) -> Vec<String> {
    let (chance, blind): (Vec<&AccuracyCell>, Vec<&AccuracyCell>) =
        ladder.without_level.iter().map(|(_, cell)| *cell).partition(|cell| cell.subject.view.is_none());
    let mut notes: Vec<String> = blind.into_iter().map(|cell| note_without_images(summary, cell)).collect();
    let mut all = summary.family_cells(None, ParsingMode::Strict);
    let (unit, units) = if all.any(|cell| cell.always.is_some()) {
        ("order of choices", "orders of choices")
    } else {
        ("question", "questions")
    };
    let chance = chance.into_iter().filter_map(|cell| cell.accuracy);
    notes.extend(chance.map(|chance| {
        let share = 100.0 * chance.value;
        format!("chance: {share:.2} over {}", plural(chance.n, unit, units))
    }));
    notes.extend(summary.chance_of_questions.map(|once| {
        let share = 100.0 * once.value;
        format!("chance with each question once, as the paper counts: {share:.2} over {}", counted(once.n, "question"))
    }));
    notes.extend(unread_note(summary));
    notes
}

fn note_without_images(summary: &AccuracySummary, cell: &AccuracyCell) -> String {
    let text = texts(ColumnKind::Accuracy, &accuracy_cell(summary, cell)).concat();
    let interval = cell.accuracy.map(|share| format!(" [{}]", ends(share)));
    let accuracy = text + &interval.unwrap_or_default();
    let always = always_right(cell).map(|share| format!(", right every time {share}"));
    let unparsed = cell.unparsed.to_string();
    let lenient = lenient_cell(summary, cell).map(|cell| differing(&unparsed, &cell.unparsed.to_string()));
    format!(
        "{} without images: {accuracy}, n {}{}, unparsed {unparsed}{}, failed {}",
        cell.subject.model,
        cell.replies(),
        always.unwrap_or_default(),
        lenient.unwrap_or_default(),
        cell.failed
    )
}

/// Note with the number of unreadable replies by reason, for reasons that do not concern the form of the answer.
pub fn unread_note(summary: &AccuracySummary) -> Option<String> {
    let reasons = [
        (UnreadReason::Truncated, "cut at the token limit (--max-tokens)"),
        (UnreadReason::Refused, "refused"),
        (UnreadReason::Filtered, "withheld by a filter"),
        (UnreadReason::Empty, "empty"),
    ];
    let counts: Vec<String> = reasons
        .iter()
        .filter_map(|(reason, what)| {
            let count = summary.unread.get(reason).filter(|count| **count > 0)?;
            Some(format!("{count} {what}"))
        })
        .collect();
    let unparsed = (!counts.is_empty()).then(|| format!("of the unparsed replies {}", counts.join(", ")));
    let cannot_tell = summary.unread.get(&UnreadReason::CannotTell);
    let people = cannot_tell.map(|count| {
        let answers = if *count == 1 { "answer of people is" } else { "answers of people are" };
        format!("{count} {answers} “I cannot tell”, which counts as wrong and not as unparsed")
    });
    let parts: Vec<String> = unparsed.into_iter().chain(people).collect();
    (!parts.is_empty()).then(|| parts.join("; "))
}

pub(super) fn families(findings: &Findings<'_>) -> Table {
    let subjects = findings.grid.subjects.iter().map(Some);
    let has_models_under_test = subjects.clone().flatten().any(|subject| !subject.is_reference());
    // The last row is chance.
    let mut builder = TableBuilder::new("families", subjects.chain([None]))
        .page("families", "Accuracy in % by family")
        .column(Text, "page model", |subject| model(*subject))
        .column(Text, "latex Model", |subject| {
            let is_reference = subject.is_some_and(ModelInCondition::is_reference);
            marked_reference(model(*subject), is_reference && has_models_under_test)
        })
        .column(Text, "page condition | latex Condition", |subject| {
            subject.map_or(String::new(), ModelInCondition::condition)
        });
    for family in findings.grid.groups() {
        let name = family_name(family);
        let names =
            ColumnHeads { page: Some(name.to_owned()), latex: family.map(|_| escape(name)), ..ColumnHeads::default() };
        builder = builder.column(Percent, names, |subject| family_cell(findings, *subject, family));
    }
    let mut table = builder.build();
    table.latex = Some(
        "Accuracy in \\% by family, with 95\\,\\% intervals. $\\downarrow$: detected to be below a model without images (its own, if it was asked so)."
            .to_owned(),
    );
    table
}

/// Name of the model of a row.
fn model(subject: Option<&ModelInCondition>) -> String {
    subject.map_or("chance", |subject| &subject.model).to_owned()
}

/// Accuracy of a subject on a family. No subject stands for chance, no family for all families.
fn family_cell(findings: &Findings<'_>, subject: Option<&ModelInCondition>, family: Option<&Family>) -> TableCell {
    let cell = findings.summary.family_cells(family, ParsingMode::Strict).find(|cell| match subject {
        Some(subject) => cell.subject == *subject,
        None => cell.subject.view.is_none(),
    });
    let below = subject.is_some_and(|subject| !findings.below_blind(subject, family).is_empty());
    match cell.and_then(|cell| cell.accuracy) {
        None => TableCell::Missing,
        Some(chance) if subject.is_none() => TableCell::Number(chance.value),
        Some(share) if below => TableCell::Below(share),
        Some(share) => TableCell::Estimate(share),
    }
}
