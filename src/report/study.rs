//! HTML page on which people answer the same questions as the models: [`page`].

use serde::Serialize;

use super::template::allow_script;
use crate::text::terminal::to_script_json;
use darkqa_base::error::Result;
use darkqa_base::types::Digest;

/// Template of the page.
const PAGE: &str = include_str!("study.html");

/// Text in the template that the questions replace.
const PLACEHOLDER: &str = "/*STUDY*/null";

/// Question on the page, without its true choice.
#[derive(Debug, Clone, Serialize)]
pub struct StudyQuestion {
    pub id: String,
    /// Number of the frame or walk.
    pub frame: usize,
    /// Text of the question.
    pub text: String,
    /// Choices in the order shown; empty for an open question.
    pub choices: Vec<String>,
    /// The frame or walk in each condition, in the same order for all questions.
    pub shots: Vec<StudyImage>,
}

/// Images of a frame or walk in one condition.
#[derive(Debug, Clone, Serialize)]
pub struct StudyImage {
    /// Name of the condition. The page writes it to the file of answers, but does not show it.
    pub condition: String,
    /// Paths of the images relative to the page: one for a frame, all for a walk.
    pub images: Vec<String>,
}

/// Data of the page's script.
#[derive(Serialize)]
struct StudyPage<'a> {
    /// Digest of question ids and image paths. The browser keeps answers under it until they are saved.
    set: Digest,
    items: &'a [StudyQuestion],
}

/// Renders the page as one HTML file.
///
/// Each person has a number and sees each frame or walk in one condition. The condition moves on by one from person to
/// person, so that n people together see every image once if there are n conditions. People choose answers with the
/// keyboard. Choices are saved as lines of JSON; open answers are saved as an array for `openeqa --answers`.
///
/// # Errors
/// If the questions cannot be serialized.
pub fn page(items: &[StudyQuestion]) -> Result<String> {
    let set = Digest::from_parts(items.iter().flat_map(|item| {
        let images = item.shots.iter().flat_map(|shot| &shot.images).map(String::as_bytes);
        std::iter::once(item.id.as_bytes()).chain(images)
    }));
    let page = PAGE.replacen(PLACEHOLDER, &to_script_json(&StudyPage { set, items })?, 1);
    Ok(allow_script(&page))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_does_not_contain_the_true_choice() {
        let question = StudyQuestion {
            id: "q".into(),
            frame: 0,
            text: "</script>?".into(),
            choices: vec!["a".into(), "b".into()],
            shots: vec![StudyImage { condition: "L5-noise".into(), images: vec!["images/0.png".into()] }],
        };
        let page = page(&[question]).unwrap();
        assert!(!page.contains(PLACEHOLDER) && !page.contains("truth"));
        assert_eq!(page.matches("</script").count(), 1);
        assert!(page.contains("script-src 'sha256-"), "{page}");
    }
}
