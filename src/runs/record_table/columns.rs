//! Columns of the table of records: those of both experiments ([`leading_columns`], [`reply_columns`],
//! [`image_columns`], [`trailing_columns`]), of questions with choices, and of open questions, which have a row for
//! each answer and its mark.

use std::path::Path;
use std::sync::Arc;

use serde::Serialize;
use serde_json::Value;

use super::reader::{RecordRow, SentImage, TableDetail};
use crate::mark_index::{JUDGE, MarkIndex, PROTOCOL};
use crate::predictions::{AnswerState, answer_state};
use crate::stored::text_setting;
use darkqa_base::error::Result;
use darkqa_base::types::flags::read_word;
use darkqa_base::types::manifests::{RecordedNames, RunManifest};
use darkqa_base::types::{
    ChoiceDetail, Condition, Failure, Finish, OpenDetail, ParsedAnswer, Record, RunQuestion, Step, Usage,
};
use darkqa_score::choice::llm_match::{Protocol, mark};
use darkqa_score::open::AnswerOutcome;
use darkqa_store::CellKind::{self, Bool, Digest, Double, Int8, Int16, Int32, Key, LongText, Text};
use darkqa_store::Presence::{self, Always, MayBeNull};
use darkqa_store::{Cell, Column, each_record};

pub(super) fn column<R>(
    name: &'static str,
    kind: CellKind,
    presence: Presence,
    value: for<'r> fn(&'r R) -> Cell<'r>,
) -> Column<R> {
    Column { name, kind, presence, value }
}

/// The text of a value as serialized in records; null if it is not serialized as a string.
fn serialized_word<'r>(value: &impl Serialize) -> Cell<'r> {
    match serde_json::to_value(value) {
        Ok(Value::String(word)) => Cell::Text(word.into()),
        _ => Cell::Null,
    }
}

fn double<'r>(number: Option<f64>) -> Cell<'r> {
    number.map_or(Cell::Null, Cell::Double)
}

/// Columns of question, model and condition.
fn leading_columns<D: TableDetail>() -> Vec<Column<RecordRow<D>>> {
    vec![
        column("key", Key, Always, |row: &RecordRow<D>| Cell::Bytes(row.record.key.as_bytes())),
        column("question", Text, Always, |row| Cell::text(Some(&row.record.question.0))),
        column("frame", Text, Always, |row| Cell::text(Some(row.record.detail.frame()))),
        column("scene", Text, MayBeNull, |row| {
            let question = row.question.as_ref();
            Cell::text(question.and_then(|question| question.scene.as_deref()))
        }),
        column("family", Text, Always, |row| Cell::text(Some(row.record.detail.family()))),
        column("model", Text, Always, |row| Cell::text(Some(&row.record.model))),
        column("view", Text, Always, |row| serialized_word(&row.record.view)),
        column("condition", Text, MayBeNull, |row| Cell::text(row.condition.condition.as_deref())),
        column("level", Text, MayBeNull, |row| Cell::text(row.condition.level.as_deref())),
        column("variant", Text, Always, |row| Cell::text(Some(&row.condition.variant))),
        column("enhancer", Text, MayBeNull, |row| Cell::text(row.condition.enhancer.as_deref())),
        column("ev", Double, MayBeNull, |row| double(row.condition.ev)),
    ]
}

/// Columns of the reply.
pub(super) fn reply_columns<D: TableDetail>() -> Vec<Column<RecordRow<D>>> {
    vec![
        column("reply", LongText, MayBeNull, |row: &RecordRow<D>| Cell::text(row.record.reply.as_deref())),
        column("refusal", LongText, MayBeNull, |row| Cell::text(row.record.refusal.as_deref())),
        column("failure_kind", Text, MayBeNull, |row| {
            let failure = row.record.failure.as_ref();
            failure.map_or(Cell::Null, |failure: &Failure| serialized_word(&failure.kind))
        }),
        column("failure_status", Int16, MayBeNull, |row| {
            let failure = row.record.failure.as_ref();
            Cell::int(failure.and_then(|failure: &Failure| failure.status))
        }),
        column("failure_message", LongText, MayBeNull, |row| {
            let failure = row.record.failure.as_ref();
            Cell::text(failure.map(|failure: &Failure| &*failure.message))
        }),
        column("finish", Text, MayBeNull, |row| match &row.record.finish {
            Some(Finish::Other(reason)) => Cell::text(Some(reason)),
            finish => serialized_word(finish),
        }),
        column("served_model", Text, MayBeNull, |row| Cell::text(row.record.served_model.as_deref())),
        column("via", Text, Always, |row| serialized_word(&row.record.via)),
        column("prompt_tokens", Int32, MayBeNull, |row| usage(row, |usage| usage.prompt_tokens)),
        column("completion_tokens", Int32, MayBeNull, |row| usage(row, |usage| usage.completion_tokens)),
        column("latency_ms", Int32, MayBeNull, |row| Cell::int(row.record.latency_ms)),
        column("attempts", Int32, MayBeNull, |row| Cell::int(Some(row.record.attempts))),
    ]
}

fn usage<'r, D: TableDetail>(row: &RecordRow<D>, tokens: impl Fn(&Usage) -> Option<u64>) -> Cell<'r> {
    Cell::int(row.record.usage.as_ref().and_then(tokens))
}

/// Columns of the first image sent.
pub(super) fn image_columns<D: TableDetail>() -> Vec<Column<RecordRow<D>>> {
    vec![
        column("image_digest", Digest, MayBeNull, |row: &RecordRow<D>| {
            let image = row.record.detail.image();
            image.map_or(Cell::Null, |image| Cell::Bytes(image.digest.as_bytes()))
        }),
        column("image_bytes", Int32, MayBeNull, |row| Cell::int(row.record.detail.image().map(|image| image.bytes))),
        column("image_width", Int32, MayBeNull, |row| Cell::int(row.record.detail.image().map(|image| image.width))),
        column("image_height", Int32, MayBeNull, |row| Cell::int(row.record.detail.image().map(|image| image.height))),
        column("image_format", Text, MayBeNull, |row| Cell::text(row.record.detail.image().map(|image| image.format))),
    ]
}

/// Further columns of condition, tokens and endpoint, which were added later.
fn trailing_columns<D: TableDetail>() -> Vec<Column<RecordRow<D>>> {
    vec![
        column("reading", Text, MayBeNull, |row: &RecordRow<D>| Cell::text(row.condition.profile.as_deref())),
        column("severity", Double, MayBeNull, |row| double(row.condition.severity)),
        column("cached_tokens", Int32, MayBeNull, |row| usage(row, |usage| usage.cached_tokens)),
        column("provider", Text, MayBeNull, |row| Cell::text(row.record.provider.as_deref())),
        column("endpoint", Int32, MayBeNull, |row| Cell::int(row.record.endpoint)),
    ]
}

impl TableDetail for ChoiceDetail {
    const TABLE: &'static str = "darkqa.records/1";

    type Context = ();

    type Extra = ();

    fn columns() -> Vec<Column<RecordRow<Self>>> {
        let own = vec![
            column("shown_frame", Text, MayBeNull, |row: &RecordRow<Self>| {
                let shown = row.record.detail.shown_frame.as_ref();
                Cell::text(shown.map(|frame| &*frame.0))
            }),
            column("wording", Text, MayBeNull, |row| Cell::text(row.record.detail.wording.as_deref())),
            column("order", Int32, MayBeNull, |row| Cell::int(Some(row.record.detail.order))),
            column("draw", Int32, MayBeNull, |row| {
                let draw = row.record.condition.as_ref().and_then(Condition::draw);
                Cell::int(Some(draw.unwrap_or(0)))
            }),
        ];
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

type ChoiceRow = RecordRow<ChoiceDetail>;

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

/// The marks of a run.
pub(super) struct Marks {
    judge: Option<String>,
    protocol: Protocol,
    /// The mark of each answer; `None` if the judge's reply cannot be parsed.
    by_answer: MarkIndex<Option<i64>>,
}

/// An answer with its mark.
pub(super) struct MarkedAnswer {
    /// The text to judge; `None` if the reply has no answer.
    answer: Option<Arc<str>>,
    outcome: AnswerOutcome,
    /// The judge, if it marked the answer.
    judge: Option<String>,
}

impl TableDetail for OpenDetail {
    const TABLE: &'static str = "darkqa.openeqa-records/1";

    type Context = Marks;

    type Extra = MarkedAnswer;

    fn columns() -> Vec<Column<RecordRow<Self>>> {
        let own = vec![
            column("image_count", Int32, MayBeNull, |row: &RecordRow<Self>| {
                let images = row.record.detail.images.as_ref();
                Cell::int(images.map(|images| images.images))
            }),
            column("person", Text, MayBeNull, |row| Cell::text(row.record.detail.person.as_deref())),
        ];
        let parts = [leading_columns(), mark_columns(), reply_columns(), image_columns(), trailing_columns(), own];
        parts.into_iter().flatten().collect()
    }

    fn context(folder: &Path, manifest: &RunManifest, questions: &[RunQuestion]) -> Result<Marks> {
        let judge = text_setting(manifest, JUDGE).map(str::to_owned);
        let protocol = text_setting(manifest, PROTOCOL).map_or(Ok(Protocol::Upstream), read_word)?;
        let names = RecordedNames::from_manifest(manifest);
        let mut marks = MarkIndex::new(questions);
        each_record(folder, |record: Record<Self>, _| {
            let is_of_judge = Some(names.table_name(&record.model)) == judge.as_deref();
            let detail = &record.detail;
            if let (Step::Mark, Some(answer)) = (detail.step, &detail.judged)
                && is_of_judge
                && !record.failed()
            {
                let reply = record.reply.as_deref().unwrap_or_default();
                marks.add(&record.question, answer, mark(reply, protocol));
            }
        })?;
        Ok(Marks { judge, protocol, by_answer: marks })
    }

    fn extra(context: &Marks, record: &Record<Self>) -> Option<MarkedAnswer> {
        (record.detail.step == Step::Answer).then(|| context.marked_answer(record))
    }

    fn frame(&self) -> &str {
        &self.episode
    }

    fn family(&self) -> &str {
        &self.category
    }

    fn image(&self) -> Option<SentImage<'_>> {
        self.images.as_ref().map(|images| SentImage {
            digest: &images.digest,
            bytes: images.bytes,
            width: images.width,
            height: images.height,
            format: &images.format,
        })
    }
}

impl Marks {
    /// The answer of a record, with its mark.
    fn marked_answer(&self, record: &Record<OpenDetail>) -> MarkedAnswer {
        let state = if record.failed() { AnswerState::Missing } else { answer_state(record, self.protocol) };
        let answer = match state {
            AnswerState::Missing => return unmarked(AnswerOutcome::Missing),
            AnswerState::Null => return unmarked(AnswerOutcome::Null),
            AnswerState::Text { answer, .. } => answer,
        };
        let mark = self.by_answer.get(&record.question, &answer);
        let outcome = match mark {
            None => AnswerOutcome::Unjudged,
            Some(None) => AnswerOutcome::Unmarked,
            Some(Some(mark)) => AnswerOutcome::Marked(*mark),
        };
        MarkedAnswer { answer: Some(answer), outcome, judge: self.judge.clone().filter(|_| mark.is_some()) }
    }
}

fn unmarked(outcome: AnswerOutcome) -> MarkedAnswer {
    MarkedAnswer { answer: None, outcome, judge: None }
}

/// Columns of the true answer, the model's answer and its mark.
fn mark_columns() -> Vec<Column<RecordRow<OpenDetail>>> {
    vec![
        column("answer", Text, MayBeNull, |row: &RecordRow<OpenDetail>| {
            let question = row.question.as_ref();
            Cell::text(question.and_then(|question| question.answer.as_deref()))
        }),
        column("predicted", LongText, MayBeNull, |row| Cell::text(row.extra.answer.as_deref())),
        column("outcome", Text, Always, |row| {
            Cell::text(Some(match row.extra.outcome {
                AnswerOutcome::Missing => "failed",
                AnswerOutcome::Null => "null",
                AnswerOutcome::Unjudged => "unjudged",
                AnswerOutcome::Unmarked => "unmarked",
                AnswerOutcome::Marked(_) => "marked",
            }))
        }),
        column("judge", Text, MayBeNull, |row| Cell::text(row.extra.judge.as_deref())),
        column("mark", Int32, MayBeNull, |row| match row.extra.outcome {
            AnswerOutcome::Marked(mark) => Cell::int(Some(mark)),
            _ => Cell::Null,
        }),
        column("score", Double, MayBeNull, |row| {
            let points = row.extra.outcome.points();
            points.map_or(Cell::Null, Cell::Double)
        }),
    ]
}
