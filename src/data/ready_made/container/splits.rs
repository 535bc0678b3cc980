//! Splits of a data set: the split that a path names ([`split_in_name`]), and the files of the chosen split
//! ([`choose_split`]).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::tree::Tree;
use super::{extension, parquet};
use crate::error::{Error, Result};

/// File of rows, with its split and configuration.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    /// Name of the split; empty if the path names none.
    pub(super) split: String,
    pub(super) config: String,
    pub(super) path: PathBuf,
}

/// Words in paths, and the split that each names (Hugging Face, "File names and splits").
const SPLIT_WORDS: [(&str, &str); 10] = [
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

/// Split that a relative path names, by its first word in [`SPLIT_WORDS`]; empty if it has none. Any character other
/// than a letter separates words.
pub(super) fn split_in_name(path: &Path) -> String {
    let text = path.to_string_lossy().to_lowercase();
    let split =
        text.split(|c: char| !c.is_alphabetic()).find_map(|word| SPLIT_WORDS.iter().find(|(known, _)| *known == word));
    split.map_or_else(String::new, |(_, split)| (*split).to_owned())
}

/// The usual word for a split; the name itself if there is none.
fn usual_word(name: &str) -> &str {
    SPLIT_WORDS.iter().find(|(word, _)| *word == name).map_or(name, |(_, usual)| usual)
}

/// Files of the wanted split, or of all splits for `all`. The default is the only split, or `test` if several exist.
///
/// # Errors
/// If the wanted split does not exist, or if no split is wanted and several exist without `test`. The error lists the
/// splits.
pub(super) fn choose_split(tree: &Tree, files: Vec<Candidate>, wanted: Option<&str>) -> Result<Vec<Candidate>> {
    let mut splits: BTreeMap<&str, Vec<&Path>> = BTreeMap::new();
    for file in &files {
        splits.entry(&file.split).or_default().push(&file.path);
    }
    let split = match wanted {
        Some("all") => None,
        Some(name) if splits.contains_key(name) => Some(name),
        // `val` names the split that a file `val.parquet` has.
        Some(name) if splits.contains_key(usual_word(name)) => Some(usual_word(name)),
        Some(name) => {
            let problem = format_args!("no split {name:?}; there are {}", list_splits(tree, &splits));
            return Err(Error::usage("--read split", problem));
        }
        None if splits.len() == 1 => None,
        None if splits.contains_key("test") => Some("test"),
        None => {
            let problem = format_args!(
                "the splits {}; --read split=NAME names one, --read split=all takes them together",
                list_splits(tree, &splits)
            );
            return Err(Error::data(tree.place().display(), problem));
        }
    };
    let split = split.map(str::to_owned);
    Ok(files.into_iter().filter(|file| split.as_ref().is_none_or(|split| file.split == *split)).collect())
}

/// Lists the splits with their numbers of rows, such as `test (rows: 1000)`. Rows are counted for Parquet files in a
/// folder, which have the count in their footer; other splits get the number of files.
fn list_splits(tree: &Tree, splits: &BTreeMap<&str, Vec<&Path>>) -> String {
    splits
        .iter()
        .map(|(split, files)| {
            let name = if split.is_empty() { "without a name" } else { split };
            let counts: Option<u64> = files
                .iter()
                .map(|file| match (tree, &*extension(file)) {
                    (Tree::Folder { .. }, "parquet") => parquet::count(&tree.full_path(file)).ok(),
                    _ => None,
                })
                .sum();
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
    fn split_is_whole_word_of_path() {
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

    /// Chosen paths of a set with one file per split; each path is the name of its split.
    fn choose(splits: &[&str], wanted: Option<&str>) -> Result<Vec<PathBuf>> {
        let folder = tempfile::tempdir().unwrap();
        let tree = Tree::from_folder(folder.path()).unwrap();
        let files = splits
            .iter()
            .map(|split| Candidate { split: (*split).to_owned(), config: String::new(), path: split.into() })
            .collect();
        let files = choose_split(&tree, files, wanted)?;
        Ok(files.into_iter().map(|file| file.path).collect())
    }

    #[test]
    fn default_is_only_split_or_test() {
        assert_eq!(choose(&["a"], None).unwrap(), [Path::new("a")]);
        assert_eq!(choose(&["test", "train"], None).unwrap(), [Path::new("test")]);
    }

    #[test]
    fn wanted_split_is_chosen() {
        assert_eq!(choose(&["test", "train"], Some("train")).unwrap(), [Path::new("train")]);
        assert_eq!(choose(&["dev", "train"], Some("all")).unwrap().len(), 2);
        assert_eq!(choose(&["validation", "train"], Some("val")).unwrap(), [Path::new("validation")]);
    }

    #[test]
    fn ambiguous_or_unknown_split_is_error() {
        let problem = choose(&["dev", "train"], None).unwrap_err().to_string();
        assert!(problem.contains("dev (files: 1), train (files: 1); --read split"), "{problem}");
        let problem = choose(&["dev"], Some("tset")).unwrap_err().to_string();
        assert!(problem.contains("no split \"tset\""), "{problem}");
    }
}
