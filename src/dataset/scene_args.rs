//! The flags for sets of photographs: their light, pairs, and classes by folder ([`SceneArgs`]).

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::Args;

use super::pairs::Pairs;
use super::{DataPlace, Dataset, SetArgs, frames, label_folders, pair_frames, ready_made};
use crate::error::{Error, Result};
use crate::types::{Decides, SetLight};

/// The flags for sets of photographs.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Data")]
pub(crate) struct SceneArgs {
    /// The light in which the photographs of the data were taken; photographs in the dark are asked at L0 alone, as photographed and
    /// enhanced, unless --levels and --llie-on state otherwise; default: as dataset.json says, else lit
    #[arg(long, value_enum, value_name = "LIGHT", add = Decides::Trials)]
    pub light: Option<SetLight>,
    /// Photographs of the same scenes in normal and in low light: two folders, or one with folders normal and low; the low ones are
    /// asked as the condition dark; needs --questions, about the names of the files in normal light;
    /// default: none
    #[arg(long, value_name = "NORMAL,LOW|DIR", conflicts_with = "label_folders", add = Decides::Reply)]
    pub pairs: Option<PairFolders>,
    /// The question about each image of a folder that has a folder for each class: the choices are the names of these folders, and the
    /// answer is the name of the image's own folder; default: none
    #[arg(long, value_name = "QUESTION", add = Decides::Reply)]
    pub label_folders: Option<String>,
    /// How many choices a question of --label-folders has: its own class and others drawn by content, at most 26; default: all classes
    #[arg(long, value_name = "N", requires = "label_folders", add = Decides::Reply)]
    pub choices: Option<NonZeroUsize>,
}

/// The place of pairs: two folders, or one with both.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum PairFolders {
    /// The folders of the photographs in normal and in low light.
    Two(PathBuf, PathBuf),
    /// A folder with both.
    One(PathBuf),
}

impl std::str::FromStr for PairFolders {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split(',').map(str::trim).collect::<Vec<_>>()[..] {
            [one] if !one.is_empty() => Ok(Self::One(one.into())),
            [normal, low] if !normal.is_empty() && !low.is_empty() => {
                Ok(Self::Two(normal.into(), low.into()))
            }
            _ => Err(
                "two folders with a comma between them expected, or one folder with both"
                    .to_owned(),
            ),
        }
    }
}

impl PairFolders {
    /// The folder that names the data: that of the photographs in normal light, or the one with both.
    fn folder(&self) -> &Path {
        match self {
            Self::Two(folder, _) | Self::One(folder) => folder,
        }
    }

    /// The pairs, by the names of their files.
    ///
    /// # Errors
    /// If there are none.
    fn open(&self) -> Result<Pairs> {
        match self {
            Self::Two(normal, low) => Pairs::from_folders(normal, low),
            Self::One(folder) => Pairs::open(folder),
        }
    }
}

impl SceneArgs {
    /// The place of the data: that of the pairs if they are named.
    pub(crate) fn place(&self, data: DataPlace) -> DataPlace {
        match &self.pairs {
            Some(pairs) => DataPlace::Path(pairs.folder().to_owned()),
            None => data,
        }
    }

    /// The light in which the photographs at a place were taken: as the flag says, else `dataset.json`, else lit.
    ///
    /// # Errors
    /// If `dataset.json` cannot be read.
    pub(crate) fn set_light(&self, place: &DataPlace) -> Result<SetLight> {
        match (self.light, place) {
            (Some(light), _) => Ok(light),
            (None, DataPlace::Path(path)) if path.is_dir() => frames::light(path),
            (None, _) => Ok(SetLight::Lit),
        }
    }

    /// The data at a place with their questions, of which `questions` names a file.
    ///
    /// # Errors
    /// If the data cannot be read; the error names the file.
    pub(crate) fn open(
        &self,
        place: &DataPlace,
        questions: Option<&Path>,
        set: &SetArgs,
    ) -> Result<Dataset> {
        match self.apart(place)? {
            None => Dataset::open(place, questions, set),
            Some(dataset) if self.pairs.is_some() => {
                let Some(file) = questions else {
                    let problem = "pairs of photographs have no questions; --questions FILE names some about the files in normal light";
                    return Err(Error::usage("--pairs", problem));
                };
                dataset.with_questions_of(file, ready_made::about_frames(file, set)?, set.bad)
            }
            Some(dataset) => {
                let why = "the folders make the questions of --label-folders";
                super::refuse(questions, why)?;
                Ok(dataset)
            }
        }
    }

    /// The data of pairs without questions, or those of folders of classes; `None` if neither is named.
    ///
    /// # Errors
    /// If the data cannot be read; the error names the file.
    pub(crate) fn apart(&self, place: &DataPlace) -> Result<Option<Dataset>> {
        if let Some(pairs) = &self.pairs {
            return pair_frames::dataset(pairs.folder(), pairs.open()?).map(Some);
        }
        let Some(question) = &self.label_folders else {
            return Ok(None);
        };
        let DataPlace::Path(folder) = place else {
            let problem = "--data must name the folder with a folder for each class";
            return Err(Error::usage("--label-folders", problem));
        };
        label_folders::dataset(folder, question, self.choices).map(Some)
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
