//! Folders of images by class as a data set with one question: [`dataset`].

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use super::image_names::ImageNames;
use super::{Dataset, ImageSource};
use crate::error::{Error, Result};
use crate::files::reading::{self, entries};
use crate::types::{Choices, Digest, Family, FrameId, Question, QuestionId};

/// A question about each image of the folders in a folder. A frame is named `CLASS/FILE`, and so is its question. The choices are the
/// names of all folders in alphabetical order, or its own and others that are drawn by the content of the image, in the same order.
///
/// # Errors
/// If there are fewer than two classes, more than can be choices, or an image cannot be read.
pub(super) fn dataset(
    folder: &Path,
    question: &str,
    choices: Option<NonZeroUsize>,
) -> Result<Dataset> {
    let classes = classes(folder)?;
    let names: Vec<&str> = classes.keys().map(String::as_str).collect();
    let count = count(folder, names.len(), choices)?;
    tracing::warn!(
        "a photograph may show things of several of the {} classes, and the folder names one of them: that name is the true choice; with \
         boxes or tags, make questions instead",
        names.len()
    );
    let mut sources = BTreeMap::new();
    let mut questions = Vec::new();
    for (class, files) in &classes {
        for path in files {
            let file = path.file_name().unwrap_or_default().to_string_lossy();
            let id = format!("{class}/{file}");
            let offered = if count == names.len() {
                names.clone()
            } else {
                let bytes = reading::bytes(path)?;
                drawn(&names, class, count, &Digest::from_bytes(&bytes))
            };
            let truth = offered.iter().position(|name| name == class);
            let texts = offered.into_iter().map(str::to_owned).collect();
            questions.push(Question {
                id: QuestionId(id.clone()),
                frame: FrameId(id.clone()),
                family: Family::Other("label".to_owned()),
                text: question.to_owned(),
                choices: Choices::new(texts, truth.unwrap_or(usize::MAX))?,
                group: None,
                evidence: serde_json::Value::Null,
            });
            sources.insert(FrameId(id), ImageSource::image(path.clone()));
        }
    }
    Ok(Dataset::new(super::stem(folder), sources, questions))
}

/// The images of each folder that has some, by the folder's name. Says which folders have none, and which images are left out.
fn classes(folder: &Path) -> Result<BTreeMap<String, Vec<PathBuf>>> {
    let mut classes = BTreeMap::new();
    let is_hidden = |name: &str| name.starts_with('.');
    for inner in entries(folder)?.into_iter().filter(|path| path.is_dir()) {
        let name = inner
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        if is_hidden(&name) {
            continue;
        }
        let images = ImageNames::from_paths(entries(&inner)?);
        images.warn_of_unread(&inner);
        if images.images.is_empty() {
            tracing::warn!("{}: no images in it, so it is not a class", inner.display());
            continue;
        }
        classes.insert(name, images.images);
    }
    if classes.len() < 2 {
        let problem = format_args!(
            "{} folders with images in it; --label-folders needs one for each class, at least two",
            classes.len()
        );
        return Err(Error::data(folder.display(), problem));
    }
    Ok(classes)
}

/// The number of choices of each question.
fn count(folder: &Path, classes: usize, choices: Option<NonZeroUsize>) -> Result<usize> {
    let wrong = |problem: String| Err(Error::usage("--choices", problem));
    match choices.map(usize::from) {
        None if classes > Choices::MOST => wrong(format!(
            "{} has {classes} classes, and a question at most {} choices; --choices 4 asks with the own class and 3 others",
            folder.display(),
            Choices::MOST
        )),
        None => Ok(classes),
        Some(count) if !(2..=Choices::MOST).contains(&count) => {
            wrong(format!("a question has 2 to {} choices", Choices::MOST))
        }
        Some(count) if count > classes => wrong(format!(
            "{} has only {classes} classes; leave out --choices to offer them all",
            folder.display()
        )),
        Some(count) => Ok(count),
    }
}

/// The own class of an image and others with the lowest digests beside its content, in their order.
fn drawn<'n>(names: &[&'n str], own: &str, count: usize, image: &Digest) -> Vec<&'n str> {
    let mut others: Vec<&str> = names.iter().copied().filter(|name| *name != own).collect();
    others.sort_by_cached_key(|name| {
        *Digest::from_parts([&b"darkqa.label/1"[..], image.as_bytes(), name.as_bytes()]).as_bytes()
    });
    others.truncate(count - 1);
    names
        .iter()
        .copied()
        .filter(|name| *name == own || others.contains(name))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 5] = ["Bicycle", "Boat", "Cup", "Dog", "Table"];

    #[test]
    fn others_are_drawn_by_content_and_the_truth_is_always_there() {
        let draw = |content: &[u8]| drawn(&NAMES, "Cup", 3, &Digest::from_bytes(content));
        let mut seen = std::collections::BTreeSet::new();
        for content in 0..40_u8 {
            let names = draw(&[content]);
            assert_eq!(names.len(), 3);
            assert!(names.contains(&"Cup") && names.is_sorted());
            assert_eq!(names, draw(&[content]));
            seen.extend(names);
        }
        assert_eq!(seen.len(), NAMES.len(), "every class is drawn");
    }

    #[test]
    fn more_classes_than_choices_are_an_error_without_a_number() {
        let count = |classes, choices| {
            count(Path::new("d"), classes, NonZeroUsize::new(choices)).map_err(|e| e.to_string())
        };
        assert_eq!(count(12, 0), Ok(12));
        assert_eq!(count(30, 4), Ok(4));
        for (classes, choices, part) in [
            (
                30,
                0,
                "d has 30 classes, and a question at most 26 choices; --choices 4",
            ),
            (30, 27, "2 to 26 choices"),
            (5, 1, "2 to 26 choices"),
            (3, 4, "has only 3 classes"),
        ] {
            assert!(
                count(classes, choices).unwrap_err().contains(part),
                "{part}"
            );
        }
    }
}
