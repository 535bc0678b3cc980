//! Parses a request: [`ServedQuestion`].
//!
//! Parses a multiple-choice question in free text: [`AskedQuestion`].
//!
//! Matching of an image to the frame of a data set that it shows: [`FrameMatcher`].
//!
//! The linear light of the image is averaged over a coarse grid, which removes most of the sensor noise. The cell
//! values are then correlated with those of every frame. The correlation does not depend on the brightness of the
//! image, so a frame is recognised at every level at which some of it is visible.

use std::sync::{Arc, LazyLock};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use hyper::StatusCode;
use rayon::prelude::*;
use regex::Regex;
use serde::Deserialize;
use tokio::sync::OwnedSemaphorePermit;

use super::completion::{MemoryBound, ReplyForm, RequestFault};
use darkqa_base::error::Result;
use darkqa_base::types::questions::letter;
use darkqa_base::types::{FrameId, Rgb};
use darkqa_data::Dataset;
use darkqa_engine::images::progress::Progress;
use darkqa_pictures::{DecodeRule, ImageFile, Payload, PayloadFormat};

/// Maximum number of pixels of an image, and of all images in flight (chosen). Decoded and encoded again, a pixel takes
/// 10 to 20 bytes.
pub(super) const MAX_PIXELS: usize = 32_000_000;

/// The used fields of a request. Other fields are ignored.
#[derive(Deserialize)]
struct ChatBody {
    model: String,
    messages: Vec<AskedMessage>,
    #[serde(default)]
    stream: Option<bool>,
}

#[derive(Deserialize)]
struct AskedMessage {
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

/// A question with its choices, without their letters.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct AskedQuestion {
    pub(super) question: String,
    pub(super) choices: Vec<String>,
}

/// A line with a choice: `A. yes`, `(B) no`, `C: perhaps`.
static CHOICE: LazyLock<Option<Regex>> = LazyLock::new(|| Regex::new(r"^\s*[(\[]?([A-Z])[)\].:]+\s*(\S.*?)\s*$").ok());

impl AskedQuestion {
    /// Parses the last question of a text. The choices are lines with consecutive letters. The question is the last
    /// line before them that ends with a question mark, or else the line directly before them.
    ///
    /// # Errors
    /// 400 if the text has fewer than two choices.
    pub(super) fn parse(text: &str) -> Result<Self, RequestFault> {
        let lines: Vec<&str> = text.lines().collect();
        let parsed: Vec<Option<(char, &str)>> = lines.iter().map(|line| parse_choice(line)).collect();
        let first = parsed.iter().rposition(|line| matches!(line, Some(('A', _)))).ok_or_else(no_choices)?;
        let mut choices = Vec::new();
        for (own_letter, text) in parsed[first..].iter().flatten() {
            if *own_letter == letter(choices.len()) {
                choices.push((*text).to_owned());
            }
        }
        if choices.len() < 2 {
            return Err(no_choices());
        }
        let mut before = lines[..first].iter().rev().map(|line| line.trim()).filter(|line| !line.is_empty());
        let question = before.clone().find(|line| line.ends_with('?')).or_else(|| before.next()).unwrap_or_default();
        let question = question.strip_prefix("Question:").unwrap_or(question);
        Ok(Self { question: question.trim().to_owned(), choices })
    }
}

fn no_choices() -> RequestFault {
    let message = "no choices in the text; lines like \"A. yes\" and \"B. no\" are expected";
    RequestFault::new(StatusCode::BAD_REQUEST, message)
}

/// The letter and the text of a choice; `None` if the line is not a choice.
fn parse_choice(line: &str) -> Option<(char, &str)> {
    let found = CHOICE.as_ref()?.captures(line)?;
    let letter = found.get(1)?.as_str().chars().next()?;
    Some((letter, found.get(2)?.as_str()))
}

/// Number of grid cells, horizontally and vertically (chosen).
const GRID: [usize; 2] = [32, 24];

/// Minimum correlation at which an image is matched to a frame (chosen).
const MIN_CORRELATION: f64 = 0.5;

/// Linear light of each sRGB code, from 0 to 65,535 (IEC 61966-2-1).
static LINEAR: LazyLock<[u64; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let value = code as f64 / 255.0;
        let linear = if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) };
        (linear * 65_535.0 + 0.5) as u64
    })
});

/// Frames of a data set, each with its normalised cell values.
pub(super) struct FrameMatcher(Vec<(FrameId, Vec<f64>)>);

impl FrameMatcher {
    /// Computes the cell values of every frame of a data set.
    ///
    /// # Errors
    /// If an image cannot be read or decoded.
    pub(super) fn new(dataset: &Dataset, progress: &Progress) -> Result<Self> {
        let ids: Vec<&FrameId> = dataset.frames().collect();
        let bar = progress.bar("looking at frames", ids.len());
        ids.into_par_iter()
            .map(|id| {
                let image = dataset.picture(id)?.decode()?;
                bar.inc();
                Ok((id.clone(), cell_values(&image)))
            })
            .collect::<Result<_>>()
            .map(Self)
    }

    /// Number of frames.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// Frame with the highest correlation to an image; `None` if the highest correlation is below the minimum.
    pub(super) fn best_match(&self, image: &Rgb) -> Option<&FrameId> {
        let own = cell_values(image);
        let (highest, id) = self
            .0
            .iter()
            .map(|(id, other)| {
                let correlation: f64 = own.iter().zip(other).map(|(a, b)| a * b).sum();
                (correlation, id)
            })
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        (highest >= MIN_CORRELATION).then_some(id)
    }
}

/// Square root of the mean linear light of each cell, normalised to mean 0 and Euclidean norm 1.
fn cell_values(image: &Rgb) -> Vec<f64> {
    let (width, height) = (image.width(), image.height());
    let mut cells = vec![(0_u64, 0_u64); GRID[0] * GRID[1]];
    let (pixels, _) = image.samples().as_chunks::<3>();
    for (i, pixel) in pixels.iter().enumerate() {
        let (x, y) = (i % width * GRID[0] / width, i / width * GRID[1] / height);
        let (light, count) = &mut cells[y * GRID[0] + x];
        *light += pixel.iter().map(|code| LINEAR[usize::from(*code)]).sum::<u64>();
        *count += 1;
    }
    // The square root keeps a bright window from dominating the rest.
    let lights: Vec<f64> = cells.iter().map(|(light, count)| (*light as f64 / (*count).max(1) as f64).sqrt()).collect();
    let mean = lights.iter().sum::<f64>() / lights.len() as f64;
    let norm = lights.iter().map(|light| (light - mean) * (light - mean)).sum::<f64>().sqrt();
    let norm = if norm > 0.0 { norm } else { 1.0 };
    lights.into_iter().map(|light| (light - mean) / norm).collect()
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

    #[test]
    fn choices_are_read_however_they_are_lettered() {
        for text in [
            "Is it dark?\nA. yes\nB. no\nAnswer with the letter.",
            "You are a helpful assistant.\nQuestion: Is it dark?\n\nOptions:\n(A) yes\n(B) no\n",
            "Is it dark?\n A: yes \n B: no\nThe best answer is:",
            "Was it?\nA. no\nB. yes\nIs it dark?\nA) yes\nB) no",
        ] {
            let parsed = AskedQuestion::parse(text).ok().unwrap();
            assert_eq!(parsed.question, "Is it dark?", "{text}");
            assert_eq!(parsed.choices, ["yes", "no"], "{text}");
        }
    }

    #[test]
    fn a_text_without_choices_is_refused() {
        for text in ["", "Hello", "Is it?\nA. yes", "Is it?\nB. no"] {
            assert!(AskedQuestion::parse(text).is_err(), "{text}");
        }
    }
}
