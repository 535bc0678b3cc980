//! Flags for sets of photographs: their light, pairs, and class folders ([`SceneArgs`]).
//!
//! Classification data sets with one folder of images per class: [`open`].

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::Args;

use super::dataset::{Dataset, stem};
use super::frames::{self, ImagePaths};
use super::openeqa::ImageSource;
use super::pairs::{self, Pairs};
use super::ready_made::{self, SetArgs};
use super::root::Root;
use super::source::{DataSource, refuse_questions};
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::{Choices, Decides, Digest, Evidence, Family, FrameId, Question, QuestionId, SetLight};

/// Flags for sets of photographs.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Data")]
pub struct SceneArgs {
    /// Light in which the photographs were taken; dark photographs are evaluated at L0 only, raw and enhanced, unless
    /// --levels or --llie-on are given; default: from dataset.json, else lit
    #[arg(long, value_enum, value_name = "LIGHT", add = Decides::Trials)]
    pub light: Option<SetLight>,
    /// Photographs of the same scenes in normal and in low light: two folders, or one with folders normal and low; the
    /// low ones are asked as the condition dark; needs --questions, about the names of the files in normal light;
    /// default: none
    #[arg(long, value_name = "NORMAL,LOW|DIR", conflicts_with = "label_folders", add = Decides::Reply)]
    pub pairs: Option<PairFolders>,
    /// Question about each image in a folder with one subfolder per class; choices are the subfolder names, the answer
    /// is the image's subfolder; default: none
    #[arg(long, value_name = "QUESTION", add = Decides::Reply)]
    pub label_folders: Option<String>,
    /// Number of choices of a --label-folders question: its own class and others drawn at random by content, at most
    /// 26; default: all classes
    #[arg(long, value_name = "N", requires = "label_folders", add = Decides::Reply)]
    pub choices: Option<NonZeroUsize>,
}

/// Value of `--pairs`: two folders, or one that has both.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PairFolders {
    /// Folders of the photographs in normal and in low light.
    Two(PathBuf, PathBuf),
    /// A folder with photographs in normal and in low light.
    One(PathBuf),
}

impl std::str::FromStr for PairFolders {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split(',').map(str::trim).collect::<Vec<_>>()[..] {
            [one] if !one.is_empty() => Ok(Self::One(one.into())),
            [normal, low] if !normal.is_empty() && !low.is_empty() => Ok(Self::Two(normal.into(), low.into())),
            _ => Err("two folders with a comma between them expected, or one folder with both".to_owned()),
        }
    }
}

impl PairFolders {
    /// Folder that names the data set: the photographs in normal light, or the folder with both.
    fn folder(&self) -> &Path {
        match self {
            Self::Two(folder, _) | Self::One(folder) => folder,
        }
    }

    /// Pairs the photographs by their file names.
    ///
    /// # Errors
    /// If no pair is found.
    fn open(&self, further: &[PathBuf]) -> Result<Pairs> {
        match self {
            Self::Two(normal, low) => Pairs::from_folders(normal, low, further),
            Self::One(folder) => {
                let other = "--pairs NORMAL,LOW names any two folders";
                Pairs::open(folder, further, other)
            }
        }
    }
}

impl SceneArgs {
    /// Place of the data: the folder of the pairs if `--pairs` is given, else `data`.
    pub fn place(&self, data: DataSource) -> DataSource {
        match &self.pairs {
            Some(pairs) => DataSource::Path(pairs.folder().to_owned()),
            None => data,
        }
    }

    /// Light in which the photographs at a place were taken: from `--light`, else from `dataset.json`, else lit.
    ///
    /// # Errors
    /// If `dataset.json` cannot be read.
    pub fn set_light(&self, place: &DataSource, further: &[PathBuf]) -> Result<SetLight> {
        match (self.light, place) {
            (Some(light), _) => Ok(light),
            (None, DataSource::Path(path)) if path.is_dir() => frames::light(path, further),
            (None, DataSource::Path(path)) if ready_made::is_zip_file(path) => ready_made::light_of_archive(path),
            (None, _) => Ok(SetLight::Lit),
        }
    }

    /// Opens the data at a place, with the questions of a file if one is given.
    ///
    /// # Errors
    /// If the data cannot be read; the error names the file.
    pub fn open(&self, place: &DataSource, questions: Option<&Path>, set: &SetArgs) -> Result<Dataset> {
        match self.pairs_or_classes(place, &set.root.data_root)? {
            None => place.open(questions, set),
            Some(dataset) if self.pairs.is_some() => {
                let Some(file) = questions else {
                    let problem = "pairs of photographs have no questions; --questions FILE names some about the files in normal light";
                    return Err(Error::usage("--pairs", problem));
                };
                let questions = ready_made::questions_about_frames(file, set)?;
                dataset.with_file_questions(file, questions, set.bad)
            }
            Some(dataset) => {
                let why = "the folders make the questions of --label-folders";
                refuse_questions(questions, why)?;
                Ok(dataset)
            }
        }
    }

    /// Opens the data of `--pairs` (without questions) or `--label-folders`; `None` if neither flag is given.
    ///
    /// # Errors
    /// If the data cannot be read; the error names the file.
    pub fn pairs_or_classes(&self, place: &DataSource, further: &[PathBuf]) -> Result<Option<Dataset>> {
        if let Some(pairs) = &self.pairs {
            return pairs::open(pairs.folder(), pairs.open(further)?).map(Some);
        }
        let Some(question) = &self.label_folders else {
            return Ok(None);
        };
        let DataSource::Path(folder) = place else {
            let problem = "--data must name the folder with a folder for each class";
            return Err(Error::usage("--label-folders", problem));
        };
        let root = Root::new(folder, further)?;
        open(&root, question, self.choices).map(Some)
    }
}

/// Opens a folder with one subfolder per class, and asks `question` about each image. Frames and questions are named
/// `CLASS/FILE`.
///
/// Without `choices`, a question offers all class names in alphabetical order. With `choices`, it offers that number of
/// names: the true class and others drawn by a digest of the image file.
///
/// # Errors
/// If the folder has fewer than two classes, the number of choices is invalid ([`choice_count`]), or a file cannot be
/// read.
pub(super) fn open(root: &Root, question: &str, choices: Option<NonZeroUsize>) -> Result<Dataset> {
    let folder = root.folder();
    let classes = classes(root)?;
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
                let bytes = files::bytes(path)?;
                draw_choices(&names, class, count, &Digest::from_bytes(&bytes))
            };
            let truth = offered.iter().position(|name| name == class);
            let texts = offered.into_iter().map(str::to_owned).collect();
            questions.push(Question {
                id: QuestionId(id.clone()),
                frame: FrameId(id.clone()),
                family: Family::Other("label".to_owned()),
                text: question.to_owned(),
                choices: Choices::new(texts, truth.unwrap_or(usize::MAX))
                    .map_err(|e| e.at(folder.display().to_string()))?,
                group: None,
                evidence: Evidence::default(),
            });
            sources.insert(FrameId(id), ImageSource::image(path.clone()));
        }
    }
    Ok(Dataset::new(stem(folder), sources, questions))
}

/// Image files of each class, by class name. Warns about folders without images, images in unsupported formats, and
/// links out of the data.
///
/// # Errors
/// If a folder cannot be read, or fewer than two have images.
fn classes(root: &Root) -> Result<BTreeMap<String, Vec<PathBuf>>> {
    let folder = root.folder();
    let (mut classes, mut links_out) = (BTreeMap::new(), Vec::new());
    let mut inside = root.entries(folder, &mut links_out)?;
    inside.retain(|path| path.is_dir());
    for inner in inside {
        let Some(name) = inner.file_name().and_then(OsStr::to_str) else {
            let problem = "the name of a class is not UTF-8; rename the folder";
            return Err(Error::data(inner.display(), problem));
        };
        if name.starts_with('.') {
            continue;
        }
        let found = ImagePaths::from_paths(root.entries(&inner, &mut links_out)?);
        found.warn_of_unsupported(&inner);
        if found.images.is_empty() {
            tracing::warn!("{}: no images in it, so it is not a class", inner.display());
            continue;
        }
        classes.insert(name.to_owned(), found.images);
    }
    root.warn_of_links_out(&links_out);
    if classes.len() < 2 {
        let found = if classes.is_empty() { "no folder" } else { "1 folder" };
        let problem = format_args!("{found} with images in it; --label-folders needs one for each class, at least two");
        return Err(Error::data(folder.display(), problem));
    }
    Ok(classes)
}

/// Number of choices of each question.
///
/// # Errors
/// If `choices` is below 2, or above the number of classes or [`Choices::MOST`]. Without `choices`, if there are more
/// than [`Choices::MOST`] classes.
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
        Some(count) if !(2..=Choices::MOST).contains(&count) => {
            Err(Error::usage("--choices", format_args!("a question has 2 to {} choices", Choices::MOST)))
        }
        Some(count) if count > classes => Err(Error::usage(
            "--choices",
            format_args!("{} has only {classes} classes; leave out --choices to offer them all", folder.display()),
        )),
        Some(count) => Ok(count),
    }
}

/// Draws the class names to offer for an image: the true class, and the other classes with the smallest digests of
/// image and name. They keep the order of `names`.
fn draw_choices<'n>(names: &[&'n str], truth: &str, count: usize, image: &Digest) -> Vec<&'n str> {
    let mut others: Vec<&str> = names.iter().copied().filter(|name| *name != truth).collect();
    others.sort_by_cached_key(|name| {
        *Digest::from_parts([&b"darkqa.label/1"[..], image.as_bytes(), name.as_bytes()]).as_bytes()
    });
    others.truncate(count - 1);
    names.iter().copied().filter(|name| *name == truth || others.contains(name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_one_or_two_folders() {
        let two = PairFolders::Two("a".into(), "b c".into());
        assert_eq!("a, b c".parse(), Ok(two));
        assert_eq!("a".parse(), Ok(PairFolders::One("a".into())));
        for wrong in ["", "a,", ",b", "a,b,c"] {
            assert!(wrong.parse::<PairFolders>().is_err(), "{wrong}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn class_name_must_be_utf8() {
        use std::os::unix::ffi::OsStrExt as _;
        let folder = tempfile::tempdir().unwrap();
        for name in [&b"\xe9"[..], b"\xe8"] {
            let class = folder.path().join(OsStr::from_bytes(name));
            std::fs::create_dir(&class).unwrap();
            std::fs::write(class.join("a.png"), "").unwrap();
        }
        let problem = classes(&Root::new(folder.path(), &[]).unwrap()).unwrap_err().to_string();
        assert!(problem.contains("is not UTF-8; rename"), "{problem}");
    }

    #[test]
    fn equal_class_names_name_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["dog", "Dog "] {
            std::fs::create_dir(folder.path().join(name)).unwrap();
            std::fs::write(folder.path().join(name).join("a.png"), "").unwrap();
        }
        let problem = open(&Root::new(folder.path(), &[]).unwrap(), "Which?", None).unwrap_err().to_string();
        assert!(problem.starts_with(&*folder.path().to_string_lossy()), "{problem}");
    }

    const NAMES: [&str; 5] = ["Bicycle", "Boat", "Cup", "Dog", "Table"];

    fn draw(content: &[u8]) -> Vec<&'static str> {
        draw_choices(&NAMES, "Cup", 3, &Digest::from_bytes(content))
    }

    #[test]
    fn drawn_choices_include_the_truth() {
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
    fn choice_count_checks_its_range() {
        assert_eq!(count(12, 0), Ok(12));
        assert_eq!(count(30, 4), Ok(4));
        for (classes, choices, part) in [
            (30, 0, "d has 30 classes, and a question at most 26 choices; --choices 4"),
            (30, 27, "2 to 26 choices"),
            (5, 1, "2 to 26 choices"),
            (3, 4, "has only 3 classes"),
        ] {
            assert!(count(classes, choices).unwrap_err().contains(part), "{part}");
        }
    }
}
