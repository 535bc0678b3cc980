//! Finds the files of a set in a folder, a downloaded repository, a ZIP file, a pattern or a file: [`find_files`].
//!
//! Shards of a set: [`check_shards`], [`single_shard_note`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::archive::Archive;
use super::choose::{choose_files, is_set};
use super::tree::Tree;
use super::{SetFile, extension, is_zip_file};
use crate::ready_made::settings::SetArgs;
use crate::root::{Location, Root};
use darkqa_base::error::{Error, Result};

/// Files of a set, and the folders that may have its images.
#[derive(Debug)]
pub(crate) struct FoundFiles {
    pub files: Vec<SetFile>,
    /// Folder of the set.
    pub folder: PathBuf,
    /// Further folders that paths may lead to: the files of a hub's cache, or the folders of further `--data` files.
    pub further: Vec<PathBuf>,
    /// ZIP file of the set.
    pub archive: Option<Arc<Archive>>,
    /// Notes about skipped or missing files.
    pub notes: Vec<String>,
    pub joined: FileRelation,
}

/// Relation of several files to each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FileRelation {
    /// Parts of one table, which must have the same columns.
    OneTable,
    /// Files of a folder or a ZIP file, which may have different columns.
    Folder,
}

/// True if a folder has a ready-made set, or cannot be scanned.
pub fn is_set_folder(folder: &Path) -> bool {
    let Ok(tree) = Tree::from_folder(folder) else {
        return true;
    };
    tree.files().is_ok_and(|(files, _)| is_set(&tree, &files))
}

/// Finds the files of a set.
///
/// # Errors
/// If there are none, or it is not clear which to use; the error lists the files.
pub(crate) fn find_files(places: &[PathBuf], args: &SetArgs) -> Result<FoundFiles> {
    match places {
        [place] => files_at(place, args),
        places => named_files(places, args),
    }
}

/// Opens several files given by the user, in this order.
fn named_files(places: &[PathBuf], args: &SetArgs) -> Result<FoundFiles> {
    refuse_choice("several files", args)?;
    let mut files = Vec::with_capacity(places.len());
    for place in places {
        if !place.is_file() || extension(place) == "zip" {
            let problem =
                format_args!("{}: no file of questions; several --data name the files of one set", place.display());
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
        notes: check_shards(places).err().map(|e| e.to_string()).into_iter().collect(),
        joined: FileRelation::OneTable,
    })
}

/// Folder of a file; `.` for a bare file name.
fn folder_of(file: &Path) -> PathBuf {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// Refuses the flags that choose files of a folder.
fn refuse_choice(text: &str, args: &SetArgs) -> Result<()> {
    for (flag, value) in [("--read config", &args.config_name), ("--read split", &args.split)] {
        if let Some(value) = value {
            let problem = format_args!("{text} is not a folder from which {value:?} could be chosen");
            return Err(Error::usage(flag, problem));
        }
    }
    Ok(())
}

/// Finds the files of a folder, a ZIP file, a file or a pattern.
fn files_at(place: &Path, args: &SetArgs) -> Result<FoundFiles> {
    if place.is_dir() {
        return files_in_tree(&Tree::from_folder(place)?, args);
    }
    let text = place.to_string_lossy();
    if !place.is_file() && !text.contains(['*', '?', '[']) {
        let problem = format_args!("{text}: no such file or folder");
        return Err(Error::usage("--data", problem));
    }
    if is_zip_file(place) {
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
            joined: FileRelation::OneTable,
            notes: single_shard_note(place).into_iter().collect(),
        });
    }
    matching_files(place, &text, args)
}

/// Files that match a pattern. Links out of the folder before its first wildcard are skipped; a warning names the
/// first.
fn matching_files(place: &Path, text: &str, args: &SetArgs) -> Result<FoundFiles> {
    let paths = glob::glob(text).map_err(|e| Error::usage("--data", format_args!("{text}: not a pattern: {e}")))?;
    let folder: PathBuf = place.iter().take_while(|part| !part.to_string_lossy().contains(['*', '?', '['])).collect();
    let root = Root::new(&folder, &args.root.data_root)?;
    let mut links_out = Vec::new();
    let mut files = Vec::new();
    for path in paths.filter_map(std::result::Result::ok) {
        match root.locate(&path) {
            Location::Inside if path.is_file() => files.push(path),
            Location::Outside => links_out.push(path),
            Location::Inside | Location::Missing => {}
        }
    }
    root.warn_of_links_out(&links_out);
    if files.is_empty() {
        return Err(Error::usage("--data", format_args!("{text}: no file has such a name")));
    }
    check_shards(&files)?;
    Ok(FoundFiles {
        files: files.into_iter().map(|path| SetFile::open(path, String::new())).collect::<Result<_>>()?,
        folder,
        further: Vec::new(),
        archive: None,
        joined: FileRelation::OneTable,
        notes: Vec::new(),
    })
}

/// Files of a folder or a ZIP file.
fn files_in_tree(tree: &Tree, args: &SetArgs) -> Result<FoundFiles> {
    let (all, outside) = tree.files()?;
    let (chosen, card_note) = choose_files(tree, all, args)?;
    let paths: Vec<PathBuf> = chosen.iter().map(|file| tree.full_path(&file.path)).collect();
    check_shards(&paths)?;
    let files = chosen.into_iter().map(|file| tree.open(&file.path, file.config)).collect::<Result<_>>()?;
    let link_note = outside.first().map(|first| {
        format!(
            "links that lead out of the folder or nowhere, and were skipped: {}, as {}",
            outside.len(),
            first.display()
        )
    });
    let notes = link_note.into_iter().chain(card_note).collect();
    Ok(match tree {
        Tree::Folder { folder, blobs } => FoundFiles {
            files,
            folder: folder.clone(),
            further: blobs.iter().cloned().collect(),
            joined: FileRelation::Folder,
            archive: None,
            notes,
        },
        Tree::Archive(archive) => FoundFiles {
            files,
            folder: archive.path.parent().unwrap_or(Path::new("")).to_owned(),
            further: Vec::new(),
            joined: FileRelation::Folder,
            archive: Some(Arc::clone(archive)),
            notes,
        },
    })
}

/// Parts of the path of a shard, such as `test-00000-of-00003.parquet`.
struct ShardPath {
    /// Path up to the number of the shard.
    name: String,
    /// Number of the shard, counted from 0.
    number: usize,
    /// Number of all shards.
    count: usize,
}

impl ShardPath {
    /// Parses a path; `None` if it is not the path of a shard.
    fn parse(path: &Path) -> Option<Self> {
        let stem = path.file_stem()?.to_str()?;
        let (head, count) = stem.rsplit_once("-of-")?;
        let (name, number) = head.rsplit_once('-')?;
        // The extension `.jsonl.gz` leaves `.jsonl` in the stem.
        let count: String = count.chars().take_while(char::is_ascii_digit).collect();
        Some(Self {
            name: path.with_file_name(name).display().to_string(),
            number: number.parse().ok()?,
            count: count.parse().ok()?,
        })
    }
}

/// Checks that no shard is missing.
fn check_shards(files: &[PathBuf]) -> Result<()> {
    let mut found: BTreeMap<(String, usize), BTreeSet<usize>> = BTreeMap::new();
    for shard in files.iter().filter_map(|path| ShardPath::parse(path)) {
        found.entry((shard.name, shard.count)).or_default().insert(shard.number);
    }
    for ((name, count), numbers) in found {
        if let Some(missing) = (0..count).find(|number| !numbers.contains(number)) {
            let problem = format_args!(
                "{} of {count} shards are there; number {missing} is missing: download it, or name the files that are meant",
                numbers.len()
            );
            return Err(Error::data(name, problem));
        }
    }
    Ok(())
}

/// Note about a file that is one of several shards.
fn single_shard_note(path: &Path) -> Option<String> {
    let ShardPath { number, count, .. } = ShardPath::parse(path)?;
    (count > 1).then(|| format!("shard {number} of {count} alone is read, as it was named"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(numbers: &[usize]) -> Vec<PathBuf> {
        numbers.iter().map(|n| PathBuf::from(format!("d/test-0000{n}-of-00003.jsonl.gz"))).collect::<Vec<PathBuf>>()
    }

    #[test]
    fn missing_shard_is_an_error() {
        assert!(check_shards(&files(&[0, 1, 2])).is_ok());
        let problem = check_shards(&files(&[0, 2])).unwrap_err().to_string();
        assert!(problem.contains("2 of 3 shards are there; number 1 is missing"), "{problem}");
        assert_eq!(single_shard_note(Path::new("a-00000-of-00001.parquet")), None);
        assert!(single_shard_note(Path::new("a-00000-of-00002.parquet")).is_some());
    }
}
