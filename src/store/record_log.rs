//! The records of a run by their places in its file, so that none is held: [`RecordLog`].

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::folder::{QUESTIONS, RECORDS};
use super::lines::each_placed_line;
use super::pieces::LinePlace;
use crate::error::{Error, Result};
use crate::types::{Detail, Record};

/// The bytes that are read at once for a single line. Chosen: most lines are shorter.
const LINE_BYTES: usize = 2048;

/// The file of a run's records, to read single ones.
#[derive(Debug)]
pub(crate) struct RecordLog {
    path: PathBuf,
    file: File,
}

impl RecordLog {
    /// Opens the records of a run folder.
    ///
    /// # Errors
    /// If there are none.
    pub(crate) fn open(folder: &Path) -> Result<Self> {
        let path = folder.join(RECORDS);
        let file = File::open(&path).map_err(|e| Error::file(&path, "open", e))?;
        Ok(Self { path, file })
    }

    /// Opens the records of a run folder; `None` if there are none.
    ///
    /// # Errors
    /// If they cannot be opened.
    pub(crate) fn open_if_there(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(RECORDS);
        match File::open(&path) {
            Ok(file) => Ok(Some(Self { path, file })),
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
            Err(e) => Err(Error::file(path, "open", e)),
        }
    }

    /// The line that begins at a place, with its end.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub(crate) fn line_from(&self, start: u64) -> Result<Vec<u8>> {
        let mut file = &self.file;
        let line = file.seek(SeekFrom::Start(start)).and_then(|_| {
            let mut line = Vec::new();
            BufReader::with_capacity(LINE_BYTES, file).read_until(b'\n', &mut line)?;
            Ok(line)
        });
        line.map_err(|e| Error::file(&self.path, "read", e))
    }

    /// A record from its line.
    ///
    /// # Errors
    /// If the line is not a record.
    pub(crate) fn record<D: Detail>(&self, line: &[u8]) -> Result<Record<D>> {
        serde_json::from_slice(line).map_err(|e| Error::file(&self.path, "read", e.into()))
    }
}

/// The file of a run's questions, to read single lines.
#[derive(Debug)]
pub(crate) struct QuestionFile {
    path: PathBuf,
    file: File,
}

impl QuestionFile {
    /// Opens the questions of a run folder; `None` if it stores none.
    ///
    /// # Errors
    /// If they cannot be opened.
    pub(crate) fn open(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(QUESTIONS);
        match File::open(&path) {
            Ok(file) => Ok(Some(Self { path, file })),
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
            Err(e) => Err(Error::file(path, "open", e)),
        }
    }

    /// The line at a place, with its end.
    ///
    /// # Errors
    /// If the file has become shorter.
    pub(crate) fn line(&self, place: LinePlace) -> Result<Vec<u8>> {
        let mut line = vec![0; place.length];
        let mut file = &self.file;
        let read = file.seek(SeekFrom::Start(place.start));
        let read = read.and_then(|_| file.read_exact(&mut line));
        read.map_err(|e| Error::file(&self.path, "read", e))?;
        Ok(line)
    }
}

/// Hands over all records of a run folder in the order of the file, each with its place; of a trial that was asked again all.
///
/// # Errors
/// If a line is not a record.
pub(crate) fn each_record<D: Detail>(
    folder: &Path,
    take: impl FnMut(Record<D>, LinePlace),
) -> Result<()> {
    each_placed_line(&folder.join(RECORDS), take)
}
