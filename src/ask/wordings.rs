//! The wordings in which a run asks its questions: [`Wording`], and [`PromptSet`] for their names on the command line.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::prompts::Prompts;
use crate::error::{Error, Result};
use crate::types::Shared;

/// The flag that names prompts.
const FLAG: &str = "--prompts";

/// Prompts by name: built in, or in a folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct PromptSet {
    /// `None` for a folder without a name.
    name: Option<String>,
    /// `None` for built-in prompts.
    folder: Option<PathBuf>,
}

impl PromptSet {
    /// The folder of the prompts; `None` if they are built in.
    #[must_use]
    pub(crate) fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// Reads the prompts.
    ///
    /// # Errors
    /// As [`Prompts::load`].
    pub(crate) fn open(&self) -> Result<Prompts> {
        match (&self.folder, &self.name) {
            (Some(folder), _) => Prompts::load(folder),
            (None, name) => Prompts::built_in(name.as_deref().unwrap_or(Prompts::DEFAULT)),
        }
    }
}

/// A built-in name, `NAME=FOLDER` or a folder. A folder whose whole path is the text takes precedence over
/// `NAME=FOLDER`, and a built-in name over a folder: `./terse` is a folder.
impl FromStr for PromptSet {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        if text.is_empty() {
            return Err(format!("a folder or one of {} expected", Prompts::BUILT_IN.join(", ")));
        }
        if Prompts::BUILT_IN.contains(&text) {
            return Ok(Self { name: Some(text.to_owned()), folder: None });
        }
        let named = text.split_once('=').filter(|(name, folder)| is_name(name) && !folder.is_empty());
        Ok(match named {
            Some((name, folder)) if !Path::new(text).exists() => {
                Self { name: Some(name.to_owned()), folder: Some(folder.into()) }
            }
            _ => Self { name: None, folder: Some(text.into()) },
        })
    }
}

/// True for a name of letters, digits, `_`, `-` and `.` that begins with a letter or digit: it needs no quotes in
/// tables, files and shells.
fn is_name(name: &str) -> bool {
    let is_inner = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
    name.starts_with(|c: char| c.is_ascii_alphanumeric()) && name.chars().all(is_inner)
}

/// One set of prompts of a run.
#[derive(Debug)]
pub(crate) struct Wording {
    /// The name in records and tables; `None` if the run has a single wording.
    pub(crate) name: Option<Shared<String>>,
    /// The templates.
    pub(crate) prompts: Prompts,
}

impl Wording {
    /// Reads the wordings of a run; without sets, the default prompts.
    ///
    /// # Errors
    /// If prompts cannot be read, or if one of several sets has no name, the name of another, or its text: every
    /// request would be paid twice.
    pub(crate) fn open(sets: &[PromptSet]) -> Result<Vec<Self>> {
        match sets {
            [] => Ok(vec![Self { name: None, prompts: Prompts::built_in(Prompts::DEFAULT)? }]),
            [only] => Ok(vec![Self { name: None, prompts: only.open()? }]),
            _ => Self::open_several(sets),
        }
    }

    fn open_several(sets: &[PromptSet]) -> Result<Vec<Self>> {
        let (mut names, mut wordings) = (BTreeSet::new(), Vec::<Self>::new());
        for set in sets {
            let Some(name) = &set.name else {
                let folder = set.folder.clone().unwrap_or_default();
                let problem = format_args!("each of several wordings needs a name: {FLAG} NAME={}", folder.display());
                return Err(Error::usage(FLAG, problem));
            };
            if !names.insert(name) {
                return Err(Error::usage(FLAG, format_args!("two wordings are named {name}: name each differently")));
            }
            let prompts = set.open()?;
            if let Some(same) = wordings.iter().find(|other| other.prompts.digest() == prompts.digest()) {
                let other = same.name.as_ref().map_or("", |name| name.as_str());
                let problem = format_args!("{other} and {name} are the same text: leave one of them out");
                return Err(Error::usage(FLAG, problem));
            }
            wordings.push(Self { name: Some(name.clone().into()), prompts });
        }
        Ok(wordings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(text: &str) -> PromptSet {
        text.parse().unwrap()
    }

    #[test]
    fn names_and_folders_are_told_apart() {
        let folder =
            |name: Option<&str>, folder: &str| PromptSet { name: name.map(str::to_owned), folder: Some(folder.into()) };
        assert_eq!(set("terse"), PromptSet { name: Some("terse".into()), folder: None });
        assert_eq!(set("./terse"), folder(None, "./terse"));
        assert_eq!(set("mine=own/a=b"), folder(Some("mine"), "own/a=b"));
        assert_eq!(set("a b=own"), folder(None, "a b=own"));
        assert_eq!(set("mine="), folder(None, "mine="));
        let existing = tempfile::tempdir().unwrap();
        let path = existing.path().join("a=b");
        std::fs::create_dir(&path).unwrap();
        let text = path.display().to_string();
        assert_eq!(set(&text), folder(None, &text));
        assert!("".parse::<PromptSet>().unwrap_err().contains("paper, terse, letter"));
    }

    #[test]
    fn only_several_wordings_are_named() {
        let names = |sets: &[&str]| -> Vec<Option<String>> {
            let sets: Vec<PromptSet> = sets.iter().map(|text| set(text)).collect();
            let wordings = Wording::open(&sets).unwrap();
            wordings.into_iter().map(|wording| wording.name.map(|name| name.to_string())).collect()
        };
        assert_eq!(names(&[]), [None]);
        assert_eq!(names(&["terse"]), [None]);
        assert_eq!(names(&["paper", "terse"]), [Some("paper".into()), Some("terse".into())]);
    }

    #[test]
    fn wordings_that_would_be_paid_twice_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("choice.txt"), include_str!("../../prompts/choice.txt")).unwrap();
        let path = folder.path().display();
        for (sets, expected) in [
            (["terse", "terse"].map(str::to_owned), "two wordings are named terse"),
            (["terse".to_owned(), path.to_string()], "needs a name: --prompts NAME="),
            (["paper".to_owned(), format!("mine={path}")], "paper and mine are the same text"),
        ] {
            let sets: Vec<PromptSet> = sets.iter().map(|text| set(text)).collect();
            let problem = Wording::open(&sets).unwrap_err().to_string();
            assert!(problem.contains(expected), "{problem}");
        }
    }

    #[test]
    fn built_in_prompts_differ_with_and_without_image() {
        let digests: BTreeSet<String> =
            Prompts::BUILT_IN.iter().map(|name| Prompts::built_in(name).unwrap().digest().to_string()).collect();
        assert_eq!(digests.len(), Prompts::BUILT_IN.len());
    }
}
