//! `records.parquet`: the records of a run as a table for other programs, made from the log, which stays the truth: [`update`].

mod batches;
mod choice;
mod common;
mod open;
mod places;
mod reader;
mod row;

use std::path::Path;

use self::batches::RowBatches;
pub use self::reader::{Records, RunRecord, StoredRun};
use self::row::Tabled;
use crate::error::Result;
use crate::runs::outcome::RecordTable;
use crate::runs::stored::ExperimentKind;
use crate::store::{CREATED_BY, ColumnFile, FileMetadata, LogMark};
use crate::types::{ChoiceDetail, OpenDetail};

/// The name of the file.
pub(crate) const RECORDS_PARQUET: &str = "records.parquet";

/// Writes the table of the run in a folder, unless the one that is there is as new as the log. The records are not held in memory.
///
/// # Errors
/// If a record is broken, or the file cannot be written.
pub(crate) fn update(folder: &Path, table: RecordTable) -> Result<()> {
    match ExperimentKind::read(folder)? {
        ExperimentKind::Choice => update_of::<ChoiceDetail>(folder, table),
        ExperimentKind::Open => update_of::<OpenDetail>(folder, table),
    }
}

fn update_of<D: Tabled>(folder: &Path, table: RecordTable) -> Result<()> {
    let path = folder.join(RECORDS_PARQUET);
    let name = ("darkqa.schema", D::TABLE.to_owned());
    let pairs = LogMark::read(folder)?.pairs().into_iter().chain([name]);
    let metadata = FileMetadata {
        created_by: CREATED_BY.to_owned(),
        pairs: pairs.map(|(key, value)| (key.to_owned(), value)).collect(),
    };
    if FileMetadata::read(&path)?.as_ref() == Some(&metadata) {
        return Ok(());
    }
    if table == RecordTable::LeftOut {
        if path.exists() {
            tracing::warn!(
                "{}: not made from the records as they are now, and left as it is (--no-parquet); report without --no-parquet writes it again",
                path.display()
            );
        }
        return Ok(());
    }
    write::<D>(folder, &path, &metadata)
}

fn write<D: Tabled>(folder: &Path, path: &Path, metadata: &FileMetadata) -> Result<()> {
    let mut batches = RowBatches::<D>::open(folder)?;
    let columns = D::columns();
    let mut file = ColumnFile::create(path, &columns, metadata)?;
    while let Some(rows) = batches.next_batch()? {
        file.append(&rows)?;
    }
    for (column, count) in file.finish()? {
        tracing::warn!(
            "{}: numbers that are too large for the column {column}, and are null in it: {count}; records.jsonl has them",
            path.display()
        );
    }
    Ok(())
}
