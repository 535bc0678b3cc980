//! Random access to single records in the file of a run: [`RecordLog`].

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::folder::{QUESTIONS, RECORDS};
use super::lines::each_placed_line;
use super::pieces::{LinePlace, open_if_exists};
use super::reread_record::RereadRecord;
use super::trial_line::TrialLine;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Record;
use darkqa_score::answers::record::Detail;

/// Buffer size for a single line, in bytes. Chosen: most lines are shorter.
const LINE_BYTES: usize = 2048;

/// The file of a run's records, open for random access.
#[derive(Debug)]
pub struct RecordLog {
    path: PathBuf,
    file: File,
}

impl RecordLog {
    /// Opens the records of a run folder.
    ///
    /// # Errors
    /// If the file does not exist or cannot be opened.
    pub fn open(folder: &Path) -> Result<Self> {
        Self::open_if_exists(folder)?
            .ok_or_else(|| Error::file(folder.join(RECORDS), "open", ErrorKind::NotFound.into()))
    }

    /// Opens the records of a run folder; `None` if the file does not exist.
    ///
    /// # Errors
    /// If they cannot be opened.
    pub fn open_if_exists(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(RECORDS);
        let file = open_if_exists(&path)?;
        Ok(file.map(|file| Self { path, file }))
    }

    /// The line at a byte offset, with its end.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn line_from(&self, start: u64) -> Result<Vec<u8>> {
        let mut file = &self.file;
        file.seek(SeekFrom::Start(start))
            .and_then(|_| {
                let mut line = Vec::new();
                BufReader::with_capacity(LINE_BYTES, file).read_until(b'\n', &mut line)?;
                Ok(line)
            })
            .map_err(|e| Error::file(&self.path, "read", e))
    }

    /// The lines at these places, in the order of `places`. Lines that are neighbours in the file are read together.
    ///
    /// # Errors
    /// If the file has become shorter.
    pub fn lines(&self, places: &[LinePlace]) -> Result<Vec<Vec<u8>>> {
        let mut in_file: Vec<usize> = (0..places.len()).collect();
        in_file.sort_unstable_by_key(|index| places[*index].start);
        let mut lines = vec![Vec::new(); places.len()];
        for together in in_file.chunk_by(|one, next| places[*one].end() == places[*next].start) {
            let start = places[together[0]].start;
            let length = together.iter().map(|index| places[*index].length).sum();
            let block =
                bytes_at(&self.file, LinePlace { start, length }).map_err(|e| Error::file(&self.path, "read", e))?;
            for index in together {
                let place = places[*index];
                let at = (place.start - start) as usize;
                lines[*index] = block[at..at + place.length].to_vec();
            }
        }
        Ok(lines)
    }

    /// A record from its line.
    ///
    /// # Errors
    /// If the line is not a record.
    pub fn record<D: Detail>(&self, line: &[u8]) -> Result<Record<D>> {
        D::parse_record(line).map_err(|e| Error::file(&self.path, "read", e.into()))
    }
}

/// The file of a run's questions, open for random access.
#[derive(Debug)]
pub struct QuestionFile {
    path: PathBuf,
    file: File,
}

impl QuestionFile {
    /// Opens the questions of a run folder; `None` if the file does not exist.
    ///
    /// # Errors
    /// If they cannot be opened.
    pub fn open(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(QUESTIONS);
        let file = open_if_exists(&path)?;
        Ok(file.map(|file| Self { path, file }))
    }

    /// The line at a place, with its end.
    ///
    /// # Errors
    /// If the file has become shorter.
    pub fn line(&self, place: LinePlace) -> Result<Vec<u8>> {
        bytes_at(&self.file, place).map_err(|e| Error::file(&self.path, "read", e))
    }
}

/// The bytes at a place of a file.
fn bytes_at(mut file: &File, place: LinePlace) -> std::io::Result<Vec<u8>> {
    let mut bytes = vec![0; place.length];
    file.seek(SeekFrom::Start(place.start))?;
    file.read_exact(&mut bytes)?;
    Ok(bytes)
}

/// Calls `take` with the identity of the trial of each record, in the order of the file, and with the record's place. A
/// trial that was asked again occurs several times.
///
/// # Errors
/// If a line is not a record.
pub fn each_trial(folder: &Path, take: impl FnMut(TrialLine, LinePlace)) -> Result<()> {
    each_placed_line(&folder.join(RECORDS), take)
}

/// Calls `take` with each record of a run folder in the order of the file, and with its place. A trial that was asked
/// again occurs several times.
///
/// # Errors
/// If a line is not a record.
pub fn each_record<D: Detail>(folder: &Path, take: impl FnMut(Record<D>, LinePlace)) -> Result<()> {
    each_placed_line(&folder.join(RECORDS), take)
}

/// Calls `take` with each record as [`each_record`] does, after its reply was parsed again by the rules of this
/// version.
///
/// # Errors
/// If a line is not a record, or the choices of a record are not valid.
pub fn each_reread_record<D: Detail>(folder: &Path, mut take: impl FnMut(Record<D>, LinePlace)) -> Result<()> {
    each_placed_line(&folder.join(RECORDS), |line: RereadRecord<D>, place| {
        take(line.0, place);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_in_any_order() {
        let folder = tempfile::tempdir().unwrap();
        let lines: Vec<String> = (0..40).map(|number| format!("{}\n", "x".repeat(number))).collect();
        std::fs::write(folder.path().join(RECORDS), lines.concat()).unwrap();
        let log = RecordLog::open(folder.path()).unwrap();
        let all: Vec<LinePlace> = (0..lines.len())
            .map(|index| LinePlace {
                start: lines[..index].iter().map(|line| line.len() as u64).sum(),
                length: lines[index].len(),
            })
            .collect();
        for order in [vec![], vec![5], vec![7, 3, 4, 5, 39, 0], (0..40).collect()] {
            let places: Vec<LinePlace> = order.iter().map(|index| all[*index]).collect();
            let read = log.lines(&places).unwrap();
            let expected = order.iter().map(|index| lines[*index].clone().into_bytes());
            assert!(read.into_iter().eq(expected), "{order:?}");
        }
        let beyond = LinePlace { start: 1_000, length: 2 };
        assert!(log.lines(&[all[0], beyond]).is_err());
    }
}
