//! Files that are written completely or not at all, by [`write()`] and [`write_synced`]; and helpers to read files, in [`reading`].

pub(crate) mod reading;

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::Path;

use crate::error::{Error, Result};

/// The ending of a file's name until the file is complete.
pub(crate) const UNFINISHED: &str = ".part";

/// Writes a file that can be made again: a killed process leaves the old or the new one, a power cut may lose both.
///
/// # Errors
/// If the folder cannot be created or the file cannot be written.
pub(crate) fn write(path: &Path, content: &[u8]) -> Result<()> {
    replace(path, content, |_| Ok(()))
}

/// Writes a file and forces it to the disk before it returns.
///
/// # Errors
/// If the folder cannot be created or the file cannot be written.
pub(crate) fn write_synced(path: &Path, content: &[u8]) -> Result<()> {
    replace(path, content, File::sync_all)
}

/// Whether a name is that of an unfinished file, which a killed process leaves behind.
pub(crate) fn is_unfinished(name: &OsStr) -> bool {
    name.to_string_lossy().ends_with(UNFINISHED)
}

// tempfile's `persist` is not used: its random name leaves a further file after each killed process, and its file mode denies
// access to colleagues who share a results folder.
fn replace(path: &Path, content: &[u8], sync: impl FnOnce(&File) -> io::Result<()>) -> Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|e| Error::file(folder, "create", e))?;
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let unfinished = path.with_file_name(format!(".{name}{UNFINISHED}"));
    let written = File::create(&unfinished).and_then(|mut file| {
        file.write_all(content)?;
        sync(&file)
    });
    written.map_err(|e| Error::file(&unfinished, "write", e))?;
    fs::rename(&unfinished, path).map_err(|e| Error::file(path, "write", e))
}
