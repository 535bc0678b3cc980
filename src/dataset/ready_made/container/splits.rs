//! The split of each file of a set, and the one that is asked: [`of_name`], [`chosen`].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::{ending, parquet};
use crate::error::{Error, Result};

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
pub(super) fn of_name(path: &Path) -> String {
    let text = path.to_string_lossy().to_lowercase();
    let mut words = text.split(|c: char| !c.is_alphabetic());
    let split = words.find_map(|word| WORDS.iter().find(|(known, _)| *known == word));
    split.map_or_else(String::new, |(_, split)| (*split).to_owned())
}

/// The files of the split that is asked: the one named, else the only one, else `test`.
///
/// # Errors
/// If no file is of the split named, or none is named and several splits are there; the error lists the splits with their rows.
pub(super) fn chosen(
    place: &Path,
    files: Vec<(String, PathBuf)>,
    wanted: Option<&str>,
) -> Result<Vec<PathBuf>> {
    let mut splits: BTreeMap<&str, Vec<&Path>> = BTreeMap::new();
    for (split, file) in &files {
        splits.entry(split).or_default().push(file);
    }
    let split = match wanted {
        Some("all") => None,
        Some(name) if splits.contains_key(name) => Some(name),
        Some(name) => {
            let problem = format_args!("no split {name:?}; there are {}", listed(&splits));
            return Err(Error::usage("--split", problem));
        }
        None if splits.len() == 1 => None,
        None if splits.contains_key("test") => Some("test"),
        None => {
            let problem = format_args!(
                "the splits {}; --split NAME names one, --split all takes them together",
                listed(&splits)
            );
            return Err(Error::data(place.display(), problem));
        }
    };
    let split = split.map(str::to_owned);
    let files = files.into_iter();
    let of_split = files.filter(|(of, _)| split.as_ref().is_none_or(|split| of == split));
    Ok(of_split.map(|(_, file)| file).collect())
}

/// The splits with their rows where these are cheap to know, as `test (1,000 rows)`.
fn listed(splits: &BTreeMap<&str, Vec<&Path>>) -> String {
    let splits = splits.iter().map(|(split, files)| {
        let name = if split.is_empty() {
            "without a name"
        } else {
            split
        };
        let rows: Option<u64> = files
            .iter()
            .map(|file| {
                (ending(file) == "parquet")
                    .then(|| parquet::count(file).ok())
                    .flatten()
            })
            .sum();
        match rows {
            Some(rows) => format!("{name} ({rows} rows)"),
            None => format!("{name} ({} files)", files.len()),
        }
    });
    splits.collect::<Vec<String>>().join(", ")
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
            assert_eq!(of_name(Path::new(path)), split, "{path}");
        }
    }

    #[test]
    fn one_split_is_chosen_or_named() {
        let files = |splits: &[&str]| {
            let files = splits
                .iter()
                .map(|split| ((*split).to_owned(), PathBuf::from(split)));
            files.collect::<Vec<(String, PathBuf)>>()
        };
        let place = Path::new("set");
        let choose = |splits: &[&str], wanted| chosen(place, files(splits), wanted);
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
            problem.contains("dev (1 files), train (1 files); --split"),
            "{problem}"
        );
        let problem = choose(&["dev"], Some("tset")).unwrap_err().to_string();
        assert!(problem.contains("no split \"tset\""), "{problem}");
    }
}
