//! A readable description of the models: [`describe`].

use std::fmt::Write as _;

use serde_json::Value;

use super::settings::{AskSettings, ModelSettings};
use super::{endpoint, open};
use crate::ask::{Message, Model};
use crate::error::{Error, Result};
use crate::types::text::counted;

/// Lines about each model: its name, its endpoint, the source of its key, its request, and the digest that is part of
/// its trial keys.
///
/// # Errors
/// If a model cannot be opened.
pub(crate) fn describe(ask: &AskSettings) -> Result<String> {
    let mut text = String::new();
    let notes = ask.file.as_ref().and_then(|file| file.resolved.as_array());
    for model in &ask.models {
        let note = notes.into_iter().flatten().find(|note| note["name"] == *model.name);
        let _ = writeln!(text, "{} ({})", model.name, model.view);
        write_line(&mut text, "id", &model.id.label());
        let Some(opened) = open_model(model)? else {
            continue;
        };
        for address in field(note, "endpoints").and_then(Value::as_array).into_iter().flatten() {
            write_line(&mut text, "endpoint", address.as_str().unwrap_or_default());
        }
        if let Some(key) = field(note, "key").and_then(Value::as_str) {
            write_line(&mut text, "key", key);
        }
        let headers: Vec<&str> =
            field(note, "headers").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str).collect();
        if !headers.is_empty() {
            write_line(&mut text, "headers", &headers.join(", "));
        }
        if let Some(body) = opened.body(Message::text_only("QUESTION"), 0) {
            let body = body.map_err(|e| Error::data(&*model.name, e))?;
            write_line(&mut text, "request", &String::from_utf8_lossy(&body));
        }
        write_line(&mut text, "digest", &opened.digest()?.to_string()[..16]);
        if let Some(limit) = model.limit {
            write_line(&mut text, "limit", &format!("the first {}", counted(limit, "question")));
        }
    }
    Ok(text)
}

fn field<'a>(note: Option<&'a Value>, name: &str) -> Option<&'a Value> {
    note.and_then(|note| note.get(name))
}

fn write_line(text: &mut String, name: &str, value: &str) {
    let _ = writeln!(text, "  {name:9} {value}");
}

/// Opens a model; `None` for a built-in model that answers multiple-choice questions only.
pub(super) fn open_model(model: &ModelSettings) -> Result<Option<Model>> {
    if model.id.is_choice_only() {
        return Ok(None);
    }
    let endpoint = model.server.as_deref().map(endpoint).transpose()?;
    open(&model.id, endpoint.as_ref(), &model.parameters).map(Some)
}
