//! Parses a request: [`ServedQuestion`].

use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use hyper::StatusCode;
use serde::Deserialize;
use tokio::sync::OwnedSemaphorePermit;

use super::completion::{ReplyForm, RequestFault};
use super::memory::MemoryBound;
use crate::pictures::{DecodeRule, ImageFile};
use crate::pictures::{Payload, PayloadFormat};
use crate::types::Rgb;

/// Maximum number of pixels of an image, and of all images in flight (chosen). Decoded and encoded again, a pixel takes
/// 10 to 20 bytes.
pub(super) const MAX_PIXELS: usize = 32_000_000;

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
    /// The image of the last message that has one.
    pub(super) image: Option<ServedImage>,
    pub(super) form: ReplyForm,
}

impl ServedQuestion {
    /// Parses the body of a request.
    ///
    /// # Errors
    /// 400 if the body is not a chat completion, a message has several images, or an image cannot be decoded.
    pub(super) async fn parse(bytes: Vec<u8>, pixels: &MemoryBound) -> Result<Self, RequestFault> {
        if value_count(&bytes) > MAX_VALUES {
            let message = format!("the request has more than {MAX_VALUES} values of JSON");
            return Err(RequestFault::new(StatusCode::PAYLOAD_TOO_LARGE, message));
        }
        let parsed = serde_json::from_slice::<ChatBody>(&bytes);
        drop(bytes);
        let body = parsed.map_err(|e| {
            RequestFault::new(StatusCode::BAD_REQUEST, format!("the request is not a valid chat completion: {e}"))
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
                    let images = parts.iter().filter(|part| matches!(part, Part::ImageUrl { .. })).count();
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
            let message = format!("a message shows {max_images} images, and these models look at one");
            return Err(RequestFault::new(StatusCode::BAD_REQUEST, message).at("image_url", "invalid_image_url"));
        }
        let image = match image {
            Some(url) => Some(ServedImage::decode(url, pixels).await?),
            None => None,
        };
        Ok(Self {
            model: body.model,
            text,
            image,
            form: if body.stream == Some(true) { ReplyForm::Stream } else { ReplyForm::Whole },
        })
    }
}

/// Maximum number of JSON values in a request (chosen): parsed, a small one takes about 130 bytes.
const MAX_VALUES: usize = 250_000;

/// Number of values in a JSON text, or a few more: the separators and brackets outside of strings.
fn value_count(json: &[u8]) -> usize {
    let (mut count, mut in_string, mut is_escaped) = (0, false, false);
    for byte in json {
        match byte {
            _ if is_escaped => is_escaped = false,
            b'\\' => is_escaped = in_string,
            b'"' => in_string = !in_string,
            b',' | b'{' | b'[' if !in_string => count += 1,
            _ => {}
        }
    }
    count
}

/// A decoded image.
pub(super) struct ServedImage {
    pub(super) rgb: Rgb,
    /// The image for the model.
    pub(super) payload: Arc<Payload>,
    /// Its share of the pixels that all images in flight may have.
    _share: OwnedSemaphorePermit,
}

impl ServedImage {
    /// Decodes the image of a data URL.
    async fn decode(url: String, pixels: &MemoryBound) -> Result<Self, RequestFault> {
        let file = file_in_data_url(&url)?;
        drop(url);
        let (width, height) = file.stored_size().map_err(|e| invalid_image(e.to_string()))?;
        let count = width as usize * height as usize;
        if count > MAX_PIXELS {
            let message = format!(
                "the image has {width} × {height} pixels; at most {} million are decoded",
                MAX_PIXELS / 1_000_000
            );
            return Err(RequestFault::new(StatusCode::PAYLOAD_TOO_LARGE, message).at("image_url", "invalid_image_url"));
        }
        let share = pixels.take(count).await?;
        let rgb = file.decode().map_err(|e| invalid_image(e.to_string()))?;
        drop(file);
        let payload = Payload::encode(&rgb, PayloadFormat::Png).map_err(|e| invalid_image(e.to_string()))?;
        Ok(Self { rgb, payload: Arc::new(payload), _share: share })
    }
}

/// The image file in a data URL.
fn file_in_data_url(url: &str) -> Result<ImageFile, RequestFault> {
    let (_, data) = url.strip_prefix("data:image/").and_then(|rest| rest.split_once(";base64,")).ok_or_else(|| {
        invalid_image("only data URLs are accepted: data:image/png;base64,… or data:image/jpeg;base64,…".to_owned())
    })?;
    let bytes = STANDARD.decode(data).map_err(|e| invalid_image(format!("the image is not base64: {e}")))?;
    Ok(ImageFile::new(bytes, "image_url".to_owned(), DecodeRule::default()))
}

fn invalid_image(message: String) -> RequestFault {
    RequestFault::new(StatusCode::BAD_REQUEST, message).at("image_url", "invalid_image_url")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_counted_outside_of_strings() {
        for (json, count) in [(r#"{"a": [1, 2], "b": {}}"#, 5), (r#"{"a": "[,\",{"}"#, 1), (r#""a""#, 0)] {
            assert_eq!(value_count(json.as_bytes()), count, "{json}");
        }
    }
}
