//! Readers of folders ([`entries`]), text files ([`text`]) and files of one JSON object a line ([`json_lines`]).

use std::fs;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use crate::error::{Error, Result};

/// The paths in a folder, sorted by name.
///
/// # Errors
/// If the folder cannot be read.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let unreadable = |e| Error::file(folder, "read", e);
    let entries = fs::read_dir(folder).map_err(unreadable)?;
    let mut paths = entries
        .map(|entry| entry.map(|entry| entry.path()).map_err(unreadable))
        .collect::<Result<Vec<PathBuf>>>()?;
    paths.sort();
    Ok(paths)
}

/// The bytes of a file.
///
/// # Errors
/// If the file cannot be read.
pub(crate) fn bytes(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).map_err(|e| Error::file(path, "read", e))
}

/// The text of a file.
///
/// # Errors
/// If the file cannot be read or is not UTF-8.
pub(crate) fn text(path: &Path) -> Result<String> {
    fs::read_to_string(path).map_err(|e| Error::file(path, "read", e))
}

/// The value in a JSON file.
///
/// # Errors
/// If the file cannot be read or does not hold such a value.
pub(crate) fn json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    serde_json::from_str(&text(path)?).map_err(|e| Error::data(path.display(), e))
}

/// The objects of a file with their line numbers, counted from 1; empty lines and a byte order mark are skipped.
///
/// # Errors
/// If the file cannot be read or a line does not hold such an object; the error names the line.
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
