//! What models come to, for people: [`describe`], and a request to each of them, [`check`].

use std::fmt::Write as _;

use serde_json::Value;

use super::name::ModelName;
use super::settings::{AskSettings, ModelSettings};
use super::{endpoint, open};
use crate::ask::{Call, Message, Model, Query};
use crate::error::{Error, Result};
use crate::job::progress::Progress;
use crate::job::workers::unstarted;
use crate::types::{QuestionId, View};

/// The words of the request that [`check`] sends.
const WORDS: &str = "Is snow cold?\nA. yes\nB. no\nAnswer with the letter of one choice.";

/// A few lines about each model: what it is called, where it is asked, where its key comes from, its request, and the digest that
/// enters the keys of its trials.
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
        let Some(opened) = opened(model)? else {
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
        let headers = field("headers")
            .and_then(Value::as_array)
            .into_iter()
            .flatten();
        let headers: Vec<&str> = headers.filter_map(Value::as_str).collect();
        if !headers.is_empty() {
            line("headers", &headers.join(", "));
        }
        if let Some(body) = opened.body(Message::words("QUESTION"), 0) {
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

/// The model at its endpoint; `None` if it is built in and has no replies of its own.
fn opened(model: &ModelSettings) -> Result<Option<Model>> {
    if matches!(model.id, ModelName::Random | ModelName::Observer(_)) {
        return Ok(None);
    }
    let endpoint = model.server.as_deref().map(endpoint).transpose()?;
    open(&model.id, endpoint.as_ref(), &model.parameters).map(Some)
}

/// Sends one request of a few words to each model that is asked at an endpoint; its reply, or why there is none.
///
/// # Errors
/// If a model cannot be opened.
pub(crate) fn check(
    ask: &AskSettings,
    progress: &Progress,
) -> Result<Vec<(String, Result<String, String>)>> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build();
    let runtime = runtime.map_err(|e| unstarted(&e))?;
    let mut outcomes = Vec::new();
    let mut seen: Vec<&str> = Vec::new();
    for model in &ask.models {
        if seen.contains(&&*model.name) || model.server.is_none() {
            continue;
        }
        seen.push(&model.name);
        let Some(opened) = opened(model)? else {
            continue;
        };
        progress.say(&format!("asking {}", model.name));
        let id = QuestionId("check".to_owned());
        let call = Call {
            query: Query::Open(&id),
            condition: None,
            message: Message::words(WORDS),
            turn: 0,
        };
        let reply = runtime.block_on(opened.ask(call));
        let outcome = reply.map_err(|error| error.to_string()).map(|reply| {
            let served = reply
                .served_model
                .map_or_else(String::new, |name| format!(" (served by {name})"));
            let blind = if model.view == View::Blind {
                ""
            } else {
                "; no image was sent"
            };
            format!(
                "{:?} in {:.1} s{served}{blind}",
                reply.text.trim(),
                reply.latency_ms as f64 / 1e3
            )
        });
        outcomes.push((model.name.clone(), outcome));
    }
    Ok(outcomes)
}
