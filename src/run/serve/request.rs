//! The question of a request: [`ServedQuestion`].

use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use hyper::StatusCode;
use serde::Deserialize;

use super::completion::{ReplyForm, RequestFault};
use crate::picture::{ImageFile, ReadingRule};
use crate::picture::{Payload, PayloadFormat};
use crate::types::Rgb;

/// The fields of a request that are used. Other fields are ignored.
#[derive(Deserialize)]
struct ChatBody {
    model: String,
    messages: Vec<Message>,
    #[serde(default)]
    stream: Option<bool>,
}

#[derive(Deserialize)]
struct Message {
    #[serde(default)]
    content: Option<Content>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Content {
    Text(String),
    Parts(Vec<Part>),
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Part {
    Text { text: String },
    ImageUrl { image_url: ImageLink },
}

#[derive(Deserialize)]
struct ImageLink {
    url: String,
}

/// The question of a request: a model, the text and the image.
pub(super) struct ServedQuestion {
    pub(super) model: String,
    /// The texts of all messages, joined.
    pub(super) text: String,
    /// The image of the last message that has one: its pixels, and the payload for the model.
    pub(super) image: Option<(Rgb, Arc<Payload>)>,
    pub(super) form: ReplyForm,
}

impl ServedQuestion {
    /// The question in the body of a request.
    pub(super) fn read(body: &[u8]) -> Result<Self, RequestFault> {
        let wrong = |message: String| RequestFault::new(StatusCode::BAD_REQUEST, message);
        let body: ChatBody = serde_json::from_slice(body)
            .map_err(|e| wrong(format!("the request is not a valid chat completion: {e}")))?;
        let (mut text, mut image, mut most) = (String::new(), None, 0);
        let mut append = |words: &str| {
            text.push_str(words);
            text.push('\n');
        };
        for message in body.messages {
            match message.content {
                None => {}
                Some(Content::Text(words)) => append(&words),
                Some(Content::Parts(parts)) => {
                    let is_image = |part: &&Part| matches!(part, Part::ImageUrl { .. });
                    most = most.max(parts.iter().filter(is_image).count());
                    for part in parts {
                        match part {
                            Part::Text { text } => append(&text),
                            Part::ImageUrl { image_url } => image = Some(image_url.url),
                        }
                    }
                }
            }
        }
        if most > 1 {
            let message = format!("a message shows {most} images, and these models look at one");
            return Err(wrong(message).at("image_url", "invalid_image_url"));
        }
        Ok(Self {
            model: body.model,
            text,
            image: image.map(|url| pixels(&url)).transpose()?,
            form: if body.stream == Some(true) {
                ReplyForm::Stream
            } else {
                ReplyForm::Whole
            },
        })
    }
}

/// The pixels of a data URL, and the payload for the model.
fn pixels(url: &str) -> Result<(Rgb, Arc<Payload>), RequestFault> {
    let wrong = |message: String| {
        RequestFault::new(StatusCode::BAD_REQUEST, message).at("image_url", "invalid_image_url")
    };
    let data = url
        .strip_prefix("data:image/")
        .and_then(|rest| rest.split_once(";base64,"));
    let (_, data) = data.ok_or_else(|| {
        wrong(
            "only data URLs are accepted: data:image/png;base64,… or data:image/jpeg;base64,…"
                .to_owned(),
        )
    })?;
    let bytes = STANDARD
        .decode(data)
        .map_err(|e| wrong(format!("the image is not base64: {e}")))?;
    let file = ImageFile::new(bytes, "image_url".to_owned(), ReadingRule::default());
    let rgb = file.decode().map_err(|e| wrong(e.to_string()))?;
    let payload = Payload::encode(&rgb, PayloadFormat::Png).map_err(|e| wrong(e.to_string()))?;
    Ok((rgb, Arc::new(payload)))
}
