//! `records.parquet`: the records of a run as a table for other programs, made from the log, which stays the truth: [`update`].

mod choice;
mod common;
mod open;
mod places;
mod row;

use std::path::Path;

use rayon::prelude::*;

use self::places::places;
use self::row::{Row, Rows, Tabled};
use crate::error::Result;
use crate::runs::outcome::RecordTable;
use crate::runs::stored::{ExperimentKind, manifest};
use crate::store::{
    CREATED_BY, ColumnFile, FileMetadata, LinePlace, LogMark, RecordLog, each_question,
};
use crate::types::{ChoiceDetail, OpenDetail, Record};

/// The name of the file.
pub(crate) const RECORDS_PARQUET: &str = "records.parquet";
/// The most records that are read at once. Chosen: enough for all cores.
const RECORDS_AT_ONCE: usize = 1 << 14;
/// The most bytes of records that are read at once; more only if one record has more. Chosen.
const BYTES_AT_ONCE: usize = 16 << 20;

/// Writes the table of the run in a folder, unless the one that is there is as new as the log. The records are not held in memory.
///
/// # Errors
/// If a record is broken, or the file cannot be written.
pub(crate) fn update(folder: &Path, table: RecordTable) -> Result<()> {
    match ExperimentKind::of(folder)? {
        ExperimentKind::Choice => update_of::<ChoiceDetail>(folder, table),
        ExperimentKind::Open => update_of::<OpenDetail>(folder, table),
    }
}

fn update_of<D: Tabled>(folder: &Path, table: RecordTable) -> Result<()> {
    let path = folder.join(RECORDS_PARQUET);
    let name = ("darkqa.schema", D::TABLE.to_owned());
    let pairs = LogMark::of(folder)?.pairs().into_iter().chain([name]);
    let metadata = FileMetadata {
        created_by: CREATED_BY.to_owned(),
        pairs: pairs.map(|(key, value)| (key.to_owned(), value)).collect(),
    };
    if FileMetadata::of(&path)?.as_ref() == Some(&metadata) {
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
    let manifest = manifest(folder)?;
    let mut questions = Vec::new();
    each_question(folder, |question| {
        questions.push(question.without_evidence());
    })?;
    let places = places(folder, &manifest, &questions)?;
    let mut rows = Rows::<D>::new(folder, &manifest, &questions)?;
    let log = RecordLog::open(folder)?;
    let columns = D::columns();
    let mut file = ColumnFile::create(path, &columns, metadata)?;
    let mut rest = &*places;
    while !rest.is_empty() {
        let (now, later) = rest.split_at(at_once(rest));
        let lines = log.lines(now)?;
        let records = lines.par_iter().map(|line| log.record::<D>(line));
        let records: Result<Vec<Record<D>>> = records.collect();
        let now: Vec<Row<D>> = records?
            .into_iter()
            .filter_map(|record| rows.row(record))
            .collect();
        file.append(&now)?;
        rest = later;
    }
    for (column, count) in file.finish()? {
        tracing::warn!(
            "{}: numbers that are too large for the column {column}, and are null in it: {count}; records.jsonl has them",
            path.display()
        );
    }
    Ok(())
}

/// How many of these records are read at once.
fn at_once(places: &[LinePlace]) -> usize {
    let mut bytes = 0;
    let fits = places.iter().take(RECORDS_AT_ONCE).take_while(|place| {
        bytes += place.length;
        bytes <= BYTES_AT_ONCE
    });
    fits.count().max(1)
}
