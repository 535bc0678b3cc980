//! The cost of requests in flight, as a file in the run folder: [`InFlightCost`]. If the process is killed, the file
//! remains, and the next process counts the requests that may have been charged without a record.

use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::files;
use crate::files::reading;
use crate::store::set_file_aside;

/// Name of the file in a run folder. It exists while requests are in flight, and after a process was killed.
const NOTE: &str = "in_flight.json";

/// Factor by which the written cost exceeds the reserved one, so that the file is seldom written; chosen.
const MARGIN: f64 = 1.25;

/// Cost of requests without a record, in US dollars.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(crate) struct InFlightCost {
    /// Upper bound of the requests in flight when earlier processes were killed.
    killed: f64,
    /// Upper bound of the requests in flight now.
    in_flight: f64,
}

impl InFlightCost {
    /// Reads the file in a run folder. Requests that it states as in flight are counted as those of a killed process.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub(crate) fn open(folder: &Path) -> Result<Self> {
        let path = folder.join(NOTE);
        let text = match reading::read(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Self::default()),
            Err(e) => return Err(Error::file(path, "read", e)),
        };
        let note =
            serde_json::from_slice::<Self>(&text).ok().filter(|note| is_cost(note.killed) && is_cost(note.in_flight));
        let Some(note) = note else {
            let aside = set_file_aside(&path)?;
            tracing::warn!(
                "{}: not readable, set aside as {}: requests that were in flight when a process was killed are not in the costs",
                path.display(),
                aside.display()
            );
            return Ok(Self::default());
        };
        Ok(Self { killed: note.killed + note.in_flight, in_flight: 0.0 })
    }

    /// Upper bound of the cost of requests that killed processes left without a record, in US dollars.
    pub(crate) fn killed(self) -> f64 {
        self.killed
    }

    /// Writes the cost in flight, if it is higher than the written one.
    pub(crate) fn raise(&mut self, folder: &Path, dollars: f64) -> Result<()> {
        if dollars <= self.in_flight {
            return Ok(());
        }
        self.in_flight = dollars * MARGIN;
        self.write(folder)
    }

    /// Writes that nothing is in flight, once all requests have a record. Deletes the file if no process was killed
    /// either.
    pub(crate) fn end(&mut self, folder: &Path) -> Result<()> {
        if self.in_flight <= 0.0 {
            return Ok(());
        }
        self.in_flight = 0.0;
        if self.killed > 0.0 {
            return self.write(folder);
        }
        let path = folder.join(NOTE);
        fs::remove_file(&path).map_err(|e| Error::file(path, "delete", e))
    }

    fn write(self, folder: &Path) -> Result<()> {
        let path = folder.join(NOTE);
        let text = serde_json::to_vec(&self).map_err(|e| Error::file(&path, "write", e.into()))?;
        files::write(&path, &text)
    }
}

fn is_cost(dollars: f64) -> bool {
    dollars.is_finite() && dollars >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_killed_process_leaves_a_cost() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        let mut cost = InFlightCost::open(path).unwrap();
        cost.raise(path, 4.0).unwrap();
        cost.raise(path, 3.0).unwrap();
        cost.end(path).unwrap();
        assert_eq!(fs::read_dir(path).unwrap().count(), 0);
        cost.raise(path, 4.0).unwrap();
        let mut next = InFlightCost::open(path).unwrap();
        assert!((next.killed() - 5.0).abs() < 1e-9);
        next.raise(path, 1.0).unwrap();
        next.end(path).unwrap();
        let third = InFlightCost::open(path).unwrap();
        assert!((third.killed() - 5.0).abs() < 1e-9, "it counts once");
    }

    #[test]
    fn a_damaged_note_is_set_aside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        for damaged in ["", "{\"killed\":1", "{\"killed\":-1,\"in_flight\":0}"] {
            fs::write(path.join(NOTE), damaged).unwrap();
            assert!(InFlightCost::open(path).unwrap().killed() < 1e-9);
            assert!(path.join("in_flight.json.damaged").exists());
        }
    }
}
