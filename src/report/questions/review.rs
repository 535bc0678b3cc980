//! The page on which a person accepts or rejects each question: [`page`].

use serde::Serialize;

use crate::error::Result;
use crate::questions::GeneratedQuestion;
use crate::report::script::embedded;
use crate::types::Digest;

/// The page, with a place for the questions.
const PAGE: &str = include_str!("review.html");
/// The place.
const PLACE: &str = "/*QUESTIONS*/null";

/// A question as the page shows it.
#[derive(Debug, Serialize)]
pub(crate) struct ReviewItem<'a> {
    id: &'a str,
    frame: &'a str,
    family: &'a str,
    question: &'a str,
    choices: &'a [String],
    answer: &'a str,
    evidence: &'a serde_json::Value,
    /// Where the image is, from the page.
    image: String,
    /// Width and height of the image.
    size: [usize; 2],
}

impl<'a> ReviewItem<'a> {
    /// A question about an image at this place, of this size.
    #[must_use]
    pub(crate) fn new(asked: &'a GeneratedQuestion, image: String, size: [usize; 2]) -> Self {
        let question = &asked.question;
        Self {
            id: &question.id.0,
            frame: &question.frame.0,
            family: question.family.name(),
            question: &question.text,
            choices: question.choices.texts(),
            answer: asked.answer(),
            evidence: &question.evidence,
            image,
            size,
        }
    }
}

/// All that the page is told.
#[derive(Serialize)]
struct ReviewPage<'a> {
    /// Under which the browser keeps the verdicts until they are saved.
    set: Digest,
    items: &'a [ReviewItem<'a>],
}

/// One file that shows question by question with its image, its answer and the boxes of its evidence, takes verdicts from the
/// keyboard, and saves them as lines of JSON.
///
/// # Errors
/// Where the questions cannot be written.
pub(crate) fn page(items: &[ReviewItem<'_>]) -> Result<String> {
    let set = Digest::of_parts(items.iter().map(|item| item.id.as_bytes()));
    Ok(PAGE.replacen(PLACE, &embedded(&ReviewPage { set, items })?, 1))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::types::{Choices, Family, FrameId, Question, QuestionId};

    #[test]
    fn no_word_of_a_question_leaves_its_place() {
        let choices = ["</script><b>", "no"].map(str::to_owned).to_vec();
        let question = Question {
            id: QuestionId("a".into()),
            frame: FrameId("<!--".into()),
            family: Family::Presence,
            text: "\u{2028}</SCRIPT>".into(),
            choices: Choices::new(choices, 0).unwrap(),
            evidence: json!({ "segments": [] }),
        };
        let asked = GeneratedQuestion {
            question,
            about: String::new(),
            scene: String::new(),
        };
        let page = page(&[ReviewItem::new(&asked, "a.png".into(), [4, 3])]).unwrap();
        assert!(!page.contains(PLACE));
        assert_eq!(page.to_lowercase().matches("</script").count(), 1);
        assert!(!page.contains("<!--"));
    }
}
