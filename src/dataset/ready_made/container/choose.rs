//! The files of a tree that hold the rows: [`chosen`].

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use glob::{MatchOptions, Pattern};

use super::card::{Config, configs};
use super::splits::Candidate;
use super::tree::Tree;
use super::{READ, ending, splits};
use crate::dataset::ready_made::settings::SetArgs;
use crate::error::{Error, Result};
use crate::types::shell_word;

/// The card of a repository.
const CARD: &str = "README.md";

/// The names of the tables of an image folder (Hugging Face, "ImageFolder").
const METADATA: [&str; 3] = ["metadata.jsonl", "metadata.csv", "metadata.parquet"];

/// Whether some files of a tree look like a set.
pub(super) fn is_set(tree: &Tree, files: &[PathBuf]) -> bool {
    let is_arrow = tree.has("state.json") && tree.has("dataset_info.json");
    is_arrow
        || !named(tree).0.is_empty()
        || files.iter().any(|path| is_metadata(path))
        || files.iter().any(|path| is_rows(path))
}

/// The configurations that the card of a tree names; of a card that cannot be read, none, and why.
fn named(tree: &Tree) -> (Vec<Config>, Option<String>) {
    if !tree.has(CARD) {
        return (Vec::new(), None);
    }
    let card = tree.text(CARD).map_err(|e| e.to_string());
    match card.and_then(|card| configs(&card)) {
        Ok(configs) => (configs, None),
        Err(problem) => {
            let note = format!(
                "the configurations in {} cannot be read ({problem}), so the names of files decide",
                tree.whole(Path::new(CARD)).display()
            );
            (Vec::new(), Some(note))
        }
    }
}

/// The files that are asked, and the faults of the card: those of a configuration of the card, else the metadata, else by their endings; of one split.
///
/// # Errors
/// If there are none, or it is not clear which are meant; the error lists the files.
pub(super) fn chosen(
    tree: &Tree,
    files: Vec<PathBuf>,
    args: &SetArgs,
) -> Result<(Vec<Candidate>, Option<String>)> {
    if tree.has("dataset_info.json") && tree.has("state.json") {
        let problem = "a folder of Arrow files, which are not read; write Parquet: python -c \"import datasets; datasets.load_from_disk('.').to_parquet('set.parquet')\" in it";
        return Err(Error::data(tree.place().display(), problem));
    }
    let (configs, note) = named(tree);
    let candidates = if configs.is_empty() {
        if let Some(name) = &args.config_name {
            let place = tree.place().display();
            let note = note.map_or_else(String::new, |note| format!("; {note}"));
            let problem = format_args!("{place}: no configurations to choose {name:?} from{note}");
            return Err(Error::usage("--read config", problem));
        }
        by_kind(tree, files)?
            .into_iter()
            .map(|path| Candidate {
                split: splits::split_in_name(&path),
                config: String::new(),
                path,
            })
            .collect()
    } else {
        {
            let wanted = args
                .config_name
                .as_deref()
                .or(args.preset_config.as_deref());
            files_by_card(tree, &configs, &files, wanted)?
        }
    };
    let candidates = splits::chosen(tree, candidates, args.split.as_deref())?;
    Ok((candidates, note))
}

/// The files of the configuration that is asked, or of all.
fn files_by_card(
    tree: &Tree,
    configs: &[Config],
    files: &[PathBuf],
    wanted: Option<&str>,
) -> Result<Vec<Candidate>> {
    let names: Vec<&str> = configs.iter().map(|config| config.name.as_str()).collect();
    let of_name = |name: &str| configs.iter().find(|config| config.name == name);
    let default = configs.iter().find(|config| config.is_default);
    let only = if let [only] = configs {
        Some(only)
    } else {
        None
    };
    let chosen: Vec<&Config> = match wanted {
        Some("all") => configs.iter().collect(),
        Some(name) => vec![of_name(name).ok_or_else(|| {
            let problem = format_args!("no configuration {name:?}; there are {}", names.join(", "));
            Error::usage("--read config", problem)
        })?],
        None => vec![default.or_else(|| of_name("default")).or(only).ok_or_else(|| {
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
                candidates.push(Candidate {
                    split: match &*split {
                        "" => splits::split_in_name(&path),
                        split => split.to_owned(),
                    },
                    config: if several {
                        config.name.clone()
                    } else {
                        String::new()
                    },
                    path,
                });
            }
        }
    }
    Ok(candidates)
}

/// The files of a configuration by the split that the card names.
fn files_of_config(
    tree: &Tree,
    config: &Config,
    files: &[PathBuf],
) -> Result<Vec<(String, Vec<PathBuf>)>> {
    let folder = config.folder.trim_start_matches("./").trim_matches('/');
    let Some(patterns) = &config.files else {
        let inside = files.iter().filter(|path| path.starts_with(folder));
        let below = |path: &PathBuf| path.strip_prefix(folder).map(Path::to_owned).ok();
        let found = by_kind(tree, inside.filter_map(below).collect())?;
        let found = found.into_iter().map(|path| Path::new(folder).join(path));
        return Ok(vec![(String::new(), found.collect())]);
    };
    patterns
        .iter()
        .map(|(split, pattern)| {
            let pattern = pattern.trim_start_matches("./");
            let pattern = if folder.is_empty() {
                pattern.to_owned()
            } else {
                format!("{folder}/{pattern}")
            };
            Ok((split.clone(), matching(tree, &pattern, files)?))
        })
        .collect()
}

/// The files that fit a pattern of the card.
fn matching(tree: &Tree, pattern: &str, files: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let wrong = |problem: String| Error::data(tree.whole(Path::new(CARD)).display(), problem);
    if pattern.split('/').any(|part| part == "..") || pattern.starts_with('/') {
        return Err(wrong(format!(
            "the files {pattern:?} lie outside the folder of the card"
        )));
    }
    let glob = Pattern::new(pattern.trim_start_matches("./"))
        .map_err(|e| wrong(format!("the files {pattern:?}: not a pattern: {e}")))?;
    let options = MatchOptions {
        require_literal_separator: true,
        ..MatchOptions::default()
    };
    let fitting = files
        .iter()
        .filter(|path| glob.matches_path_with(path, options));
    let fitting: Vec<PathBuf> = fitting.cloned().collect();
    if fitting.is_empty() {
        return Err(wrong(format!(
            "no file {pattern:?} beside it; download the whole repository"
        )));
    }
    Ok(fitting)
}

fn is_metadata(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default();
    METADATA.iter().any(|known| name == *known)
}

/// The files of a tree without a card: metadata files, else Parquet, else the other tables, of one kind.
fn by_kind(tree: &Tree, files: Vec<PathBuf>) -> Result<Vec<PathBuf>> {
    let (metadata, others): (Vec<PathBuf>, Vec<PathBuf>) =
        files.into_iter().partition(|path| is_metadata(path));
    if !metadata.is_empty() {
        return one_kind(tree, metadata);
    }
    let (parquet, others): (Vec<PathBuf>, Vec<PathBuf>) = others
        .into_iter()
        .partition(|path| ending(path) == "parquet");
    if !parquet.is_empty() {
        return Ok(parquet);
    }
    let tables: Vec<PathBuf> = others.into_iter().filter(|path| is_table(path)).collect();
    if tables.is_empty() {
        let problem = format_args!("no file of questions in it: {READ} expected");
        return Err(Error::data(tree.place().display(), problem));
    }
    one_kind(tree, tables)
}

/// Whether a file can hold the rows of a tree without a card.
fn is_rows(path: &Path) -> bool {
    is_table(path) || ending(path) == "parquet"
}

/// Whether a file is a table of text at the top of a tree. Tables deeper in it may be anything.
fn is_table(path: &Path) -> bool {
    let own = ["dataset.json", "classes.json", "info.json"];
    let is_here = path.parent() == Some(Path::new(""));
    let is_text = matches!(&*ending(path), "tsv" | "csv" | "jsonl" | "ndjson" | "json");
    is_here && is_text && !own.iter().any(|own| path == Path::new(own))
}

/// The files, if they are of one kind.
fn one_kind(tree: &Tree, files: Vec<PathBuf>) -> Result<Vec<PathBuf>> {
    let kinds: BTreeSet<String> = files.iter().map(|path| ending(path)).collect();
    if kinds.len() == 1 {
        return Ok(files);
    }
    let names: Vec<String> = files
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    let problem = format!(
        "files of several kinds, {}; name the one that is meant: --data {}",
        names.join(", "),
        shell_word(&tree.whole(&files[0]).display().to_string())
    );
    Err(Error::data(tree.place().display(), problem))
}
