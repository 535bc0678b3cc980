//! Table of the records of questions with choices.

use std::path::Path;

use super::common::{column, image_columns, leading_columns, reply_columns, serialized_word, trailing_columns};
use super::row::{Row, SentImage, TableDetail};
use crate::error::Result;
use crate::store::CellKind::{Bool, Int8, Int32, Text};
use crate::store::Presence::{Always, MayBeNull};
use crate::store::{Cell, Column};
use crate::types::manifests::RunManifest;
use crate::types::{ChoiceDetail, ParsedAnswer, Record, RunQuestion};

impl TableDetail for ChoiceDetail {
    const TABLE: &'static str = "darkqa.records/1";

    type Context = ();

    type Extra = ();

    fn columns() -> Vec<Column<Row<Self>>> {
        let own = vec![column("shown_frame", Text, MayBeNull, |row: &Row<Self>| {
            let shown = row.record.detail.shown_frame.as_ref();
            Cell::text(shown.map(|frame| &*frame.0))
        })];
        let parts = [
            leading_columns(),
            question_columns(),
            reading_columns(),
            reply_columns(),
            image_columns(),
            trailing_columns(),
            own,
        ];
        parts.into_iter().flatten().collect()
    }

    fn context(_: &Path, _: &RunManifest, _: &[RunQuestion]) -> Result<()> {
        Ok(())
    }

    fn extra((): &(), _record: &Record) -> Option<()> {
        Some(())
    }

    fn frame(&self) -> &str {
        &self.frame.0
    }

    fn family(&self) -> &str {
        self.family.name()
    }

    fn image(&self) -> Option<SentImage<'_>> {
        self.image.as_ref().map(|image| SentImage {
            digest: &image.digest,
            bytes: image.bytes,
            width: image.width,
            height: image.height,
            format: &image.format,
        })
    }
}

type ChoiceRow = Row<ChoiceDetail>;

/// Columns of the choices and the true choice.
fn question_columns() -> Vec<Column<ChoiceRow>> {
    vec![
        column("truth", Int8, MayBeNull, |row: &ChoiceRow| Cell::int(row.record.detail.truth)),
        column("choice_count", Int8, Always, |row| Cell::int(Some(row.record.detail.choices.len()))),
        column("repeat", Int32, MayBeNull, |row| Cell::int(Some(row.record.detail.repeat))),
        column("answer", Text, MayBeNull, |row| choice_text(row, row.record.detail.truth)),
        column("choices", Text, Always, |row| {
            let choices = serde_json::to_string(&row.record.detail.choices);
            choices.map_or(Cell::Null, |choices| Cell::Text(choices.into()))
        }),
    ]
}

/// Columns of the strict and the lenient parsing of the reply.
fn reading_columns() -> Vec<Column<ChoiceRow>> {
    vec![
        column("strict", Int8, MayBeNull, |row: &ChoiceRow| Cell::int(chosen(row.record.detail.strict))),
        column("lenient", Int8, MayBeNull, |row| Cell::int(chosen(row.record.detail.lenient))),
        column("predicted", Text, MayBeNull, |row| choice_text(row, chosen(row.record.detail.strict))),
        column("predicted_lenient", Text, MayBeNull, |row| choice_text(row, chosen(row.record.detail.lenient))),
        column("right", Bool, MayBeNull, |row| right(row, row.record.detail.strict)),
        column("right_lenient", Bool, MayBeNull, |row| right(row, row.record.detail.lenient)),
        column("outcome", Text, Always, |row| serialized_word(&row.record.detail.outcome)),
        column("why", Text, MayBeNull, |row| why(row.record.detail.strict)),
        column("why_lenient", Text, MayBeNull, |row| why(row.record.detail.lenient)),
    ]
}

fn chosen(reading: Option<ParsedAnswer>) -> Option<usize> {
    reading.and_then(|reading| reading.chosen)
}

/// The text of a choice; null if there is none.
fn choice_text(row: &ChoiceRow, index: Option<usize>) -> Cell<'_> {
    let text = index.and_then(|index| row.record.detail.choices.get(index));
    Cell::text(text.map(String::as_str))
}

/// True if the parsed choice is the true one; null if the trial failed or the true choice is unknown.
fn right<'r>(row: &ChoiceRow, reading: Option<ParsedAnswer>) -> Cell<'r> {
    match (reading, row.record.detail.truth) {
        (Some(reading), Some(truth)) => Cell::Bool(reading.chosen == Some(truth)),
        _ => Cell::Null,
    }
}

fn why<'r>(reading: Option<ParsedAnswer>) -> Cell<'r> {
    let why = reading.and_then(|reading| reading.why);
    why.map_or(Cell::Null, |why| serialized_word(&why))
}
