//! Table of the records of open questions, with one row for each answer and its mark.

use std::path::Path;
use std::sync::Arc;

use super::common::{column, image_columns, leading_columns, reply_columns, trailing_columns};
use super::row::{Row, SentImage, TableDetail};
use crate::error::Result;
use crate::runs::mark_index::{JUDGE, MarkIndex, PROTOCOL};
use crate::runs::predictions::{AnswerState, answer_state};
use crate::runs::stored::text_setting;
use crate::store::CellKind::{Double, Int32, LongText, Text};
use crate::store::Presence::{Always, MayBeNull};
use crate::store::{Cell, Column, each_record};
use crate::types::flags::read_word;
use crate::types::manifests::{RecordedNames, RunManifest};
use crate::types::{OpenDetail, Record, RunQuestion, Step};
use darkqa_score::choice::llm_match::{Protocol, mark};
use darkqa_score::open::AnswerOutcome;

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

    fn columns() -> Vec<Column<Row<Self>>> {
        let own = vec![
            column("image_count", Int32, MayBeNull, |row: &Row<Self>| {
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
fn mark_columns() -> Vec<Column<Row<OpenDetail>>> {
    vec![
        column("answer", Text, MayBeNull, |row: &Row<OpenDetail>| {
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
