//! The split of each file of a set, and the one that is asked: [`split_in_name`], [`chosen`].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::tree::Tree;
use super::{ending, parquet};
use crate::error::{Error, Result};

/// A file of rows, with its split and its configuration.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    pub(super) split: String,
    pub(super) config: String,
    pub(super) path: PathBuf,
}

/// The words that name splits, and the split that each means (Hugging Face, "File names and splits").
const WORDS: [(&str, &str); 10] = [
    ("train", "train"),
    ("training", "train"),
    ("validation", "validation"),
    ("valid", "validation"),
    ("val", "validation"),
    ("dev", "validation"),
    ("test", "test"),
    ("testing", "test"),
    ("eval", "test"),
    ("evaluation", "test"),
];

/// The split that a path below a folder names: the first of its words, between signs that are no letters; empty if it names none.
pub(super) fn split_in_name(path: &Path) -> String {
    let text = path.to_string_lossy().to_lowercase();
    let split = text
        .split(|c: char| !c.is_alphabetic())
        .find_map(|word| WORDS.iter().find(|(known, _)| *known == word));
    split.map_or_else(String::new, |(_, split)| (*split).to_owned())
}

/// The files of the split that is asked: the one named, else the only one, else `test`.
///
/// # Errors
/// If no file is of the split named, or none is named and several splits are there; the error lists the splits with their rows.
pub(super) fn chosen(
    tree: &Tree,
    files: Vec<Candidate>,
    wanted: Option<&str>,
) -> Result<Vec<Candidate>> {
    let mut splits: BTreeMap<&str, Vec<&Path>> = BTreeMap::new();
    for file in &files {
        splits.entry(&file.split).or_default().push(&file.path);
    }
    let split = match wanted {
        Some("all") => None,
        Some(name) if splits.contains_key(name) => Some(name),
        Some(name) => {
            let problem = format_args!("no split {name:?}; there are {}", listed(tree, &splits));
            return Err(Error::usage("--read split", problem));
        }
        None if splits.len() == 1 => None,
        None if splits.contains_key("test") => Some("test"),
        None => {
            let problem = format_args!(
                "the splits {}; --read split=NAME names one, --read split=all takes them together",
                listed(tree, &splits)
            );
            return Err(Error::data(tree.place().display(), problem));
        }
    };
    let split = split.map(str::to_owned);
    let of_split = files
        .into_iter()
        .filter(|file| split.as_ref().is_none_or(|split| file.split == *split));
    Ok(of_split.collect())
}

/// The splits with their rows where these are cheap to know, as `test (rows: 1000)`.
fn listed(tree: &Tree, splits: &BTreeMap<&str, Vec<&Path>>) -> String {
    let rows = |file: &&Path| match (tree, &*ending(file)) {
        (Tree::Folder { .. }, "parquet") => parquet::count(&tree.whole(file)).ok(),
        _ => None,
    };
    splits
        .iter()
        .map(|(split, files)| {
            let name = if split.is_empty() {
                "without a name"
            } else {
                split
            };
            let counts: Option<u64> = files.iter().map(rows).sum();
            match counts {
                Some(rows) => format!("{name} (rows: {rows})"),
                None => format!("{name} (files: {})", files.len()),
            }
        })
        .collect::<Vec<String>>()
        .join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_split_is_a_word_of_a_path() {
        for (path, split) in [
            ("data/test-00000-of-00001.parquet", "test"),
            ("val/metadata.csv", "validation"),
            ("my_train_split.csv", "train"),
            ("latest/contest.parquet", ""),
            ("Questions.csv", ""),
        ] {
            assert_eq!(split_in_name(Path::new(path)), split, "{path}");
        }
    }

    #[test]
    fn one_split_is_chosen_or_named() {
        let files = |splits: &[&str]| {
            splits
                .iter()
                .map(|split| Candidate {
                    split: (*split).to_owned(),
                    config: String::new(),
                    path: split.into(),
                })
                .collect::<Vec<Candidate>>()
        };
        let folder = tempfile::tempdir().unwrap();
        let tree = Tree::from_folder(folder.path()).unwrap();
        let choose = |splits: &[&str], wanted| {
            let files = chosen(&tree, files(splits), wanted)?.into_iter();
            Ok::<_, Error>(files.map(|file| file.path).collect::<Vec<_>>())
        };
        assert_eq!(choose(&["a"], None).unwrap(), [Path::new("a")]);
        assert_eq!(
            choose(&["test", "train"], None).unwrap(),
            [Path::new("test")]
        );
        assert_eq!(
            choose(&["test", "train"], Some("train")).unwrap(),
            [Path::new("train")]
        );
        assert_eq!(choose(&["dev", "train"], Some("all")).unwrap().len(), 2);
        let problem = choose(&["dev", "train"], None).unwrap_err().to_string();
        assert!(
            problem.contains("dev (files: 1), train (files: 1); --read split"),
            "{problem}"
        );
        let problem = choose(&["dev"], Some("tset")).unwrap_err().to_string();
        assert!(problem.contains("no split \"tset\""), "{problem}");
    }
}
