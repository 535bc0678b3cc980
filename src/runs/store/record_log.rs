//! Random access to single records in the file of a run: [`RecordLog`].
//!
//! [`UnlockedLog`]: detection of a second process that writes to a run, for file systems without locks.
//!
//! [`LogMark`]: fingerprint of a run's records, stored in files that are derived from them.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::process;
use std::time::{SystemTime, UNIX_EPOCH};

use super::folder::{MANIFEST, QUESTIONS, RECORDS};
use super::lines::each_placed_line;
use super::pieces::{LinePlace, open_if_exists};
use super::stored_trial::TrialLine;
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::{Digest, Record};
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

/// The marker file in a run folder, which names the process that last began to write.
const WRITER: &str = "writer.txt";

/// The length of the log that this process expects, and any other writer that it found.
#[derive(Debug)]
pub(super) struct UnlockedLog {
    marker: PathBuf,
    /// The name of this process in the marker.
    name: String,
    /// The length of the log after the last write of this process, in bytes.
    end: u64,
    found: OtherWriter,
}

/// The other process that writes to the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum OtherWriter {
    None,
    /// A process that started earlier: this process stops.
    Earlier,
    /// A process that started later: the other process stops.
    Later,
}

impl UnlockedLog {
    /// Writes the marker of this process into a run folder, and warns that the file system has no locks.
    ///
    /// # Errors
    /// If the marker cannot be written.
    pub(super) fn begin(folder: &Path, log: &File, problem: &io::Error) -> Result<Self> {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
        let begun = Self {
            marker: folder.join(WRITER),
            name: format!("process {}, {now} ns\n", process::id()),
            end: log.metadata().map_or(0, |log| log.len()),
            found: OtherWriter::None,
        };
        files::write(&begun.marker, begun.name.as_bytes())?;
        tracing::warn!(
            "{}: this file system has no locks ({problem}), so a second process is not refused: start none for this run, or put --out on \
             a local disk",
            folder.display()
        );
        Ok(begun)
    }

    /// Checks for records of another process. Must be called before this process appends `bytes` bytes.
    pub(super) fn before_append(&mut self, log: &File, bytes: usize) {
        let length = log.metadata().map_or(self.end, |log| log.len());
        if length != self.end && self.found == OtherWriter::None {
            self.found = if self.is_last() { OtherWriter::Earlier } else { OtherWriter::Later };
            if self.found == OtherWriter::Later {
                tracing::warn!("another process has begun to write to this run; it stops");
            }
        }
        self.end = length + bytes as u64;
    }

    /// The error that stops this process, if one that started earlier writes to the log.
    pub(super) fn problem(&self, folder: &Path) -> Option<Error> {
        (self.found == OtherWriter::Earlier).then(|| Error::Run {
            path: folder.to_owned(),
            problem: "another process, which started earlier, writes to this run; wait for its end, then the same command goes on".to_owned(),
        })
    }

    /// True if no process began to write after this one.
    fn is_last(&self) -> bool {
        fs::read_to_string(&self.marker).is_ok_and(|name| name == self.name)
    }
}

impl Drop for UnlockedLog {
    fn drop(&mut self) {
        if self.is_last() {
            // A remaining marker does no harm.
            let _ = fs::remove_file(&self.marker);
        }
    }
}

/// Number of bytes at the end of the records that are hashed. Records are only appended, so every change changes the
/// end.
const TAIL_BYTES: u64 = 64 << 10;

/// A fingerprint of the files of a run folder. A derived file with the same mark is up to date.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogMark {
    /// The digest of `manifest.json`.
    manifest: Digest,
    /// The digest of `questions.jsonl`; the digest of no bytes without the file.
    questions: Digest,
    /// The length of `records.jsonl`, in bytes.
    log_bytes: u64,
    /// The digest of the last 64 KiB of `records.jsonl`.
    log_tail: Digest,
}

impl LogMark {
    /// The mark of a run folder as it is now.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(RECORDS);
        let (log_bytes, tail) = read_tail(&path).map_err(|e| Error::file(&path, "read", e))?;
        Ok(Self {
            manifest: file_digest(folder.join(MANIFEST))?,
            questions: file_digest(folder.join(QUESTIONS))?,
            log_bytes,
            log_tail: Digest::from_bytes(&tail),
        })
    }

    /// The mark as pairs of key and value.
    pub fn pairs(&self) -> [(&'static str, String); 4] {
        [
            ("darkqa.manifest", self.manifest.to_string()),
            ("darkqa.questions", self.questions.to_string()),
            ("darkqa.log_bytes", self.log_bytes.to_string()),
            ("darkqa.log_tail", self.log_tail.to_string()),
        ]
    }
}

/// The length of a file, and its last bytes.
fn read_tail(path: &Path) -> io::Result<(u64, Vec<u8>)> {
    let mut file = files::open(path)?;
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(TAIL_BYTES)))?;
    let mut tail = Vec::new();
    file.take(TAIL_BYTES).read_to_end(&mut tail)?;
    Ok((length, tail))
}

/// The digest of a file; the digest of no bytes if it does not exist.
fn file_digest(path: PathBuf) -> Result<Digest> {
    match files::read(&path) {
        Ok(content) => Ok(Digest::from_bytes(&content)),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(Digest::from_bytes(&[])),
        Err(e) => Err(Error::file(path, "read", e)),
    }
}

#[cfg(test)]
mod tests {
    use std::fs::OpenOptions;
    use std::io::Write as _;

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

    fn begin(folder: &Path) -> (UnlockedLog, File) {
        let log = OpenOptions::new().append(true).create(true).open(folder.join("records.jsonl")).unwrap();
        let problem = io::Error::from(io::ErrorKind::Unsupported);
        (UnlockedLog::begin(folder, &log, &problem).unwrap(), log)
    }

    fn append((log, file): &mut (UnlockedLog, File)) {
        log.before_append(file, 3);
        file.write_all(b"{}\n").unwrap();
    }

    #[test]
    fn later_process_stops() {
        let folder = tempfile::tempdir().unwrap();
        let mut first = begin(folder.path());
        append(&mut first);
        let mut second = begin(folder.path());
        append(&mut second);
        append(&mut second);
        assert!(second.0.problem(folder.path()).is_none());
        append(&mut first);
        append(&mut second);
        append(&mut first);
        assert!(first.0.problem(folder.path()).is_none());
        assert!(second.0.problem(folder.path()).is_some());
    }

    #[test]
    fn single_process_continues() {
        let folder = tempfile::tempdir().unwrap();
        for _ in 0..2 {
            let mut alone = begin(folder.path());
            for _ in 0..5 {
                append(&mut alone);
                assert!(alone.0.problem(folder.path()).is_none());
            }
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "the note is removed");
    }

    #[test]
    fn marks_change_with_each_file() {
        let folder = tempfile::tempdir().unwrap();
        let lines = "one line\n".repeat(20_000);
        let longer = "one line\n".repeat(20_001);
        let other_end = lines.clone() + "one lime\n";
        let mut marks = Vec::new();
        for (name, text) in
            [(RECORDS, &*lines), (MANIFEST, "{}"), (QUESTIONS, "{}"), (RECORDS, &*longer), (RECORDS, &*other_end)]
        {
            std::fs::write(folder.path().join(name), text).unwrap();
            marks.push(LogMark::read(folder.path()).unwrap());
        }
        let other_start = lines.replacen("one", "two", 1);
        std::fs::write(folder.path().join(RECORDS), other_start).unwrap();
        let mark = LogMark::read(folder.path()).unwrap();
        assert_eq!(mark, marks[2], "the beginning is not hashed");
        for (i, one) in marks.iter().enumerate() {
            assert!(marks[i + 1..].iter().all(|other| other != one), "{i}");
        }
        std::fs::remove_file(folder.path().join(RECORDS)).unwrap();
        let missing = LogMark::read(folder.path()).unwrap_err().to_string();
        assert!(missing.contains(RECORDS), "{missing}");
    }
}
