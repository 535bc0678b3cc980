//! The records of a run by their places in its file, so that none is held: [`RecordLog`].

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::folder::RECORDS;
use super::lines::each_placed_line;
use super::pieces::LinePlace;
use crate::error::{Error, Result};
use crate::types::{Detail, Record};

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

    /// The line at a place, with its end.
    ///
    /// # Errors
    /// If the file has become shorter.
    pub(crate) fn line(&mut self, place: LinePlace) -> Result<Vec<u8>> {
        let mut line = vec![0; place.length];
        let read = self.file.seek(SeekFrom::Start(place.start));
        let read = read.and_then(|_| self.file.read_exact(&mut line));
        read.map_err(|e| Error::file(&self.path, "read", e))?;
        Ok(line)
    }

    /// A record from its line.
    ///
    /// # Errors
    /// If the line is not a record.
    pub(crate) fn record<D: Detail>(&self, line: &[u8]) -> Result<Record<D>> {
        serde_json::from_slice(line).map_err(|e| Error::file(&self.path, "read", e.into()))
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
