//! One question to a model, [`Call`]: as a [`Query`] for models in this process and as a [`Message`] for remote models.
//!
//! One request, which may be sent several times: [`Request`].
//!
//! Body of a request: [`RequestBody`], text around image data that many requests share.

use std::convert::Infallible;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use bytes::Bytes;
use hyper::body::{Body, Frame, SizeHint};
use reqwest::header::HeaderMap;
use serde::Serialize;

use super::field::SentFields;
use crate::costs::Reservation;
use crate::endpoints::ModelIndex;
use crate::failures::{AskError, Reach};
use crate::wire_kind::Wire;
use darkqa_base::types::text::image_mark::{MarkedPiece, pieces};
use darkqa_base::types::{Condition, FailureKind, Question, QuestionId};
use darkqa_pictures::Payload;

/// A question to a model: multiple-choice or open.
#[derive(Debug, Clone, Copy)]
pub enum Query<'a> {
    /// A multiple-choice question.
    Choice(&'a Question),
    /// An open question, by its id.
    Open(&'a QuestionId),
}

impl<'a> Query<'a> {
    /// Id of the question.
    #[must_use]
    pub fn id(self) -> &'a QuestionId {
        match self {
            Self::Choice(question) => &question.id,
            Self::Open(id) => id,
        }
    }

    /// Number of choices; 0 if the question is open.
    #[must_use]
    pub fn choice_count(self) -> usize {
        match self {
            Self::Choice(question) => question.choices.len(),
            Self::Open(_) => 0,
        }
    }

    /// The multiple-choice question, for models that can only choose.
    ///
    /// # Errors
    /// If the question is open.
    pub fn require_choices(self) -> Result<&'a Question, AskError> {
        match self {
            Self::Choice(question) => Ok(question),
            Self::Open(id) => {
                let message = format!("question {id} has no choices, and this model can only choose");
                Err(AskError { attempts: 0, reach: Reach::Endpoint, ..AskError::new(FailureKind::Request, message) })
            }
        }
    }
}

/// Positions of the images in a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ImagePlaces {
    /// All images between the two texts.
    #[default]
    Together,
    /// Each image at its first mark in a text, such as `<image 2>` for the second image; images without a mark between
    /// the two texts. Further marks of the same image remain text, so that each image is sent once.
    Marked,
}

/// Part of a message.
#[derive(Debug, Clone, Copy)]
pub enum MessagePart<'a> {
    /// Text; not empty.
    Text(&'a str),
    Image(&'a Arc<Payload>),
}

/// The only message of a conversation: text, images, and text after them.
#[derive(Debug, Clone, Copy)]
pub struct Message<'a> {
    /// Text before the images; the whole text if there are no images.
    pub before: &'a str,
    /// Images; empty for a question without images.
    pub images: &'a [Arc<Payload>],
    /// Text after the images; may be empty.
    pub after: &'a str,
    /// Positions of the images.
    pub places: ImagePlaces,
}

impl<'a> Message<'a> {
    /// A message of text, without images.
    #[must_use]
    pub fn text_only(text: &'a str) -> Self {
        Self { before: text, images: &[], after: "", places: ImagePlaces::Together }
    }

    /// Parts of the message, in order.
    pub fn parts(&self) -> Vec<MessagePart<'a>> {
        let mut is_placed = vec![false; self.images.len()];
        let before = self.text_parts(self.before, &mut is_placed);
        let after = self.text_parts(self.after, &mut is_placed);
        let unmarked = self
            .images
            .iter()
            .zip(is_placed)
            .filter(|(_, is_placed)| !is_placed)
            .map(|(image, _)| MessagePart::Image(image));
        before.into_iter().chain(unmarked).chain(after).collect()
    }

    /// Parts of one text of the message, with the marked images that are not yet placed.
    fn text_parts(&self, text: &'a str, is_placed: &mut [bool]) -> Vec<MessagePart<'a>> {
        pieces(text, |index| match is_placed.get_mut(index) {
            Some(is_placed) if self.places == ImagePlaces::Marked => !std::mem::replace(is_placed, true),
            _ => false,
        })
        .into_iter()
        .map(|piece| match piece {
            MarkedPiece::Words(text) => MessagePart::Text(text),
            MarkedPiece::Image(index) => MessagePart::Image(&self.images[index]),
        })
        .collect()
    }
}

/// Images among the parts of a message, in order.
pub(crate) fn images<'a>(parts: &[MessagePart<'a>]) -> impl Iterator<Item = &'a Arc<Payload>> + Clone {
    parts.iter().filter_map(|part| match part {
        MessagePart::Text(_) => None,
        MessagePart::Image(image) => Some(*image),
    })
}

/// Everything that a model needs to answer one question.
#[derive(Debug, Clone, Copy)]
pub struct Call<'a> {
    /// The question, for models in this process.
    pub query: Query<'a>,
    /// Condition of the images; `None` without images.
    pub condition: Option<&'a Condition>,
    /// The question as text, with its images, for remote models.
    pub message: Message<'a>,
    /// Number of times the question was asked before, in any order of its choices.
    pub turn: u32,
}

/// What follows if a gateway gives up on a request.
#[derive(Debug, Clone, Copy)]
pub struct AfterTimeout {
    /// Number of earlier requests of the question that were charged, certainly or probably, and gave no reply that
    /// counts.
    pub charged: u32,
    /// True if the caller asks the question in another way, so that the request is not repeated.
    pub asks_otherwise: bool,
    /// What the user can do, for the message.
    pub remedy: &'static str,
}

/// One request, which may be sent several times.
pub struct Request<'a> {
    /// Index of the model at the endpoint.
    pub model: ModelIndex,
    pub wire: Wire,
    /// Headers for each replica.
    pub headers: &'a [HeaderMap],
    pub body: RequestBody,
    pub sent: SentFields<'a>,
    /// Hash of the images: requests about the same images prefer the same replica.
    pub affinity: u64,
    /// Handling of gateway timeouts.
    pub timeouts: AfterTimeout,
    /// Reservation of the cost of each attempt; `None` if the model has no known price.
    pub reservation: Option<&'a Reservation>,
}

/// A body of known length that is sent in chunks; cloning it copies no bytes.
#[derive(Debug, Clone)]
pub struct RequestBody {
    chunks: Arc<[Bytes]>,
    /// Index of the next chunk to send.
    next: usize,
}

impl RequestBody {
    /// Creates a body from its chunks. Empty chunks are not sent.
    pub fn new(chunks: impl IntoIterator<Item = Bytes>) -> Self {
        let chunks = chunks.into_iter().collect();
        Self { chunks, next: 0 }
    }

    /// The whole body.
    pub fn concat(&self) -> Vec<u8> {
        self.chunks.concat()
    }

    /// Chunks that are not yet sent.
    fn rest(&self) -> &[Bytes] {
        self.chunks.get(self.next..).unwrap_or_default()
    }
}

impl Body for RequestBody {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        let skipped = self.rest().iter().take_while(|chunk| chunk.is_empty()).count();
        let chunk = self.rest().get(skipped).cloned();
        self.next += skipped + 1;
        Poll::Ready(chunk.map(|chunk| Ok(Frame::data(chunk))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest().iter().all(Bytes::is_empty)
    }

    /// The exact size, so that the request has a `Content-Length`: some servers reject chunked bodies.
    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.rest().iter().map(|chunk| chunk.len() as u64).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::Rgb;
    use darkqa_pictures::PayloadFormat;

    /// Parts of a message with images of 1, 2, … pixels width: texts, and the widths of images.
    fn parts([before, after]: [&str; 2], images: usize, places: ImagePlaces) -> Vec<String> {
        let images: Vec<Arc<Payload>> = (1..=images)
            .map(|width| {
                let image = Rgb::black(1, width);
                Arc::new(Payload::encode(&image, PayloadFormat::Png).unwrap())
            })
            .collect();
        let message = Message { before, images: &images, after, places };
        message
            .parts()
            .into_iter()
            .map(|part| match part {
                MessagePart::Text(text) => text.to_owned(),
                MessagePart::Image(image) => image.facts().width.to_string(),
            })
            .collect()
    }

    #[test]
    fn images_are_together_or_at_their_marks() {
        use ImagePlaces::{Marked, Together};
        let text = "Is <image 2> like <image 1>?";
        for (texts, images, places, expected) in [
            ([text, ""], 2, Together, vec![text, "1", "2"]),
            (["", text], 2, Together, vec!["1", "2", text]),
            ([text, ""], 2, Marked, vec!["Is ", "2", " like ", "1", "?"]),
            (["", text], 3, Marked, vec!["3", "Is ", "2", " like ", "1", "?"]),
            ([text, ""], 1, Marked, vec!["Is <image 2> like ", "1", "?"]),
            (["<image 1><image 1>", ""], 2, Marked, vec!["1", "<image 1>", "2"]),
            (["Which?", ""], 2, Marked, vec!["Which?", "1", "2"]),
            ([text, ""], 0, Marked, vec![text]),
            (["", ""], 0, Together, vec![]),
        ] {
            assert_eq!(parts(texts, images, places), expected, "{texts:?} {images} {places:?}");
        }
    }

    #[test]
    fn chunks_are_sent_in_order() {
        let chunk = Bytes::from_static;
        let mut body = RequestBody::new([chunk(b"ab"), chunk(b""), chunk(b"cde")]);
        let mut context = Context::from_waker(std::task::Waker::noop());
        let mut seen = Vec::new();
        let mut remaining = vec![body.size_hint().exact()];
        while let Poll::Ready(Some(Ok(frame))) = Pin::new(&mut body).poll_frame(&mut context) {
            seen.extend_from_slice(frame.data_ref().unwrap());
            remaining.push(body.size_hint().exact());
        }
        assert_eq!(seen, b"abcde");
        assert_eq!(remaining, [Some(5), Some(3), Some(0)]);
        assert!(body.is_end_stream());
        assert!(RequestBody::new([chunk(b""), chunk(b""), chunk(b"")]).is_end_stream());
    }
}
