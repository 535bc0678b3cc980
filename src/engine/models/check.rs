//! A test request to each model: [`check`].

use std::sync::Arc;

use super::describe::open_model;
use super::settings::AskSettings;
use crate::ask::{Call, ImagePlaces, Message, Query};
use crate::engine::images::progress::Progress;
use crate::engine::images::workers::thread_start_error;
use crate::error::Result;
use crate::pictures::{Payload, PayloadFormat};
use crate::types::{Condition, QuestionId, Rgb, View};

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
pub(crate) fn check(ask: &AskSettings, progress: &Progress) -> Result<Vec<(String, Result<String, String>)>> {
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
