//! Readers of folders ([`entries`]), files ([`open`]), text files ([`text`], [`settings`]) and files of one JSON object
//! a line ([`json_lines`]).
//!
//! Each reader has a size limit and refuses pipes and devices: a downloaded data set may contain a link to `/dev/zero`,
//! which would fill the memory, or a pipe, which would block for ever.

use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use crate::error::{Error, Result};

/// Size limit of a settings file, in bytes. Chosen: people write a few kilobytes.
const MAX_SETTINGS_BYTES: u64 = 1 << 20;

/// Size limit of one line of JSON, in bytes. Chosen: a question with its choices has less than a kilobyte.
const MAX_LINE_BYTES: u64 = 4 << 20;

/// Size limit of any other file that is read at once, in bytes. Chosen: the largest published lists of questions have a
/// tenth of it.
const MAX_BYTES: u64 = 1 << 30;

/// Error message for text in UTF-16 or an older encoding.
pub const NOT_UTF8: &str = "not UTF-8; save the file as UTF-8";

/// The paths in a folder, sorted by name.
///
/// # Errors
/// If the folder cannot be read.
pub fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = fs::read_dir(folder)
        .and_then(|entries| entries.map(|entry| entry.map(|entry| entry.path())).collect::<io::Result<Vec<PathBuf>>>())
        .map_err(|e| Error::file(folder, "read", e))?;
    paths.sort();
    Ok(paths)
}

/// Opens a file for reading. Pipes and devices are refused, because they may never end or block for ever, unless the
/// path itself is in `/dev` or `/proc`: `/dev/stdin`, or the shell's `<(command)`.
///
/// # Errors
/// If the file cannot be opened.
pub fn open(path: &Path) -> io::Result<File> {
    refuse_pipes(path)?;
    File::open(path)
}

/// Checks a path as [`open`] does, for callers that open the file in another way.
///
/// # Errors
/// If the path is a pipe or a device, or does not exist.
pub fn refuse_pipes(path: &Path) -> io::Result<()> {
    let kind = fs::metadata(path)?.file_type();
    let is_named = path.starts_with("/dev") || path.starts_with("/proc");
    if kind.is_file() || kind.is_dir() || is_named {
        return Ok(());
    }
    let problem = "this is a pipe or a device, not a file; put a file there";
    Err(io::Error::new(io::ErrorKind::InvalidInput, problem))
}

/// The bytes of a file that [`open`] opens.
///
/// # Errors
/// If the file cannot be read, or is larger than 1 GB.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    read_at_most(path, MAX_BYTES)
}

/// The text of a file that [`open`] opens.
///
/// # Errors
/// If the file cannot be read, is larger than 1 GB, or is not UTF-8.
pub fn read_to_string(path: &Path) -> io::Result<String> {
    read(path).and_then(utf8)
}

fn read_at_most(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = open(path)?;
    let length = file.metadata()?.len();
    // The length is checked before memory is reserved: a sparse file takes little room on the disk but all of it in
    // memory.
    if length > most {
        return Err(too_large(most));
    }
    let mut bytes = Vec::with_capacity(length as usize);
    if file.take(most + 1).read_to_end(&mut bytes)? as u64 > most {
        return Err(too_large(most));
    }
    Ok(bytes)
}

fn too_large(most: u64) -> io::Error {
    let problem = format!("larger than {most} bytes, which no file of its kind needs");
    io::Error::new(io::ErrorKind::InvalidData, problem)
}

fn utf8(bytes: Vec<u8>) -> io::Result<String> {
    String::from_utf8(bytes).map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))
}

/// The bytes of a file.
///
/// # Errors
/// If the file cannot be read, or is larger than 1 GB.
pub fn bytes(path: &Path) -> Result<Vec<u8>> {
    at_most(path, MAX_BYTES)
}

/// The text of a file.
///
/// # Errors
/// If the file cannot be read, is larger than 1 GB, or is not UTF-8.
pub fn text(path: &Path) -> Result<String> {
    read_to_string(path).map_err(|e| Error::file(path, "read", e))
}

/// The text of a settings file.
///
/// # Errors
/// If the file cannot be read, is larger than 1 MB, or is not UTF-8.
pub fn settings(path: &Path) -> Result<String> {
    read_at_most(path, MAX_SETTINGS_BYTES).and_then(utf8).map_err(|e| Error::file(path, "read", e))
}

/// Reads a file of at most `most` bytes.
///
/// # Errors
/// If the file cannot be read or is larger.
pub fn at_most(path: &Path, most: u64) -> Result<Vec<u8>> {
    read_at_most(path, most).map_err(|e| Error::file(path, "read", e))
}

/// The value in a JSON file.
///
/// # Errors
/// If the file cannot be read or does not hold such a value.
pub fn json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    serde_json::from_str(&text(path)?).map_err(|e| Error::data(path.display(), e))
}

/// Error message for text that is not JSON because it is not UTF-8, or has a `NaN` or `Infinity`, as Python writes
/// them; `None` for other faults.
#[must_use]
pub fn json_problem(bytes: &[u8], error: &serde_json::Error) -> Option<&'static str> {
    if str::from_utf8(bytes).is_err() {
        return Some(NOT_UTF8);
    }
    let line = bytes.split(|byte| *byte == b'\n').nth(error.line() - 1)?;
    let rest = line.get(error.column().saturating_sub(1)..)?;
    let rest = rest.strip_prefix(b"-").unwrap_or(rest);
    (rest.starts_with(b"NaN") || rest.starts_with(b"Infinity"))
        .then_some("NaN or Infinity, which JSON does not have; write null in its place")
}

/// The objects of a file with their line numbers, counted from 1; empty lines and a byte order mark are skipped.
///
/// # Errors
/// If the file cannot be read, or a line is longer than 4 MB or does not hold such an object; the error names the line.
pub fn json_lines<T: DeserializeOwned>(path: &Path) -> Result<Vec<(usize, T)>> {
    let mut file = open(path).map(BufReader::new).map_err(|e| Error::file(path, "read", e))?;
    let (mut values, mut line) = (Vec::new(), Vec::new());
    for number in 1.. {
        line.clear();
        let read = (&mut file)
            .take(MAX_LINE_BYTES + 1)
            .read_until(b'\n', &mut line)
            .map_err(|e| Error::file(path, "read", e))?;
        if read == 0 {
            break;
        }
        if line.len() as u64 > MAX_LINE_BYTES {
            let problem = format!("longer than {MAX_LINE_BYTES} bytes, which no line of its kind needs");
            return Err(Error::line(path, number, problem));
        }
        let text = match number {
            1 => line.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&line),
            _ => &line[..],
        };
        if !text.trim_ascii().is_empty() {
            let value = serde_json::from_slice(text.trim_ascii_end()).map_err(|e| match json_problem(text, &e) {
                Some(problem) => Error::line(path, number, problem),
                None => Error::json_line(path, number, &e),
            })?;
            values.push((number, value));
        }
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_name_the_file_and_its_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("list.jsonl");
        let text = format!("\u{feff}1\n\n  2 \r\n{}3\n", " ".repeat(MAX_LINE_BYTES as usize));
        fs::write(&path, &text).unwrap();
        let error = json_lines::<u8>(&path).unwrap_err().to_string();
        assert!(error.contains("line 4: longer than 4194304 bytes"), "{error}");
        fs::write(&path, text.trim_end_matches(['3', '\n', ' '])).unwrap();
        assert_eq!(json_lines::<u8>(&path).unwrap(), [(1, 1), (3, 2)]);
        assert!(settings(&path).is_ok());
        fs::write(&path, "1\nNaN\n").unwrap();
        let error = json_lines::<u8>(&path).unwrap_err().to_string();
        assert!(error.contains("line 2: NaN or Infinity, which JSON does not have"), "{error}");
        fs::write(&path, b"\xFF\xFE1\0\n\0").unwrap();
        let error = json_lines::<u8>(&path).unwrap_err().to_string();
        assert!(error.ends_with("line 1: not UTF-8; save the file as UTF-8"), "{error}");
        fs::write(&path, vec![b' '; 1 + MAX_SETTINGS_BYTES as usize]).unwrap();
        let error = settings(&path).unwrap_err().to_string();
        assert!(error.contains("list.jsonl") && error.contains("larger than 1048576 bytes"), "{error}");
        fs::write(&path, b"\xff").unwrap();
        let error = super::text(&path).unwrap_err().to_string();
        assert!(error.to_lowercase().contains("utf-8"), "{error}");
    }
}
