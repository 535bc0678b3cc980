//! The files of a set in a folder, a repository of a hub on disk, a ZIP file, a pattern or a file: [`find_files`].

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::archive::Archive;
use super::choose::{chosen, is_set};
use super::shards::{check_shards, shard_alone};
use super::tree::Tree;
use super::{SetFile, ending};
use crate::dataset::ready_made::settings::SetArgs;
use crate::error::{Error, Result};

/// The files of a set, and the folders that the files they name may lie in.
#[derive(Debug)]
pub(in crate::dataset::ready_made) struct FoundFiles {
    pub(in crate::dataset::ready_made) files: Vec<SetFile>,
    /// The folder of the set.
    pub(in crate::dataset::ready_made) folder: PathBuf,
    /// Folders outside it in which files may lie: into which the links of a hub's cache lead, or which hold further files of the user.
    pub(in crate::dataset::ready_made) further: Vec<PathBuf>,
    /// The ZIP file that holds the set.
    pub(in crate::dataset::ready_made) archive: Option<Arc<Archive>>,
    /// Files that were left out, in words.
    pub(in crate::dataset::ready_made) notes: Vec<String>,
    pub(in crate::dataset::ready_made) joined: Joined,
}

/// The relation of several files to each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::dataset::ready_made) enum Joined {
    /// Parts of one table, with the same columns.
    OneTable,
    /// Files of a folder, as its makers laid them.
    Folder,
}

/// Whether a folder holds a set of other tools.
pub(in crate::dataset) fn is_set_folder(folder: &Path) -> bool {
    let Ok(tree) = Tree::from_folder(folder) else {
        return true;
    };
    tree.files().is_ok_and(|(files, _)| is_set(&tree, &files))
}

/// The files at a place.
///
/// # Errors
/// If there are none, or it is not clear which are meant; the error lists the files.
pub(in crate::dataset::ready_made) fn find_files(
    places: &[PathBuf],
    args: &SetArgs,
) -> Result<FoundFiles> {
    match places {
        [place] => at_place(place, args),
        places => named_files(places, args),
    }
}

/// Several files that the user names, in this order.
fn named_files(places: &[PathBuf], args: &SetArgs) -> Result<FoundFiles> {
    refuse_choice("several files", args)?;
    let mut files = Vec::with_capacity(places.len());
    for place in places {
        if !place.is_file() || ending(place) == "zip" {
            let problem = format_args!(
                "{}: no file of questions; several --data name the files of one set",
                place.display()
            );
            return Err(Error::usage("--data", problem));
        }
        if places.iter().filter(|other| *other == place).count() > 1 {
            let problem = format_args!("{} is named twice", place.display());
            return Err(Error::usage("--data", problem));
        }
        files.push(SetFile::open(place.clone(), String::new())?);
    }
    let mut folders = places.iter().map(|place| folder_of(place));
    Ok(FoundFiles {
        files,
        folder: folders.next().unwrap_or_default(),
        further: folders.collect(),
        archive: None,
        notes: check_shards(places)
            .err()
            .map(|e| e.to_string())
            .into_iter()
            .collect(),
        joined: Joined::OneTable,
    })
}

/// The folder of a file, which may be the current one.
fn folder_of(file: &Path) -> PathBuf {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// Refuses flags that choose among the files of a folder.
fn refuse_choice(text: &str, args: &SetArgs) -> Result<()> {
    for (flag, value) in [
        ("--read config", &args.config_name),
        ("--read split", &args.split),
    ] {
        if let Some(value) = value {
            let problem =
                format_args!("{text} is not a folder from which {value:?} could be chosen");
            return Err(Error::usage(flag, problem));
        }
    }
    Ok(())
}

fn at_place(place: &Path, args: &SetArgs) -> Result<FoundFiles> {
    if place.is_dir() {
        return files_in_tree(&Tree::from_folder(place)?, args);
    }
    let text = place.to_string_lossy();
    if !place.is_file() && !text.contains(['*', '?', '[']) {
        let problem = format_args!("{text}: no such file or folder");
        return Err(Error::usage("--data", problem));
    }
    if place.is_file() && ending(place) == "zip" {
        let archive = Arc::new(Archive::open(place)?);
        return files_in_tree(&Tree::Archive(archive), args);
    }
    refuse_choice(&text, args)?;
    if place.is_file() {
        return Ok(FoundFiles {
            files: vec![SetFile::open(place.to_owned(), String::new())?],
            folder: place.parent().unwrap_or(Path::new("")).to_owned(),
            further: Vec::new(),
            archive: None,
            joined: Joined::OneTable,
            notes: shard_alone(place).into_iter().collect(),
        });
    }
    matching_files(place, &text)
}

/// The files whose names fit a pattern.
fn matching_files(place: &Path, text: &str) -> Result<FoundFiles> {
    let wrong = |problem: String| Error::usage("--data", format_args!("{text}: {problem}"));
    let paths = glob::glob(text).map_err(|e| wrong(format!("not a pattern: {e}")))?;
    let files: Vec<PathBuf> = paths
        .filter_map(std::result::Result::ok)
        .filter(|path| path.is_file())
        .collect();
    if files.is_empty() {
        return Err(wrong("no file has such a name".to_owned()));
    }
    check_shards(&files)?;
    let wild = |part: &&std::ffi::OsStr| part.to_string_lossy().contains(['*', '?', '[']);
    let folder = place.iter().take_while(|part| !wild(part)).collect();
    let files = files
        .into_iter()
        .map(|path| SetFile::open(path, String::new()));
    Ok(FoundFiles {
        files: files.collect::<Result<_>>()?,
        folder,
        further: Vec::new(),
        archive: None,
        joined: Joined::OneTable,
        notes: Vec::new(),
    })
}

/// The files of a tree.
fn files_in_tree(tree: &Tree, args: &SetArgs) -> Result<FoundFiles> {
    let (all, outside) = tree.files()?;
    let (chosen, card) = chosen(tree, all, args)?;
    let paths: Vec<PathBuf> = chosen.iter().map(|file| tree.whole(&file.path)).collect();
    check_shards(&paths)?;
    let files = chosen
        .into_iter()
        .map(|file| tree.open(&file.path, file.config))
        .collect::<Result<_>>()?;
    let notes = outside.first().map(|first| {
        format!(
            "links that lead out of the folder or nowhere, and were skipped: {}, as {}",
            outside.len(),
            first.display()
        )
    });
    let notes = notes.into_iter().chain(card).collect();
    Ok(match tree {
        Tree::Folder { folder, blobs } => FoundFiles {
            files,
            folder: folder.clone(),
            further: blobs.iter().cloned().collect(),
            joined: Joined::Folder,
            archive: None,
            notes,
        },
        Tree::Archive(archive) => FoundFiles {
            files,
            folder: archive.path.parent().unwrap_or(Path::new("")).to_owned(),
            further: Vec::new(),
            joined: Joined::Folder,
            archive: Some(Arc::clone(archive)),
            notes,
        },
    })
}
