//! Columns in the tables of both experiments: [`leading_columns`], [`reply_columns`], [`image_columns`] and
//! [`trailing_columns`].

use serde::Serialize;
use serde_json::Value;

use super::row::{Row, TableDetail};
use crate::store::CellKind::{Digest, Double, Int16, Int32, Key, LongText, Text};
use crate::store::Presence::{Always, MayBeNull};
use crate::store::{Cell, CellKind, Column, Presence};
use crate::types::{Failure, Finish, Usage};

pub(super) fn column<R>(
    name: &'static str,
    kind: CellKind,
    presence: Presence,
    value: for<'r> fn(&'r R) -> Cell<'r>,
) -> Column<R> {
    Column { name, kind, presence, value }
}

/// The text of a value as serialized in records; null if it is not serialized as a string.
pub(super) fn serialized_word<'r>(value: &impl Serialize) -> Cell<'r> {
    match serde_json::to_value(value) {
        Ok(Value::String(word)) => Cell::Text(word.into()),
        _ => Cell::Null,
    }
}

fn double<'r>(number: Option<f64>) -> Cell<'r> {
    number.map_or(Cell::Null, Cell::Double)
}

/// Columns of question, model and condition.
pub(super) fn leading_columns<D: TableDetail>() -> Vec<Column<Row<D>>> {
    vec![
        column("key", Key, Always, |row: &Row<D>| Cell::Bytes(row.record.key.as_bytes())),
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
pub(super) fn reply_columns<D: TableDetail>() -> Vec<Column<Row<D>>> {
    vec![
        column("reply", LongText, MayBeNull, |row: &Row<D>| Cell::text(row.record.reply.as_deref())),
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

fn usage<'r, D: TableDetail>(row: &Row<D>, tokens: impl Fn(&Usage) -> Option<u64>) -> Cell<'r> {
    Cell::int(row.record.usage.as_ref().and_then(tokens))
}

/// Columns of the first image sent.
pub(super) fn image_columns<D: TableDetail>() -> Vec<Column<Row<D>>> {
    vec![
        column("image_digest", Digest, MayBeNull, |row: &Row<D>| {
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
pub(super) fn trailing_columns<D: TableDetail>() -> Vec<Column<Row<D>>> {
    vec![
        column("reading", Text, MayBeNull, |row: &Row<D>| Cell::text(row.condition.profile.as_deref())),
        column("severity", Double, MayBeNull, |row| double(row.condition.severity)),
        column("cached_tokens", Int32, MayBeNull, |row| usage(row, |usage| usage.cached_tokens)),
        column("provider", Text, MayBeNull, |row| Cell::text(row.record.provider.as_deref())),
        column("endpoint", Int32, MayBeNull, |row| Cell::int(row.record.endpoint)),
    ]
}
