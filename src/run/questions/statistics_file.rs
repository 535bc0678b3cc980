//! The files of the statistics of frames, next to the questions: [`statistics_path`], [`parts_beside`].

use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::runs::shard::Shard;

/// How the name of each file ends.
const ENDING: &str = ".statistics.jsonl";

/// The file of a part; that of all frames for the whole.
pub(super) fn statistics_path(out: &Path, shard: Shard) -> PathBuf {
    let stem = stem(out);
    out.with_file_name(if shard.is_part() {
        format!("{stem}.{}{ENDING}", shard.folder())
    } else {
        format!("{stem}{ENDING}")
    })
}

/// The files of parts that exist, of any divisions, in order.
///
/// # Errors
/// If the folder cannot be read.
pub(super) fn parts_beside(out: &Path) -> Result<Vec<PathBuf>> {
    let folder = match out.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let begin = format!("{}.shard-", stem(out));
    let mut parts = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| Error::file(folder, "read", e))? {
        let path = entry.map_err(|e| Error::file(folder, "read", e))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with(&begin) && name.ends_with(ENDING) {
            parts.push(path);
        }
    }
    parts.sort();
    Ok(parts)
}

fn stem(out: &Path) -> String {
    let stem = out.file_stem().unwrap_or_default();
    stem.to_string_lossy().into_owned()
}
