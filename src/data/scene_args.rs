//! Flags for sets of photographs: their light, pairs, and class folders ([`SceneArgs`]).

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::Args;

use super::pairs::Pairs;
use super::{DataPlace, Dataset, Root, SetArgs, frames, label_folders, pair_frames, ready_made};
use crate::error::{Error, Result};
use crate::types::{Decides, SetLight};

/// Flags for sets of photographs.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Data")]
pub(crate) struct SceneArgs {
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
pub(crate) enum PairFolders {
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
    pub(crate) fn place(&self, data: DataPlace) -> DataPlace {
        match &self.pairs {
            Some(pairs) => DataPlace::Path(pairs.folder().to_owned()),
            None => data,
        }
    }

    /// Light in which the photographs at a place were taken: from `--light`, else from `dataset.json`, else lit.
    ///
    /// # Errors
    /// If `dataset.json` cannot be read.
    pub(crate) fn set_light(&self, place: &DataPlace, further: &[PathBuf]) -> Result<SetLight> {
        match (self.light, place) {
            (Some(light), _) => Ok(light),
            (None, DataPlace::Path(path)) if path.is_dir() => frames::light(path, further),
            (None, DataPlace::Path(path)) if ready_made::is_zip_file(path) => ready_made::light_of_archive(path),
            (None, _) => Ok(SetLight::Lit),
        }
    }

    /// Opens the data at a place, with the questions of a file if one is given.
    ///
    /// # Errors
    /// If the data cannot be read; the error names the file.
    pub(crate) fn open(&self, place: &DataPlace, questions: Option<&Path>, set: &SetArgs) -> Result<Dataset> {
        match self.pairs_or_classes(place, &set.root.data_root)? {
            None => Dataset::open(place, questions, set),
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
                super::refuse_questions(questions, why)?;
                Ok(dataset)
            }
        }
    }

    /// Opens the data of `--pairs` (without questions) or `--label-folders`; `None` if neither flag is given.
    ///
    /// # Errors
    /// If the data cannot be read; the error names the file.
    pub(crate) fn pairs_or_classes(&self, place: &DataPlace, further: &[PathBuf]) -> Result<Option<Dataset>> {
        if let Some(pairs) = &self.pairs {
            return pair_frames::open(pairs.folder(), pairs.open(further)?).map(Some);
        }
        let Some(question) = &self.label_folders else {
            return Ok(None);
        };
        let DataPlace::Path(folder) = place else {
            let problem = "--data must name the folder with a folder for each class";
            return Err(Error::usage("--label-folders", problem));
        };
        let root = Root::new(folder, further)?;
        label_folders::open(&root, question, self.choices).map(Some)
    }
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
}
