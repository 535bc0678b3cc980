//! A test request to each model: [`check`].
//!
//! A readable description of the models: [`describe`].

use std::fmt::Write as _;
use std::sync::Arc;

use serde_json::Value;

use super::settings::{AskSettings, ModelSettings};
use super::{endpoint, open};
use crate::images::progress::Progress;
use crate::images::workers::thread_start_error;
use darkqa_ask::{Call, ImagePlaces, Message, Model, Query};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::counted;
use darkqa_base::types::{Condition, QuestionId, Rgb, View};
use darkqa_pictures::{Payload, PayloadFormat};

/// A question for a model without images.
const TEXT_QUESTION: &str = "Is snow cold?\nA. yes\nB. no\nAnswer with the letter of one choice.";

/// A question for a model with images, about a [`RED`] image.
const IMAGE_QUESTION: &str = "Which colour has the image?\nA. blue\nB. red\nAnswer with the letter of one choice.";

/// Colour of the image.
const RED: [u8; 3] = [220, 30, 30];

/// Width and height of the image in pixels; chosen: some servers refuse images below 28 pixels.
const SIDE: usize = 64;

/// Sends one small request to each model at an endpoint, with an image if the model is asked with images. Returns the
/// name of each model with a description of its reply, or with the error.
///
/// # Errors
/// If a model cannot be opened.
pub fn check(ask: &AskSettings, progress: &Progress) -> Result<Vec<(String, Result<String, String>)>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|e| thread_start_error(&e))?;
    let image = Rgb::new(SIDE, SIDE, RED.repeat(SIDE * SIDE))?;
    let images = [Arc::new(Payload::encode(&image, PayloadFormat::Png)?)];
    let (mut outcomes, mut seen) = (Vec::new(), Vec::new());
    for model in &ask.models {
        if seen.contains(&(&*model.name, model.view)) || model.server.is_none() {
            continue;
        }
        seen.push((&model.name, model.view));
        let Some(opened) = open_model(model)? else {
            continue;
        };
        progress.print_on_terminal(&format!("asking {} ({})", model.name, model.view));
        let (condition, message, sent) = match model.view {
            View::Blind => (None, Message::text_only(TEXT_QUESTION), "without an image"),
            View::Image => {
                let message =
                    Message { before: IMAGE_QUESTION, images: &images, after: "", places: ImagePlaces::Together };
                let sent = "about a red image, of which B is true";
                (Some(&Condition::L0), message, sent)
            }
        };
        let id = QuestionId("check".to_owned());
        let call = Call { query: Query::Open(&id), condition, message, turn: 0 };
        let reply = runtime.block_on(opened.ask(call));
        let outcome = reply.map_err(|error| error.to_string()).map(|reply| {
            let served = reply.served_model.map_or_else(String::new, |name| format!(" (served by {name})"));
            let text = reply.text.trim();
            let is_true =
                text.split(|c: char| !c.is_alphanumeric()).any(|word| word == "B" || word.eq_ignore_ascii_case("red"));
            let doubt = if model.view == View::Image && !is_true {
                "; that is not the true answer: perhaps it does not see images"
            } else {
                ""
            };
            format!("{text:?} {sent}, in {:.1} s{served}{doubt}", reply.latency_ms as f64 / 1e3)
        });
        outcomes.push((model.name.clone(), outcome));
    }
    Ok(outcomes)
}

/// Lines about each model: its name, its endpoint, the source of its key, its request, and the digest that is part of
/// its trial keys.
///
/// # Errors
/// If a model cannot be opened.
pub fn describe(ask: &AskSettings) -> Result<String> {
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
fn open_model(model: &ModelSettings) -> Result<Option<Model>> {
    if model.id.is_choice_only() {
        return Ok(None);
    }
    let endpoint = model.server.as_deref().map(endpoint).transpose()?;
    open(&model.id, endpoint.as_ref(), &model.parameters).map(Some)
}
