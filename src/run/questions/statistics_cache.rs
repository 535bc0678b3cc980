//! What was measured of frames, kept by content beside the questions: [`StatisticsCache`].
//!
//! One file, a frame a line. While frames are measured, a line is added the moment it is known, so that whatever stops the
//! work, it goes on from there; in the end the file is written anew in the order of the frames.

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::files::write;
use crate::questions::statistics::FrameStatistics;
use crate::types::Digest;

/// What was measured, by content.
pub(super) struct StatisticsCache {
    path: PathBuf,
    known: HashMap<Digest, FrameStatistics>,
    file: Mutex<File>,
}

impl StatisticsCache {
    /// Reads what is there. A line that is none, as the last one of a run that was stopped, is left out: its frame is measured
    /// again.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let mut known = HashMap::new();
        let mut cut = false;
        match File::open(path) {
            Ok(file) => {
                for line in BufReader::new(file).split(b'\n') {
                    let line = line.map_err(|e| Error::file(path, "read", e))?;
                    match serde_json::from_slice::<FrameStatistics>(&line) {
                        Ok(statistics) => drop(known.insert(statistics.key, statistics)),
                        Err(_) => cut = true,
                    }
                }
            }
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(e) => return Err(Error::file(path, "read", e)),
        }
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|e| Error::file(folder, "make", e))?;
        }
        let file = OpenOptions::new().create(true).append(true).open(path);
        let mut file = file.map_err(|e| Error::file(path, "write", e))?;
        if cut {
            // What comes next must not hang on to half a line.
            file.write_all(b"\n")
                .map_err(|e| Error::file(path, "write", e))?;
        }
        Ok(Self {
            path: path.to_owned(),
            known,
            file: Mutex::new(file),
        })
    }

    /// What was measured of such content.
    pub(super) fn get(&self, key: Digest) -> Option<FrameStatistics> {
        self.known.get(&key).cloned()
    }

    /// Keeps what was measured.
    pub(super) fn add(&self, statistics: &FrameStatistics) -> Result<()> {
        let line = line(statistics)?;
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(&line)
            .map_err(|e| Error::file(&self.path, "write", e))
    }

    /// Leaves exactly these frames, in this order.
    pub(super) fn finish(self, frames: &[FrameStatistics]) -> Result<()> {
        let lines = frames.iter().map(line).collect::<Result<Vec<_>>>()?;
        drop(self.file);
        write(&self.path, &lines.concat())
    }
}

fn line(statistics: &FrameStatistics) -> Result<Vec<u8>> {
    let mut line = serde_json::to_vec(statistics).map_err(|e| Error::data("statistics", e))?;
    line.push(b'\n');
    Ok(line)
}
