//! Files that are written completely or not at all, by [`write()`] and [`write_synced`]; and helpers to read files, in
//! [`reading`].

pub mod folder_access;
pub mod guarded;
pub mod reading;

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, BufWriter, Write as _};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// The ending of a file's name until the file is complete.
pub const UNFINISHED: &str = ".part";

/// Writes a file that can be regenerated: a killed process leaves the old or the new content, a power cut may lose
/// both.
///
/// # Errors
/// If the folder cannot be created or the file cannot be written.
pub fn write(path: &Path, content: &[u8]) -> Result<()> {
    replace(path, content, |_| Ok(()))
}

/// Writes a file and forces it to the disk before it returns.
///
/// # Errors
/// If the folder cannot be created or the file cannot be written.
pub fn write_synced(path: &Path, content: &[u8]) -> Result<()> {
    replace(path, content, File::sync_all)
}

/// True for the name of an unfinished file, which a killed process may leave behind.
pub fn is_unfinished(name: &OsStr) -> bool {
    name.to_string_lossy().ends_with(UNFINISHED)
}

/// Writes a file through `write`, and forces it to the disk before it returns. A file with the same content is left
/// untouched.
///
/// # Errors
/// If the folder cannot be created, the file cannot be written, or `write` fails.
pub fn write_with(path: &Path, write: impl FnOnce(&mut dyn io::Write) -> Result<()>) -> Result<()> {
    create_folder(path)?;
    let unfinished = unfinished(path);
    let mut file = create_new(&unfinished).map(BufWriter::new).map_err(|e| Error::file(&unfinished, "write", e))?;
    write(&mut file)?;
    file.flush().and_then(|()| file.get_ref().sync_all()).map_err(|e| Error::file(&unfinished, "write", e))?;
    drop(file);
    if has_same_content(path, &unfinished).unwrap_or(false) {
        return fs::remove_file(&unfinished).map_err(|e| Error::file(&unfinished, "write", e));
    }
    fs::rename(&unfinished, path).map_err(|e| Error::file(path, "write", e))
}

fn has_same_content(one: &Path, other: &Path) -> io::Result<bool> {
    if fs::metadata(one)?.len() != fs::metadata(other)?.len() {
        return Ok(false);
    }
    let [mut one, mut other] = [BufReader::new(File::open(one)?), BufReader::new(File::open(other)?)];
    loop {
        let (a, b) = (one.fill_buf()?, other.fill_buf()?);
        let length = a.len().min(b.len());
        if length == 0 {
            return Ok(a.len() == b.len());
        }
        if a[..length] != b[..length] {
            return Ok(false);
        }
        one.consume(length);
        other.consume(length);
    }
}

/// The temporary path of a file until it is complete: a hidden file in the same folder.
pub fn unfinished(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}{UNFINISHED}"))
}

/// Creates an empty file, in place of a file that a killed process left there. A link at the path is replaced, not
/// followed.
///
/// # Errors
/// If the path is a folder, or the file cannot be created.
pub fn create_new(path: &Path) -> io::Result<File> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
        _ => {}
    }
    File::options().write(true).create_new(true).open(path)
}

fn create_folder(path: &Path) -> Result<()> {
    match path.parent() {
        Some(folder) => fs::create_dir_all(folder).map_err(|e| Error::file(folder, "create", e)),
        None => Ok(()),
    }
}

// tempfile's `persist` is not used: its random name leaves a further file after each killed process, and its file mode
// denies access to colleagues who share a results folder.
fn replace(path: &Path, content: &[u8], sync: impl FnOnce(&File) -> io::Result<()>) -> Result<()> {
    create_folder(path)?;
    let unfinished = unfinished(path);
    create_new(&unfinished)
        .and_then(|mut file| {
            file.write_all(content)?;
            sync(&file)
        })
        .map_err(|e| Error::file(&unfinished, "write", e))?;
    fs::rename(&unfinished, path).map_err(|e| Error::file(path, "write", e))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn links_are_replaced_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let [private, link] = ["private", "new.part"].map(|name| folder.path().join(name));
        fs::write(&private, "private").unwrap();
        std::os::unix::fs::symlink(&private, &link).unwrap();
        let mut file = create_new(&link).unwrap();
        file.write_all(b"new").unwrap();
        assert_eq!(fs::read(&private).unwrap(), b"private");
        assert_eq!(fs::read(&link).unwrap(), b"new");
        assert!(!link.is_symlink());
    }
}
