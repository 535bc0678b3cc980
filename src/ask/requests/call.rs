//! One question to a model, [`Call`]: the question as a [`Query`] and as a [`Message`].

use std::sync::Arc;

use crate::ask::failures::{AskError, Reach};
use serde::Serialize;

use crate::picture::Payload;
use crate::types::text::image_mark::{MarkedPiece, pieces};
use crate::types::{Condition, FailureKind, Question, QuestionId};

/// A question to a model, with choices or open.
#[derive(Debug, Clone, Copy)]
pub enum Query<'a> {
    /// A question with choices.
    Choice(&'a Question),
    /// An open question, by its name.
    Open(&'a QuestionId),
}

impl<'a> Query<'a> {
    /// The name of the question.
    #[must_use]
    pub fn id(self) -> &'a QuestionId {
        match self {
            Self::Choice(question) => &question.id,
            Self::Open(id) => id,
        }
    }

    /// The number of choices; 0 if the question is open.
    #[must_use]
    pub fn choices(self) -> usize {
        match self {
            Self::Choice(question) => question.choices.len(),
            Self::Open(_) => 0,
        }
    }

    /// The question with choices; an error if it is open, for models that can only choose.
    pub(in crate::ask) fn choice(self) -> Result<&'a Question, AskError> {
        match self {
            Self::Choice(question) => Ok(question),
            Self::Open(id) => {
                let message =
                    format!("question {id} has no choices, and this model can only choose");
                Err(AskError {
                    attempts: 0,
                    reach: Reach::Endpoint,
                    ..AskError::new(FailureKind::Request, message)
                })
            }
        }
    }
}

/// Where the images of a message stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ImagePlaces {
    /// All between the two texts.
    #[default]
    Together,
    /// Each at its first mark in a text, as `<image 2>` for the second; those without a mark between the two texts. A further mark of
    /// an image stays as words, so that each image is sent once.
    Marked,
}

/// A part of a message.
#[derive(Debug, Clone, Copy)]
pub(in crate::ask) enum MessagePart<'a> {
    /// Words, which are not empty.
    Words(&'a str),
    /// An image.
    Image(&'a Arc<Payload>),
}

/// The single message of a conversation: text, images, and the text after them.
#[derive(Debug, Clone, Copy)]
pub struct Message<'a> {
    /// The text before the images; the whole text if there are none.
    pub before: &'a str,
    /// The images; empty for a question without images.
    pub images: &'a [Arc<Payload>],
    /// The text after the images; may be empty.
    pub behind: &'a str,
    /// Where the images stand.
    pub places: ImagePlaces,
}

impl<'a> Message<'a> {
    /// A message of text, without images.
    #[must_use]
    pub fn words(before: &'a str) -> Self {
        Self {
            before,
            images: &[],
            behind: "",
            places: ImagePlaces::Together,
        }
    }

    /// The parts of the message in their order.
    pub(in crate::ask) fn parts(&self) -> Vec<MessagePart<'a>> {
        let mut is_shown = vec![false; self.images.len()];
        let mut of_text = |text: &'a str| {
            let pieces = pieces(text, |index| {
                let is_free = is_shown.get_mut(index).filter(|is_shown| !**is_shown);
                let is_place = self.places == ImagePlaces::Marked && is_free.is_some();
                if let Some(is_shown) = is_free.filter(|_| is_place) {
                    *is_shown = true;
                }
                is_place
            });
            pieces
                .into_iter()
                .map(|piece| match piece {
                    MarkedPiece::Words(words) => MessagePart::Words(words),
                    MarkedPiece::Image(index) => MessagePart::Image(&self.images[index]),
                })
                .collect::<Vec<_>>()
        };
        let [before, behind] = [of_text(self.before), of_text(self.behind)];
        let others = self
            .images
            .iter()
            .zip(is_shown)
            .filter(|(_, is_shown)| !is_shown)
            .map(|(image, _)| MessagePart::Image(image));
        before.into_iter().chain(others).chain(behind).collect()
    }
}

/// The images among the parts of a message, in their order.
pub(in crate::ask) fn images<'a>(
    parts: &[MessagePart<'a>],
) -> impl Iterator<Item = &'a Arc<Payload>> + Clone {
    parts.iter().filter_map(|part| match part {
        MessagePart::Words(_) => None,
        MessagePart::Image(image) => Some(*image),
    })
}

/// Everything a model needs to answer one question.
#[derive(Debug, Clone, Copy)]
pub struct Call<'a> {
    /// The question; models in this process read it, remote models read the message.
    pub query: Query<'a>,
    /// The condition of the images; `None` if there are no images.
    pub condition: Option<&'a Condition>,
    /// The text of the question, with its images.
    pub message: Message<'a>,
    /// The number of times the question was asked before, in any order of its choices.
    pub turn: u32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::PayloadFormat;
    use crate::types::Rgb;

    /// The parts of a message with images of 1, 2, … pixels width: words, and the widths of images.
    fn parts([before, behind]: [&str; 2], images: usize, places: ImagePlaces) -> Vec<String> {
        let images: Vec<Arc<Payload>> = (1..=images)
            .map(|width| {
                let image = Rgb::black(1, width);
                Arc::new(Payload::encode(&image, PayloadFormat::Png).unwrap())
            })
            .collect();
        let message = Message {
            before,
            images: &images,
            behind,
            places,
        };
        message
            .parts()
            .into_iter()
            .map(|part| match part {
                MessagePart::Words(words) => words.to_owned(),
                MessagePart::Image(image) => image.facts().width.to_string(),
            })
            .collect()
    }

    #[test]
    fn images_stand_together_or_at_their_marks() {
        use ImagePlaces::{Marked, Together};
        let text = "Is <image 2> like <image 1>?";
        for (texts, images, places, expected) in [
            ([text, ""], 2, Together, vec![text, "1", "2"]),
            (["", text], 2, Together, vec!["1", "2", text]),
            ([text, ""], 2, Marked, vec!["Is ", "2", " like ", "1", "?"]),
            (
                ["", text],
                3,
                Marked,
                vec!["3", "Is ", "2", " like ", "1", "?"],
            ),
            ([text, ""], 1, Marked, vec!["Is <image 2> like ", "1", "?"]),
            (
                ["<image 1><image 1>", ""],
                2,
                Marked,
                vec!["1", "<image 1>", "2"],
            ),
            (["Which?", ""], 2, Marked, vec!["Which?", "1", "2"]),
            ([text, ""], 0, Marked, vec![text]),
            (["", ""], 0, Together, vec![]),
        ] {
            assert_eq!(
                parts(texts, images, places),
                expected,
                "{texts:?} {images} {places:?}"
            );
        }
    }
}
