//! A readable description of the models: [`describe`].

use std::fmt::Write as _;

use serde_json::Value;

use super::settings::{AskSettings, ModelSettings};
use super::{endpoint, open};
use crate::ask::{Message, Model};
use crate::error::{Error, Result};

/// Lines about each model: its name, its endpoint, the source of its key, its request, and the digest that is part of its trial keys.
///
/// # Errors
/// If a model cannot be opened.
pub(crate) fn describe(ask: &AskSettings) -> Result<String> {
    let mut text = String::new();
    let notes = ask.file.as_ref().and_then(|file| file.resolved.as_array());
    for model in &ask.models {
        let note = notes
            .into_iter()
            .flatten()
            .find(|note| note["name"] == *model.name);
        let field = |name: &str| note.and_then(|note| note.get(name));
        let _ = writeln!(text, "{} ({})", model.name, model.view);
        let mut line = |name: &str, value: &str| {
            let _ = writeln!(text, "  {name:9} {value}");
        };
        line("id", &model.id.label());
        let Some(opened) = open_model(model)? else {
            continue;
        };
        for address in field("endpoints")
            .and_then(Value::as_array)
            .into_iter()
            .flatten()
        {
            line("endpoint", address.as_str().unwrap_or_default());
        }
        if let Some(key) = field("key").and_then(Value::as_str) {
            line("key", key);
        }
        let headers: Vec<&str> = field("headers")
            .and_then(Value::as_array)
            .into_iter()
            .flatten()
            .filter_map(Value::as_str)
            .collect();
        if !headers.is_empty() {
            line("headers", &headers.join(", "));
        }
        if let Some(body) = opened.body(Message::text_only("QUESTION"), 0) {
            let body = body.map_err(|e| Error::data(&*model.name, e))?;
            line("request", &String::from_utf8_lossy(&body));
        }
        line("digest", &opened.digest()?.to_string()[..16]);
        if let Some(limit) = model.limit {
            line("limit", &format!("the first {limit} questions"));
        }
    }
    Ok(text)
}

/// Opens a model; `None` for a built-in model that answers multiple-choice questions only.
pub(super) fn open_model(model: &ModelSettings) -> Result<Option<Model>> {
    if model.id.is_choice_only() {
        return Ok(None);
    }
    let endpoint = model.server.as_deref().map(endpoint).transpose()?;
    open(&model.id, endpoint.as_ref(), &model.parameters).map(Some)
}
