//! Files that are written whole, or not at all: [`write()`] and [`write_synced`]; and what reading them has in common: [`reading`].

pub(crate) mod reading;

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::Path;

use crate::error::{Error, Result};

/// What the name of a file ends in until it is whole.
const UNFINISHED: &str = ".part";

/// Writes a file that can be made again: a killed process leaves the old one or the new one, a power cut may lose both.
///
/// # Errors
/// If the folder cannot be made, or the file not be written.
pub(crate) fn write(path: &Path, content: &[u8]) -> Result<()> {
    whole(path, content, |_| Ok(()))
}

/// Writes a file that is on the disk itself when this returns.
///
/// # Errors
/// If the folder cannot be made, or the file not be written.
pub(crate) fn write_synced(path: &Path, content: &[u8]) -> Result<()> {
    whole(path, content, File::sync_all)
}

/// Whether a file has the name of one that a killed process left unfinished.
pub(crate) fn is_unfinished(name: &OsStr) -> bool {
    name.to_string_lossy().ends_with(UNFINISHED)
}

// Not tempfile's `persist`: its random name leaves another file behind whenever a process is killed, and its mode shuts out the
// colleagues with whom a results folder is shared.
fn whole(path: &Path, content: &[u8], sync: impl FnOnce(&File) -> io::Result<()>) -> Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|e| Error::file(folder, "create", e))?;
    }
    let own = path.file_name().unwrap_or_default().to_string_lossy();
    let unfinished = path.with_file_name(format!(".{own}{UNFINISHED}"));
    let written = File::create(&unfinished).and_then(|mut file| {
        file.write_all(content)?;
        sync(&file)
    });
    written.map_err(|e| Error::file(&unfinished, "write", e))?;
    fs::rename(&unfinished, path).map_err(|e| Error::file(path, "write", e))
}
