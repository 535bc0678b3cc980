//! The page on which a person checks each question: [`page`].

use serde::Serialize;

use crate::error::Result;
use crate::text::script::to_script_json;
use crate::types::Digest;
use darkqa_questions::GeneratedQuestion;

/// The template of the page.
const PAGE: &str = include_str!("review.html");
/// The text in the template that the questions replace.
const PLACEHOLDER: &str = "/*QUESTIONS*/null";

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
    /// Path of the image relative to the page.
    image: String,
    /// Size of the image in pixels: width, height.
    size: [usize; 2],
}

impl<'a> ReviewItem<'a> {
    /// A question about the image at path `image`; `size` is its width and height in pixels.
    #[must_use]
    pub(crate) fn new(generated: &'a GeneratedQuestion, image: String, size: [usize; 2]) -> Self {
        let question = &generated.question;
        Self {
            id: &question.id.0,
            frame: &question.frame.0,
            family: question.family.name(),
            question: &question.text,
            choices: question.choices.texts(),
            answer: generated.answer(),
            evidence: &question.evidence,
            image,
            size,
        }
    }
}

/// The data of the page.
#[derive(Serialize)]
struct ReviewPage<'a> {
    /// Digest of the question ids. The browser stores what a person found under it and the person's name until it is saved.
    set: Digest,
    items: &'a [ReviewItem<'a>],
}

/// The page as one HTML file. It shows each question with its image, and takes the person's own answer. Only then does it show
/// the answer of the rule with its evidence, so that the shares found wrong are those of people who did not know it. It saves
/// lines of JSON under the person's name.
///
/// # Errors
/// If the questions cannot be written.
pub(crate) fn page(items: &[ReviewItem<'_>]) -> Result<String> {
    let set = Digest::from_parts(items.iter().map(|item| item.id.as_bytes()));
    Ok(PAGE.replacen(PLACEHOLDER, &to_script_json(&ReviewPage { set, items })?, 1))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::types::{Choices, Family, FrameId, Question, QuestionId};

    #[test]
    fn no_text_of_a_question_ends_the_script() {
        let choices = ["</script><b>", "no"].map(str::to_owned).to_vec();
        let question = Question {
            id: QuestionId("a".into()),
            frame: FrameId("<!--".into()),
            family: Family::Presence,
            text: "\u{2028}</SCRIPT>".into(),
            choices: Choices::new(choices, 0).unwrap(),
            group: None,
            evidence: json!({ "segments": [] }),
        };
        let generated = GeneratedQuestion {
            question,
            about: String::new(),
            scene: String::new(),
        };
        let page = page(&[ReviewItem::new(&generated, "a.png".into(), [4, 3])]).unwrap();
        assert!(!page.contains(PLACEHOLDER));
        assert_eq!(page.to_lowercase().matches("</script").count(), 1);
        assert!(!page.contains("<!--"));
    }
}
