//! HTML page on which a person checks each question: [`page`].

use serde::Serialize;

use crate::error::Result;
use crate::report::script_policy::allow_script;
use crate::report::text::script::to_script_json;
use crate::types::Digest;
use darkqa_questions::GeneratedQuestion;

/// Template of the page.
const PAGE: &str = include_str!("review.html");
/// Text in the template that the questions replace.
const PLACEHOLDER: &str = "/*QUESTIONS*/null";

/// Question on the page.
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
    /// Item for a question about the image at path `image`, whose `size` is width and height in pixels.
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

/// Data of the page's script.
#[derive(Serialize)]
struct ReviewPage<'a> {
    /// Digest of the question ids. The browser keeps a person's results under it and the person's name until they are
    /// saved.
    set: Digest,
    items: &'a [ReviewItem<'a>],
}

/// Renders the page as one HTML file.
///
/// The page shows each question with its image and asks for the person's own answer. Only then does it show the
/// generated answer with its evidence, so that the answer does not influence the person. It saves lines of JSON under
/// the person's name.
///
/// # Errors
/// If the questions cannot be serialized.
pub(crate) fn page(items: &[ReviewItem<'_>]) -> Result<String> {
    let set = Digest::from_parts(items.iter().map(|item| item.id.as_bytes()));
    let page = PAGE.replacen(PLACEHOLDER, &to_script_json(&ReviewPage { set, items })?, 1);
    Ok(allow_script(&page))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::types::{Choices, Family, FrameId, Question, QuestionId};

    #[test]
    fn question_texts_cannot_end_the_script() {
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
        let generated = GeneratedQuestion { question, about: String::new(), scene: String::new() };
        let page = page(&[ReviewItem::new(&generated, "a.png".into(), [4, 3])]).unwrap();
        assert!(!page.contains(PLACEHOLDER));
        assert_eq!(page.to_lowercase().matches("</script").count(), 1);
        assert!(!page.contains("<!--"));
    }
}
