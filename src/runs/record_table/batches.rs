//! The rows of the table of records, some at once: [`RowBatches`].

use std::path::Path;

use rayon::prelude::*;

use super::places::places;
use super::row::{Row, Rows, Tabled};
use crate::error::Result;
use crate::runs::stored::manifest;
use crate::store::{LinePlace, RecordLog, each_question};
use crate::types::Record;

/// The most records that are read at once. Chosen: enough for all cores.
const RECORDS_AT_ONCE: usize = 1 << 14;
/// The most bytes of records that are read at once; more only if one record has more. Chosen.
const BYTES_AT_ONCE: usize = 16 << 20;

/// The rows of a run in their order, read in batches, so that the records are not held in memory.
pub(super) struct RowBatches<D: Tabled> {
    log: RecordLog,
    rows: Rows<D>,
    places: Vec<LinePlace>,
    /// The number of records that were read.
    read: usize,
}

impl<D: Tabled> RowBatches<D> {
    /// The rows of the run in a folder.
    ///
    /// # Errors
    /// If a line of the run is broken.
    pub(super) fn open(folder: &Path) -> Result<Self> {
        let manifest = manifest(folder)?;
        let mut questions = Vec::new();
        each_question(folder, |question| {
            questions.push(question.without_evidence());
        })?;
        Ok(Self {
            places: places(folder, &manifest, &questions)?,
            rows: Rows::new(folder, &manifest, &questions)?,
            log: RecordLog::open(folder)?,
            read: 0,
        })
    }

    /// The next rows; `None` at the end. A batch is empty if none of its records has a row.
    ///
    /// # Errors
    /// If a record is broken.
    pub(super) fn next_batch(&mut self) -> Result<Option<Vec<Row<D>>>> {
        let rest = &self.places[self.read..];
        if rest.is_empty() {
            return Ok(None);
        }
        let now = &rest[..at_once(rest)];
        let lines = self.log.lines(now)?;
        let records: Result<Vec<Record<D>>> = lines
            .par_iter()
            .map(|line| self.log.record::<D>(line))
            .collect();
        self.read += now.len();
        let rows = records?.into_iter();
        Ok(Some(
            rows.filter_map(|record| self.rows.row(record)).collect(),
        ))
    }
}

/// How many of these records are read at once.
fn at_once(places: &[LinePlace]) -> usize {
    let mut bytes = 0;
    places
        .iter()
        .take(RECORDS_AT_ONCE)
        .take_while(|place| {
            bytes += place.length;
            bytes <= BYTES_AT_ONCE
        })
        .count()
        .max(1)
}
