//! The wordings in which a run asks its questions: [`Wording`], and [`PromptSet`] for their names on the command line.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::prompts::Prompts;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Shared;
use darkqa_base::types::text::is_in_names;

/// The flag that names prompts.
const FLAG: &str = "--prompts";

/// One value of `--prompts`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PromptSet {
    /// Built-in prompts by their name.
    BuiltIn(&'static str),
    /// Prompts in a folder, which has a name if it is one of several.
    Folder { name: Option<String>, folder: PathBuf },
}

impl PromptSet {
    /// The folder of the prompts; `None` if they are built in.
    #[must_use]
    pub fn folder(&self) -> Option<&Path> {
        match self {
            Self::BuiltIn(_) => None,
            Self::Folder { folder, .. } => Some(folder),
        }
    }

    fn name(&self) -> Option<&str> {
        match self {
            Self::BuiltIn(name) => Some(name),
            Self::Folder { name, .. } => name.as_deref(),
        }
    }

    /// Reads the prompts.
    ///
    /// # Errors
    /// As [`Prompts::load`]; a folder that does not exist may be a mistyped name, so that the built-in ones are listed.
    fn open(&self) -> Result<Prompts> {
        match self {
            Self::BuiltIn(name) => Prompts::built_in(name),
            Self::Folder { folder, .. } if !folder.exists() => {
                let (folder, built_in) = (folder.display(), Prompts::BUILT_IN.join(", "));
                Err(Error::usage(FLAG, format_args!("no folder {folder}, and the built-in prompts are {built_in}")))
            }
            Self::Folder { folder, .. } => Prompts::load(folder),
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
        if let Some(name) = Prompts::BUILT_IN.into_iter().find(|name| *name == text) {
            return Ok(Self::BuiltIn(name));
        }
        let named = text.split_once('=').filter(|(name, folder)| is_name(name) && !folder.is_empty());
        Ok(match named {
            Some((name, folder)) if !Path::new(text).exists() => {
                Self::Folder { name: Some(name.to_owned()), folder: folder.into() }
            }
            _ => Self::Folder { name: None, folder: text.into() },
        })
    }
}

/// True for the name of a wording, which begins with a letter or digit.
fn is_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphanumeric()) && name.chars().all(is_in_names)
}

/// One set of prompts of a run.
#[derive(Debug)]
pub struct Wording {
    /// The name in records and tables; `None` if the run has a single wording.
    pub name: Option<Shared<String>>,
    /// The templates.
    pub prompts: Prompts,
}

impl Wording {
    /// Reads the wordings of a run; without sets, the default prompts.
    ///
    /// # Errors
    /// If prompts cannot be read, or if one of several sets has no name, the name of another, or its text: every
    /// request would be paid twice.
    pub fn open(sets: &[PromptSet]) -> Result<Vec<Self>> {
        match sets {
            [] => Ok(vec![Self { name: None, prompts: Prompts::built_in(Prompts::DEFAULT)? }]),
            [only] => Ok(vec![Self { name: None, prompts: only.open()? }]),
            _ => Self::open_several(sets),
        }
    }

    fn open_several(sets: &[PromptSet]) -> Result<Vec<Self>> {
        let (mut names, mut wordings) = (BTreeSet::new(), Vec::<Self>::new());
        for set in sets {
            let Some(name) = set.name() else {
                let folder = set.folder().unwrap_or(Path::new("")).display();
                let problem = format_args!("each of several wordings needs a name: {FLAG} NAME={folder}");
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
            wordings.push(Self { name: Some(name.to_owned().into()), prompts });
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
        let folder = |name: Option<&str>, folder: &str| PromptSet::Folder {
            name: name.map(str::to_owned),
            folder: folder.into(),
        };
        assert_eq!(set("terse"), PromptSet::BuiltIn("terse"));
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
        std::fs::write(folder.path().join("choice.txt"), darkqa_prompts::PAPER.choice).unwrap();
        let path = folder.path().display();
        for (sets, expected) in [
            (["terse", "terse"].map(str::to_owned), "two wordings are named terse"),
            (["terse".to_owned(), path.to_string()], "needs a name: --prompts NAME="),
            (["paper".to_owned(), format!("mine={path}")], "paper and mine are the same text"),
            (["paper".to_owned(), "mine=ters".to_owned()], "no folder ters, and the built-in prompts are paper, terse"),
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
