//! Folders, text files, and those of one JSON object a line: [`entries`], [`text`], [`json_lines`].

use std::fs;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use crate::error::{Error, Result};

/// What lies in a folder, by name.
///
/// # Errors
/// With the folder.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let unread = |e| Error::file(folder, "read", e);
    let entries = fs::read_dir(folder).map_err(unread)?;
    let mut paths = entries
        .map(|entry| entry.map(|entry| entry.path()).map_err(unread))
        .collect::<Result<Vec<PathBuf>>>()?;
    paths.sort();
    Ok(paths)
}

/// Whether a path is a file that is named as an image.
pub(crate) fn is_image(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    path.is_file() && ["png", "jpg", "jpeg"].iter().any(|known| ending == *known)
}

/// The bytes of a file.
///
/// # Errors
/// With the file.
pub(crate) fn bytes(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).map_err(|e| Error::file(path, "read", e))
}

/// The text of a file.
///
/// # Errors
/// With the file.
pub(crate) fn text(path: &Path) -> Result<String> {
    fs::read_to_string(path).map_err(|e| Error::file(path, "read", e))
}

/// What a file of JSON says.
///
/// # Errors
/// With the file.
pub(crate) fn json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    serde_json::from_str(&text(path)?).map_err(|e| Error::data(path.display(), e))
}

/// The objects of a file with their lines, counted from 1; empty lines and a byte order mark are passed over.
///
/// # Errors
/// With the file and the line.
pub(crate) fn json_lines<T: DeserializeOwned>(path: &Path) -> Result<Vec<(usize, T)>> {
    let text = text(path)?;
    let lines = (1..).zip(text.trim_start_matches('\u{feff}').lines());
    lines
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|(number, line)| {
            let value = serde_json::from_str(line);
            let value = value.map_err(|e| Error::json_line(path, number, &e))?;
            Ok((number, value))
        })
        .collect()
}
