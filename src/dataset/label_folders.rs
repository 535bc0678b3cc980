//! Image folders named by class, as a classification question about each image: [`open`].

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use super::image_paths::ImagePaths;
use super::{Dataset, ImageSource};
use crate::error::{Error, Result};
use crate::files::reading::{self, entries};
use crate::types::{Choices, Digest, Family, FrameId, Question, QuestionId};

/// Opens a folder with a subfolder for each class, and asks `question` about each image. Frames and questions are named `CLASS/FILE`.
/// The choices are all class names in alphabetical order, or `choices` of them: the true one and others drawn by the content of the
/// image.
///
/// # Errors
/// If there are fewer than two classes or too many for the choices, or an image cannot be read.
pub(super) fn open(
    folder: &Path,
    question: &str,
    choices: Option<NonZeroUsize>,
) -> Result<Dataset> {
    let classes = classes(folder)?;
    let names: Vec<&str> = classes.keys().map(String::as_str).collect();
    let count = choice_count(folder, names.len(), choices)?;
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
                draw_choices(&names, class, count, &Digest::from_bytes(&bytes))
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

/// Images of each class folder, by its name. Warns about folders without images and about images in unsupported formats.
fn classes(folder: &Path) -> Result<BTreeMap<String, Vec<PathBuf>>> {
    let mut classes = BTreeMap::new();
    for inner in entries(folder)?.into_iter().filter(|path| path.is_dir()) {
        let name = inner
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        if name.starts_with('.') {
            continue;
        }
        let found = ImagePaths::from_paths(entries(&inner)?);
        found.warn_of_unsupported(&inner);
        if found.images.is_empty() {
            tracing::warn!("{}: no images in it, so it is not a class", inner.display());
            continue;
        }
        classes.insert(name, found.images);
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

/// Number of choices of each question.
///
/// # Errors
/// If `choices` is not from 2 to the number of classes, or is not given for too many classes.
fn choice_count(folder: &Path, classes: usize, choices: Option<NonZeroUsize>) -> Result<usize> {
    match choices.map(usize::from) {
        None if classes > Choices::MOST => Err(Error::usage(
            "--choices",
            format_args!(
                "{} has {classes} classes, and a question at most {} choices; --choices 4 asks with the own class and 3 others",
                folder.display(),
                Choices::MOST
            ),
        )),
        None => Ok(classes),
        Some(count) if !(2..=Choices::MOST).contains(&count) => Err(Error::usage(
            "--choices",
            format_args!("a question has 2 to {} choices", Choices::MOST),
        )),
        Some(count) if count > classes => Err(Error::usage(
            "--choices",
            format_args!(
                "{} has only {classes} classes; leave out --choices to offer them all",
                folder.display()
            ),
        )),
        Some(count) => Ok(count),
    }
}

/// The true class of an image and the others with the lowest digest of the image and their name, in the order of `names`.
fn draw_choices<'n>(names: &[&'n str], own: &str, count: usize, image: &Digest) -> Vec<&'n str> {
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

    fn draw(content: &[u8]) -> Vec<&'static str> {
        draw_choices(&NAMES, "Cup", 3, &Digest::from_bytes(content))
    }

    #[test]
    fn drawn_choices_depend_on_content_and_include_truth() {
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

    fn count(classes: usize, choices: usize) -> Result<usize, String> {
        choice_count(Path::new("d"), classes, NonZeroUsize::new(choices)).map_err(|e| e.to_string())
    }

    #[test]
    fn wrong_numbers_of_choices_are_errors() {
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
