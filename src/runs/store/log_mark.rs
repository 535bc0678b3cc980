//! [`LogMark`]: fingerprint of a run's records, stored in files that are derived from them.

use std::io::{self, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::folder::{MANIFEST, QUESTIONS, RECORDS};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::reading;
use darkqa_base::types::Digest;

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
    let mut file = reading::open(path)?;
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(TAIL_BYTES)))?;
    let mut tail = Vec::new();
    file.take(TAIL_BYTES).read_to_end(&mut tail)?;
    Ok((length, tail))
}

/// The digest of a file; the digest of no bytes if it does not exist.
fn file_digest(path: PathBuf) -> Result<Digest> {
    match reading::read(&path) {
        Ok(content) => Ok(Digest::from_bytes(&content)),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(Digest::from_bytes(&[])),
        Err(e) => Err(Error::file(path, "read", e)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
