//! Parses a request: [`ServedQuestion`].

use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use hyper::StatusCode;
use serde::Deserialize;

use super::completion::{ReplyForm, RequestFault};
use crate::picture::{DecodeRule, ImageFile};
use crate::picture::{Payload, PayloadFormat};
use crate::types::Rgb;

/// The used fields of a request. Other fields are ignored.
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

/// Model, text and image of a request.
pub(super) struct ServedQuestion {
    pub(super) model: String,
    /// The texts of all messages, joined.
    pub(super) text: String,
    /// The image of the last message that has one: its pixels, and the payload for the model.
    pub(super) image: Option<(Rgb, Arc<Payload>)>,
    pub(super) form: ReplyForm,
}

impl ServedQuestion {
    /// Parses the body of a request.
    ///
    /// # Errors
    /// 400 if the body is not a chat completion, a message has several images, or an image cannot be decoded.
    pub(super) fn parse(body: &[u8]) -> Result<Self, RequestFault> {
        let body: ChatBody = serde_json::from_slice(body).map_err(|e| {
            RequestFault::new(
                StatusCode::BAD_REQUEST,
                format!("the request is not a valid chat completion: {e}"),
            )
        })?;
        let (mut text, mut image, mut max_images) = (String::new(), None, 0);
        let mut append = |words: &str| {
            text.push_str(words);
            text.push('\n');
        };
        for message in body.messages {
            match message.content {
                None => {}
                Some(Content::Text(words)) => append(&words),
                Some(Content::Parts(parts)) => {
                    let images = parts
                        .iter()
                        .filter(|part| matches!(part, Part::ImageUrl { .. }))
                        .count();
                    max_images = max_images.max(images);
                    for part in parts {
                        match part {
                            Part::Text { text } => append(&text),
                            Part::ImageUrl { image_url } => image = Some(image_url.url),
                        }
                    }
                }
            }
        }
        if max_images > 1 {
            let message =
                format!("a message shows {max_images} images, and these models look at one");
            return Err(RequestFault::new(StatusCode::BAD_REQUEST, message)
                .at("image_url", "invalid_image_url"));
        }
        Ok(Self {
            model: body.model,
            text,
            image: image.map(|url| decode_data_url(&url)).transpose()?,
            form: if body.stream == Some(true) {
                ReplyForm::Stream
            } else {
                ReplyForm::Whole
            },
        })
    }
}

/// Decodes the image of a data URL; also returns the payload for the model.
fn decode_data_url(url: &str) -> Result<(Rgb, Arc<Payload>), RequestFault> {
    let (_, data) = url
        .strip_prefix("data:image/")
        .and_then(|rest| rest.split_once(";base64,"))
        .ok_or_else(|| {
            invalid_image(
                "only data URLs are accepted: data:image/png;base64,… or data:image/jpeg;base64,…"
                    .to_owned(),
            )
        })?;
    let bytes = STANDARD
        .decode(data)
        .map_err(|e| invalid_image(format!("the image is not base64: {e}")))?;
    let file = ImageFile::new(bytes, "image_url".to_owned(), DecodeRule::default());
    let rgb = file.decode().map_err(|e| invalid_image(e.to_string()))?;
    let payload =
        Payload::encode(&rgb, PayloadFormat::Png).map_err(|e| invalid_image(e.to_string()))?;
    Ok((rgb, Arc::new(payload)))
}

fn invalid_image(message: String) -> RequestFault {
    RequestFault::new(StatusCode::BAD_REQUEST, message).at("image_url", "invalid_image_url")
}
