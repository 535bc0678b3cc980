//! Choice of the files with the rows of a set: [`choose_files`].
//!
//! Splits of a data set: the split that a path names ([`split_in_name`]), and the files of the chosen split
//! ([`choose_split`]).

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use glob::{MatchOptions, Pattern};

use super::card::{Config, SplitPattern, parse_configs};
use super::tree::Tree;
use super::{SUPPORTED, extension, parquet};
use crate::ready_made::settings::SetArgs;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::shell_word;

/// Dataset card of a repository.
const CARD: &str = "README.md";

/// List of the splits in a folder of Arrow files (Python package `datasets`, `DatasetDict.save_to_disk`).
const ARROW_SPLITS: &str = "dataset_dict.json";

/// Names of the tables of an image folder (Hugging Face, "ImageFolder").
const METADATA: [&str; 3] = ["metadata.jsonl", "metadata.csv", "metadata.parquet"];

/// True if a tree with these files looks like a ready-made set.
pub(super) fn is_set(tree: &Tree, files: &[PathBuf]) -> bool {
    is_arrow(tree)
        || !card_configs(tree).0.is_empty()
        || files.iter().any(|path| is_metadata(path) || is_table(path) || extension(path) == "parquet")
}

/// True if the tree is a folder of Arrow files, as written by the Python package `datasets`.
fn is_arrow(tree: &Tree) -> bool {
    tree.has("state.json") && tree.has("dataset_info.json") || tree.has(ARROW_SPLITS)
}

/// Message about a folder of Arrow files, with the command that converts it. Its Parquet files are then read instead.
fn arrow_problem(tree: &Tree) -> &'static str {
    if tree.has(ARROW_SPLITS) {
        "a folder of Arrow files by split, as save_to_disk writes it, which are not read; write Parquet: python -c \"import datasets; [split.to_parquet(name + '.parquet') for name, split in datasets.load_from_disk('.').items()]\" in it, then name the split: --read split=NAME"
    } else {
        "a folder of Arrow files, as save_to_disk writes it, which are not read; write Parquet: python -c \"import datasets; datasets.load_from_disk('.').to_parquet('set.parquet')\" in it"
    }
}

/// Configurations in the card of a tree. If the card cannot be parsed, there are none, and a note says why.
fn card_configs(tree: &Tree) -> (Vec<Config>, Option<String>) {
    if !tree.has(CARD) {
        return (Vec::new(), None);
    }
    let configs = tree.read_text(CARD).map_err(|e| e.to_string()).and_then(|card| parse_configs(&card));
    match configs {
        Ok(configs) => (configs, None),
        Err(problem) => {
            let note = format!(
                "the configurations in {} cannot be read ({problem}), so the names of files decide",
                tree.full_path(Path::new(CARD)).display()
            );
            (Vec::new(), Some(note))
        }
    }
}

/// Chooses the files of one split, and returns a note if the card cannot be parsed. Without a configuration in the
/// card, metadata files are preferred, then Parquet files, then other tables.
///
/// # Errors
/// If there are no files, or it is not clear which to use; the error lists the files.
pub(super) fn choose_files(tree: &Tree, files: Vec<PathBuf>, args: &SetArgs) -> Result<(Vec<RowFile>, Option<String>)> {
    let has_parquet = files.iter().any(|path| extension(path) == "parquet");
    if is_arrow(tree) && !has_parquet {
        return Err(Error::data(tree.place().display(), arrow_problem(tree)));
    }
    let (configs, note) = card_configs(tree);
    let candidates = if configs.is_empty() {
        if let Some(name) = &args.config_name {
            let place = tree.place().display();
            let note = note.map_or_else(String::new, |note| format!("; {note}"));
            let problem = format_args!("{place}: no configurations to choose {name:?} from{note}");
            return Err(Error::usage("--read config", problem));
        }
        files_by_kind(tree, files)?
            .into_iter()
            .map(|path| RowFile { split: split_in_name(&path), config: String::new(), path })
            .collect()
    } else {
        let wanted = args.config_name.as_deref().or(args.preset_config.as_deref());
        files_by_card(tree, &configs, &files, wanted)?
    };
    let candidates = choose_split(tree, candidates, args.split.as_deref())?;
    Ok((candidates, note))
}

/// Files of the wanted configuration, or of all configurations for `all`. The default is the one marked so in the card,
/// or named `default`, or the only one.
///
/// # Errors
/// If there is no such configuration; the error lists them.
fn files_by_card(tree: &Tree, configs: &[Config], files: &[PathBuf], wanted: Option<&str>) -> Result<Vec<RowFile>> {
    let names: Vec<&str> = configs.iter().map(|config| config.name.as_str()).collect();
    let chosen: Vec<&Config> = match wanted {
        Some("all") => configs.iter().collect(),
        Some(name) => vec![find_config(configs, name).ok_or_else(|| {
            let problem = format_args!("no configuration {name:?}; there are {}", names.join(", "));
            Error::usage("--read config", problem)
        })?],
        None => vec![default_config(configs).ok_or_else(|| {
            let problem = format_args!(
                "{} configurations, {}; --read config=NAME names one, --read config=all takes them together",
                names.len(),
                names.join(", ")
            );
            Error::data(tree.place().display(), problem)
        })?],
    };
    let several = chosen.len() > 1;
    let mut candidates = Vec::new();
    for config in chosen {
        for (split, paths) in files_of_config(tree, config, files)? {
            for path in paths {
                candidates.push(RowFile {
                    split: match &*split {
                        "" => split_in_name(&path),
                        split => split.to_owned(),
                    },
                    config: if several { config.name.clone() } else { String::new() },
                    path,
                });
            }
        }
    }
    Ok(candidates)
}

fn find_config<'a>(configs: &'a [Config], name: &str) -> Option<&'a Config> {
    configs.iter().find(|config| config.name == name)
}

fn default_config(configs: &[Config]) -> Option<&Config> {
    match configs {
        [only] => Some(only),
        _ => configs.iter().find(|config| config.is_default).or_else(|| find_config(configs, "default")),
    }
}

/// Files of a configuration with the name of their split in the card, which may be empty.
fn files_of_config(tree: &Tree, config: &Config, files: &[PathBuf]) -> Result<Vec<(String, Vec<PathBuf>)>> {
    let folder = config.folder.trim_start_matches("./").trim_matches('/');
    let Some(patterns) = &config.files else {
        let inside = files.iter().filter_map(|path| path.strip_prefix(folder).ok()).map(Path::to_owned).collect();
        let found = files_by_kind(tree, inside)?.into_iter().map(|path| Path::new(folder).join(path)).collect();
        return Ok(vec![(String::new(), found)]);
    };
    patterns
        .iter()
        .map(|SplitPattern { split, pattern }| {
            let pattern = pattern.trim_start_matches("./");
            let pattern = if folder.is_empty() { pattern.to_owned() } else { format!("{folder}/{pattern}") };
            Ok((split.clone(), matching_files(tree, &pattern, files)?))
        })
        .collect()
}

/// Files that match a pattern of the card.
fn matching_files(tree: &Tree, pattern: &str, files: &[PathBuf]) -> Result<Vec<PathBuf>> {
    if pattern.split('/').any(|part| part == "..") || pattern.starts_with('/') {
        return Err(card_error(tree, format_args!("the files {pattern:?} lie outside the folder of the card")));
    }
    let glob = Pattern::new(pattern.trim_start_matches("./"))
        .map_err(|e| card_error(tree, format_args!("the files {pattern:?}: not a pattern: {e}")))?;
    let options = MatchOptions { require_literal_separator: true, ..MatchOptions::default() };
    let matching: Vec<PathBuf> = files.iter().filter(|path| glob.matches_path_with(path, options)).cloned().collect();
    if matching.is_empty() {
        return Err(card_error(tree, format_args!("no file {pattern:?} beside it; download the whole repository")));
    }
    Ok(matching)
}

fn card_error(tree: &Tree, problem: impl std::fmt::Display) -> Error {
    Error::data(tree.full_path(Path::new(CARD)).display(), problem)
}

fn is_metadata(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default();
    METADATA.iter().any(|known| name == *known)
}

/// Files of a tree without a card: metadata files, else Parquet files, else other tables.
///
/// # Errors
/// If there are no files, or files of several kinds.
fn files_by_kind(tree: &Tree, files: Vec<PathBuf>) -> Result<Vec<PathBuf>> {
    let (metadata, others) = files.into_iter().partition::<Vec<PathBuf>, _>(|path| is_metadata(path));
    if !metadata.is_empty() {
        return require_one_kind(tree, metadata);
    }
    let (parquet, others) = others.into_iter().partition::<Vec<PathBuf>, _>(|path| extension(path) == "parquet");
    if !parquet.is_empty() {
        return Ok(parquet);
    }
    let tables: Vec<PathBuf> = others.into_iter().filter(|path| is_table(path)).collect();
    if tables.is_empty() {
        let problem = format_args!("no file of questions in it: {SUPPORTED} expected");
        return Err(Error::data(tree.place().display(), problem));
    }
    require_one_kind(tree, tables)
}

/// True if a file is a CSV, TSV or JSON table in the top folder. Tables in subfolders may be unrelated.
fn is_table(path: &Path) -> bool {
    const NO_TABLES: [&str; 3] = ["dataset.json", "classes.json", "info.json"];
    let is_in_top_folder = path.parent() == Some(Path::new(""));
    let is_text = matches!(&*extension(path), "tsv" | "csv" | "jsonl" | "ndjson" | "json");
    is_in_top_folder && is_text && !NO_TABLES.iter().any(|name| path == Path::new(name))
}

/// Returns the files if they are of one kind.
///
/// # Errors
/// If they are of several kinds.
fn require_one_kind(tree: &Tree, files: Vec<PathBuf>) -> Result<Vec<PathBuf>> {
    let kinds: BTreeSet<String> = files.iter().map(|path| extension(path)).collect();
    if kinds.len() == 1 {
        return Ok(files);
    }
    let names: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
    let problem = format!(
        "files of several kinds, {}; name the one that is meant: --data {}",
        names.join(", "),
        shell_word(&tree.full_path(&files[0]).display().to_string())
    );
    Err(Error::data(tree.place().display(), problem))
}

/// File of rows, with its split and configuration.
#[derive(Debug, Clone)]
pub(super) struct RowFile {
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
fn split_in_name(path: &Path) -> String {
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
fn choose_split(tree: &Tree, files: Vec<RowFile>, wanted: Option<&str>) -> Result<Vec<RowFile>> {
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
            .map(|split| RowFile { split: (*split).to_owned(), config: String::new(), path: split.into() })
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
