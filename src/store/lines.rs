//! Files of one JSON object a line. A killed process may leave the last line incomplete.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::{Error, Result};
use crate::types::{Detail, ImageFidelity, Record, RunQuestion, Thumbnail};

/// Appends lines to a file, which is created if it does not exist.
pub(super) fn append<T: Serialize>(path: &Path, values: &[T]) -> Result<File> {
    let lines = json_lines(path, values)?;
    let file = OpenOptions::new()
        .read(true)
        .append(true)
        .create(true)
        .open(path);
    let written = file.and_then(|mut file| {
        repair(path, &file).map_err(std::io::Error::other)?;
        file.write_all(&lines)?;
        Ok(file)
    });
    written.map_err(|e| Error::file(path, "write", e))
}

pub(super) fn json_lines<T: Serialize>(path: &Path, values: &[T]) -> Result<Vec<u8>> {
    let mut lines = Vec::new();
    for value in values {
        serde_json::to_writer(&mut lines, value)
            .map_err(|e| Error::file(path, "write", e.into()))?;
        lines.push(b'\n');
    }
    Ok(lines)
}

/// The complete lines of a file of a run; none if there is no such file.
pub(super) fn lines<T: StoredLine>(path: &Path) -> Result<Vec<T>> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(e) => return Err(Error::file(path, "read", e)),
    };
    let mut values = Vec::new();
    let mut file = BufReader::new(file);
    let mut line = Vec::new();
    for number in 1.. {
        line.clear();
        file.read_until(b'\n', &mut line)
            .map_err(|e| Error::file(path, "read", e))?;
        if line.pop() != Some(b'\n') {
            break;
        }
        values.push(serde_json::from_slice(&line).map_err(|e| {
            let problem = format!(
                "not {}: {e}; restore the file, or use another --out",
                T::WHAT
            );
            Error::line(path, number, problem)
        })?);
    }
    Ok(values)
}

/// The content of one line in a file of a run.
pub(super) trait StoredLine: DeserializeOwned {
    /// The name in error messages, with its article.
    const WHAT: &str;
}

impl<D: Detail> StoredLine for Record<D> {
    const WHAT: &str = "a record";
}

impl StoredLine for RunQuestion {
    const WHAT: &str = "a question";
}

impl StoredLine for Thumbnail {
    const WHAT: &str = "a thumbnail";
}

impl StoredLine for ImageFidelity {
    const WHAT: &str = "the fidelity of an image";
}

/// Cuts off an incomplete last line: everything after the last line end.
pub(super) fn repair(path: &Path, mut file: &File) -> Result<()> {
    const STEP: u64 = 64 * 1024;
    let unreadable = |e| Error::file(path, "read", e);
    let length = file.metadata().map_err(unreadable)?.len();
    let (mut end, mut complete) = (length, 0);
    while end > 0 && complete == 0 {
        let start = end.saturating_sub(STEP);
        let mut chunk = vec![0; (end - start) as usize];
        file.seek(SeekFrom::Start(start)).map_err(unreadable)?;
        file.read_exact(&mut chunk).map_err(unreadable)?;
        complete = chunk
            .iter()
            .rposition(|&byte| byte == b'\n')
            .map_or(0, |at| start + at as u64 + 1);
        end = start;
    }
    if complete == length {
        return Ok(());
    }
    tracing::warn!(
        "{}: the last line was incomplete and has been removed; its trial is asked again",
        path.display()
    );
    file.set_len(complete)
        .map_err(|e| Error::file(path, "write", e))
}
