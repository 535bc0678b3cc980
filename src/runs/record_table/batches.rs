//! Rows of the record table, read in batches: [`RowBatches`].

use std::path::Path;

use rayon::prelude::*;

use super::places::ordered_places;
use super::row::{Row, Rows, TableDetail};
use crate::error::Result;
use crate::runs::stored::read_run_manifest;
use crate::store::{LinePlace, RecordLog, each_question};
use crate::types::Record;

/// Maximum number of records in a batch. Chosen to be enough for all cores.
const MAX_RECORDS: usize = 1 << 14;
/// Maximum size of a batch, in bytes. Only a batch of one record may exceed it. An arbitrary choice.
const MAX_BYTES: usize = 16 << 20;

/// Rows of a run in order, read in batches to keep the records out of memory.
pub(super) struct RowBatches<D: TableDetail> {
    log: RecordLog,
    rows: Rows<D>,
    /// Places of the records in the log, in the order of the rows.
    places: Vec<LinePlace>,
    /// Number of records read so far.
    read: usize,
}

impl<D: TableDetail> RowBatches<D> {
    /// Opens the run in a folder.
    ///
    /// # Errors
    /// If a line of the run is malformed.
    pub(super) fn open(folder: &Path) -> Result<Self> {
        let manifest = read_run_manifest(folder)?;
        let mut questions = Vec::new();
        each_question(folder, |question| {
            questions.push(question.without_evidence());
        })?;
        Ok(Self {
            places: ordered_places(folder, &manifest, &questions)?,
            rows: Rows::new(folder, &manifest, &questions)?,
            log: RecordLog::open(folder)?,
            read: 0,
        })
    }

    /// Reads the next batch; `None` at the end. A batch is empty if none of its records has a row.
    ///
    /// # Errors
    /// If a record is malformed.
    pub(super) fn next_batch(&mut self) -> Result<Option<Vec<Row<D>>>> {
        let unread = &self.places[self.read..];
        if unread.is_empty() {
            return Ok(None);
        }
        let batch = &unread[..batch_length(unread)];
        let lines = self.log.lines(batch)?;
        let records: Result<Vec<Record<D>>> = lines.par_iter().map(|line| self.log.record::<D>(line)).collect();
        self.read += batch.len();
        let rows = records?.into_iter().filter_map(|record| self.rows.row(record)).collect();
        Ok(Some(rows))
    }
}

/// Number of records in a batch that starts with the first of these places.
fn batch_length(places: &[LinePlace]) -> usize {
    let mut bytes = 0;
    places
        .iter()
        .take(MAX_RECORDS)
        .take_while(|place| {
            bytes += place.length;
            bytes <= MAX_BYTES
        })
        .count()
        .max(1)
}
