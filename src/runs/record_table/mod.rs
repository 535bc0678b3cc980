//! `records.parquet`, the records of a run as a table for other programs: [`update`] writes it. The log stays the
//! source of truth.

mod columns;
mod reader;

use std::path::Path;

use crate::outcome::RecordTable;
use crate::stored::ExperimentKind;
use darkqa_base::error::Result;
use darkqa_base::types::{ChoiceDetail, OpenDetail};
use darkqa_store::{CREATED_BY, ColumnFile, FileMetadata, LogMark};
use reader::{RowBatches, TableDetail};

pub use self::reader::{Records, RunRecord, StoredRun};

pub const RECORDS_PARQUET: &str = "records.parquet";

/// Writes the table of the run in a folder, unless the existing one is up to date with the log. The records are not
/// kept in memory.
///
/// # Errors
/// If a record is broken, or the file cannot be written.
pub fn update(folder: &Path, table: RecordTable) -> Result<()> {
    match ExperimentKind::read(folder)? {
        ExperimentKind::Choice => update_kind::<ChoiceDetail>(folder, table),
        ExperimentKind::Open => update_kind::<OpenDetail>(folder, table),
    }
}

fn update_kind<D: TableDetail>(folder: &Path, table: RecordTable) -> Result<()> {
    let path = folder.join(RECORDS_PARQUET);
    let schema = ("darkqa.schema", D::TABLE.to_owned());
    let metadata = FileMetadata {
        created_by: CREATED_BY.to_owned(),
        pairs: LogMark::read(folder)?
            .pairs()
            .into_iter()
            .chain([schema])
            .map(|(key, value)| (key.to_owned(), value))
            .collect(),
    };
    if FileMetadata::read(&path)?.as_ref() == Some(&metadata) {
        return Ok(());
    }
    if table == RecordTable::Skip {
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

fn write<D: TableDetail>(folder: &Path, path: &Path, metadata: &FileMetadata) -> Result<()> {
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
