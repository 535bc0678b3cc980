//! [`LogMark`]: state of a run's records at the time when a file was derived from them.

use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use super::folder::{MANIFEST, QUESTIONS, RECORDS};
use darkqa_ground::error::{Error, Result};
use darkqa_ground::files::reading;
use darkqa_ground::types::Digest;

/// How much of the end of the records is looked at, in bytes. Records are appended: whatever changes them changes their end.
const TAIL: u64 = 64 << 10;

/// Digests by which a file that was made from a run folder is known to be as new as the records.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogMark {
    /// The digest of `manifest.json`.
    manifest: Digest,
    /// The digest of `questions.jsonl`; of nothing if there is none.
    questions: Digest,
    /// The length of `records.jsonl`, in bytes.
    log_bytes: u64,
    /// The digest of its last 64 KB.
    log_tail: Digest,
}

impl LogMark {
    /// The mark of a run folder as it is now.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn read(folder: &Path) -> Result<Self> {
        let whole = |name: &str| {
            let path = folder.join(name);
            match reading::read(&path) {
                Ok(content) => Ok(Digest::from_bytes(&content)),
                Err(e) if e.kind() == ErrorKind::NotFound => Ok(Digest::from_bytes(&[])),
                Err(e) => Err(Error::file(path, "read", e)),
            }
        };
        let path = folder.join(RECORDS);
        let unreadable = |e| Error::file(&path, "read", e);
        let mut log = reading::open(&path).map_err(unreadable)?;
        let log_bytes = log.metadata().map_err(unreadable)?.len();
        let mut tail = Vec::new();
        let start = log_bytes.saturating_sub(TAIL);
        let read = log.seek(SeekFrom::Start(start));
        read.and_then(|_| log.take(TAIL).read_to_end(&mut tail))
            .map_err(unreadable)?;
        Ok(Self {
            manifest: whole(MANIFEST)?,
            questions: whole(QUESTIONS)?,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_changes_with_each_file_that_it_is_of() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text);
        let mark = || LogMark::read(folder.path()).unwrap();
        write(RECORDS, &"one line\n".repeat(20_000)).unwrap();
        let mut marks = vec![mark()];
        write(MANIFEST, "{}").unwrap();
        marks.push(mark());
        write(QUESTIONS, "{}").unwrap();
        marks.push(mark());
        write(RECORDS, &"one line\n".repeat(20_001)).unwrap();
        marks.push(mark());
        write(
            RECORDS,
            &"one line\n".repeat(20_000).replacen("one", "two", 1),
        )
        .unwrap();
        assert_eq!(mark(), marks[2], "the beginning is not looked at");
        write(RECORDS, &("one line\n".repeat(20_000) + "one lime\n")).unwrap();
        marks.push(mark());
        for (i, one) in marks.iter().enumerate() {
            assert!(marks[i + 1..].iter().all(|other| other != one), "{i}");
        }
        std::fs::remove_file(folder.path().join(RECORDS)).unwrap();
        let missing = LogMark::read(folder.path()).unwrap_err().to_string();
        assert!(missing.contains(RECORDS), "{missing}");
    }
}
