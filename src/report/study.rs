//! The page on which people answer what the models were asked: [`page`].

use serde::Serialize;

use super::script::embedded;
use crate::error::Result;
use crate::types::Digest;

/// The page, with a place for the questions.
const PAGE: &str = include_str!("study.html");
/// The place.
const PLACE: &str = "/*STUDY*/null";

/// A question as the page asks it; the true choice is not in it.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct StudyQuestion {
    /// Its name.
    pub id: String,
    /// The number of its frame or walk.
    pub frame: usize,
    /// The question in words.
    pub text: String,
    /// The choices in the order shown; none where the answer is open.
    pub choices: Vec<String>,
    /// The frame or walk in each condition, in one order for all.
    pub shots: Vec<StudyImage>,
}

/// A frame or a walk in a condition.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct StudyImage {
    /// What was done to it; told to the file of answers, not to the person.
    pub condition: String,
    /// Where the images are, from the page: one of a frame, all of a walk.
    pub images: Vec<String>,
}

/// All that the page is told.
#[derive(Serialize)]
struct StudyPage<'a> {
    /// Under which the browser keeps answers until they are saved.
    set: Digest,
    items: &'a [StudyQuestion],
}

/// One file that asks a person by number: each frame or walk in one condition alone, which goes on by one from person to person, so
/// that as many people as there are conditions see every image once. Choices are taken from the keyboard and saved as lines
/// of JSON, open answers as an array that `openeqa --answers` takes.
///
/// # Errors
/// Where the questions cannot be written.
pub(crate) fn page(items: &[StudyQuestion]) -> Result<String> {
    let names = items.iter().flat_map(|item| {
        let images = item.shots.iter().flat_map(|shot| &shot.images);
        let shots = images.map(String::as_bytes);
        std::iter::once(item.id.as_bytes()).chain(shots)
    });
    let set = Digest::of_parts(names);
    Ok(PAGE.replacen(PLACE, &embedded(&StudyPage { set, items })?, 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_asks_and_does_not_tell() {
        let asked = StudyQuestion {
            id: "q".into(),
            frame: 0,
            text: "</script>?".into(),
            choices: vec!["a".into(), "b".into()],
            shots: vec![StudyImage {
                condition: "L5-noise".into(),
                images: vec!["images/0.png".into()],
            }],
        };
        let page = page(&[asked]).unwrap();
        assert!(!page.contains(PLACE) && !page.contains("truth"));
        assert_eq!(page.matches("</script").count(), 1);
    }
}
