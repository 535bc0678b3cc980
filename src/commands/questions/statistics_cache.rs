//! Cache of frame statistics in a file next to the questions: [`StatisticsCache`].
//!
//! The file has one line per frame. Each line is added as soon as its frame is measured, so that an interrupted command
//! can continue. At the end the file is rewritten in the order of the frames.

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::files::reading;
use crate::files::write;
use crate::types::Digest;
use darkqa_questions::statistics::FrameStatistics;

/// Frame statistics, by the digest of everything that determines them.
pub(super) struct StatisticsCache {
    path: PathBuf,
    known: HashMap<Digest, FrameStatistics>,
    file: Mutex<File>,
}

impl StatisticsCache {
    /// Reads the file, if it exists, and the files of shards. Broken lines, such as the last one of an interrupted
    /// command, are ignored: their frames are measured again.
    pub(super) fn open(path: &Path, shard_files: &[PathBuf]) -> Result<Self> {
        let mut known = HashMap::new();
        for file in shard_files {
            read(file, &mut known)?;
        }
        let end = read(path, &mut known)?;
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|e| Error::file(folder, "make", e))?;
        }
        let mut file =
            OpenOptions::new().create(true).append(true).open(path).map_err(|e| Error::file(path, "write", e))?;
        if end == FileEnd::Broken {
            // The next line must not continue a half-written one.
            file.write_all(b"\n").map_err(|e| Error::file(path, "write", e))?;
        }
        Ok(Self { path: path.to_owned(), known, file: Mutex::new(file) })
    }

    /// The statistics with a key.
    pub(super) fn get(&self, key: Digest) -> Option<FrameStatistics> {
        self.known.get(&key).cloned()
    }

    /// Appends the statistics of a frame to the file.
    pub(super) fn add(&self, statistics: &FrameStatistics) -> Result<()> {
        let line = line(statistics)?;
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(&line).map_err(|e| Error::file(&self.path, "write", e))
    }

    /// Rewrites the file with exactly these frames, in this order.
    pub(super) fn finish(self, frames: &[FrameStatistics]) -> Result<()> {
        let lines = frames.iter().map(line).collect::<Result<Vec<_>>>()?;
        drop(self.file);
        write(&self.path, &lines.concat())
    }
}

/// State of the lines of a file of statistics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FileEnd {
    /// All lines are complete, or the file does not exist.
    Complete,
    /// A line cannot be parsed, because a command was interrupted while writing it.
    Broken,
}

/// Adds the statistics in a file, if it exists, to `known`.
fn read(path: &Path, known: &mut HashMap<Digest, FrameStatistics>) -> Result<FileEnd> {
    let file = match reading::open(path) {
        Ok(file) => file,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(FileEnd::Complete),
        Err(e) => return Err(Error::file(path, "read", e)),
    };
    let mut end = FileEnd::Complete;
    for line in BufReader::new(file).split(b'\n') {
        let line = line.map_err(|e| Error::file(path, "read", e))?;
        match serde_json::from_slice::<FrameStatistics>(&line) {
            Ok(statistics) => drop(known.insert(statistics.key, statistics)),
            Err(_) => end = FileEnd::Broken,
        }
    }
    Ok(end)
}

fn line(statistics: &FrameStatistics) -> Result<Vec<u8>> {
    let mut line = serde_json::to_vec(statistics).map_err(|e| Error::data("statistics", e))?;
    line.push(b'\n');
    Ok(line)
}
