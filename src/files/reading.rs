//! Readers of folders ([`entries`]), files ([`open`]), text files ([`text`]) and files of one JSON object a line ([`json_lines`]).

use std::fs::{self, File};
use std::io::{self, Read as _};
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

/// Opens a file to read it. A pipe or a device in the place of a file is refused: it may have no end, or wait for ever. It is opened
/// where the path itself lies in `/dev` or `/proc`, as `/dev/stdin` and what a shell writes for `<(command)`.
///
/// # Errors
/// If the file cannot be opened.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    let kind = fs::metadata(path)?.file_type();
    let is_named = path.starts_with("/dev") || path.starts_with("/proc");
    if kind.is_file() || kind.is_dir() || is_named {
        return File::open(path);
    }
    let problem = "a pipe or a device stands in the place of a file; put a file there";
    Err(io::Error::new(io::ErrorKind::InvalidInput, problem))
}

/// The bytes of a file that [`open`] opens.
///
/// # Errors
/// If the file cannot be read.
pub(crate) fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    // The standard library reserves the length of the file.
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The text of a file that [`open`] opens.
///
/// # Errors
/// If the file cannot be read or is not UTF-8.
pub(crate) fn read_to_string(path: &Path) -> io::Result<String> {
    io::read_to_string(open(path)?)
}

/// The bytes of a file.
///
/// # Errors
/// If the file cannot be read.
pub(crate) fn bytes(path: &Path) -> Result<Vec<u8>> {
    read(path).map_err(|e| Error::file(path, "read", e))
}

/// The text of a file.
///
/// # Errors
/// If the file cannot be read or is not UTF-8.
pub(crate) fn text(path: &Path) -> Result<String> {
    read_to_string(path).map_err(|e| Error::file(path, "read", e))
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
