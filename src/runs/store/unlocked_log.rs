//! [`UnlockedLog`]: detection of a second process that writes to a run, for file systems without locks.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process;
use std::time::{SystemTime, UNIX_EPOCH};

use darkqa_base::error::{Error, Result};
use darkqa_base::files;

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

#[cfg(test)]
mod tests {
    use std::fs::OpenOptions;
    use std::io::Write as _;

    use super::*;

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
}
