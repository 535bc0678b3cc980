//! Paths of the files with frame statistics, next to the questions: [`statistics_path`], [`shard_files`].

use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::runs::shard::Shard;

/// Suffix of the file names.
const SUFFIX: &str = ".statistics.jsonl";

/// The file of a shard, or of all frames.
pub(super) fn statistics_path(out: &Path, shard: Shard) -> PathBuf {
    let stem = stem(out);
    out.with_file_name(if shard.is_part() {
        format!("{stem}.{}{SUFFIX}", shard.folder())
    } else {
        format!("{stem}{SUFFIX}")
    })
}

/// The existing files of shards, of any number of shards, sorted.
///
/// # Errors
/// If the folder cannot be read.
pub(super) fn shard_files(out: &Path) -> Result<Vec<PathBuf>> {
    let folder = match out.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let prefix = format!("{}.shard-", stem(out));
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| Error::file(folder, "read", e))? {
        let path = entry.map_err(|e| Error::file(folder, "read", e))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with(&prefix) && name.ends_with(SUFFIX) {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn stem(out: &Path) -> String {
    let stem = out.file_stem().unwrap_or_default();
    stem.to_string_lossy().into_owned()
}
