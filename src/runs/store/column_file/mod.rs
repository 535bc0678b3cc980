//! Writer of a table as a Parquet file, one row group at a time: [`ColumnFile`].

mod chunk;
mod column;
mod metadata;
mod pages;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{WriterProperties, WriterPropertiesPtr};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnPath, Type};
use rayon::prelude::*;

use self::chunk::Chunk;
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{create_new, unfinished};

pub use self::column::{Cell, CellKind, Column, Presence};
pub use self::metadata::{CREATED_BY, FileMetadata};

/// Size limits of a row group, which is kept in memory until it is complete.
#[derive(Debug, Clone, Copy)]
struct GroupLimits {
    rows: usize,
    /// Bytes of long texts, before compression.
    long_bytes: usize,
}

/// Limits of a row group: about a million rows, a common size, or 256 MiB of long texts; chosen.
const LIMITS: GroupLimits = GroupLimits { rows: 1 << 20, long_bytes: 256 << 20 };

/// A writer of a table with rows of type `R`. The file has a temporary name until it is complete.
pub struct ColumnFile<'c, R> {
    path: PathBuf,
    part: PathBuf,
    columns: &'c [Column<R>],
    file: SerializedFileWriter<File>,
    properties: WriterPropertiesPtr,
    group: Vec<Chunk>,
    rows: usize,
    limits: GroupLimits,
    too_large: BTreeMap<&'static str, usize>,
}

impl<'c, R: Sync> ColumnFile<'c, R> {
    /// Creates a file with these metadata.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn create(path: &Path, columns: &'c [Column<R>], metadata: &FileMetadata) -> Result<Self> {
        let part = unfinished(path);
        let file = create_new(&part).map_err(|e| Error::file(&part, "write", e))?;
        let properties = Arc::new(properties(columns, metadata));
        let file = columns
            .iter()
            .map(Column::field)
            .collect::<std::result::Result<Vec<_>, _>>()
            .and_then(|fields| Type::group_type_builder("records").with_fields(fields).build())
            .and_then(|schema| SerializedFileWriter::new(file, Arc::new(schema), Arc::clone(&properties)))
            .map_err(|e| unwritable(&part, e))?;
        Ok(Self {
            file,
            path: path.to_owned(),
            part,
            columns,
            properties,
            group: Vec::new(),
            rows: 0,
            limits: LIMITS,
            too_large: BTreeMap::new(),
        })
    }

    /// Appends rows; the columns are written in parallel.
    ///
    /// # Errors
    /// If a row does not fit the columns, or the file cannot be written.
    pub fn append(&mut self, mut rows: &[R]) -> Result<()> {
        while !rows.is_empty() {
            if self.group.is_empty() {
                self.group = self
                    .file
                    .schema_descr()
                    .columns()
                    .iter()
                    .map(|column| Chunk::new(Arc::clone(column), Arc::clone(&self.properties)))
                    .collect();
            }
            let (now, later) = rows.split_at(rows.len().min(self.limits.rows - self.rows));
            let appended: std::result::Result<(), ParquetError> =
                self.group.par_iter_mut().zip(self.columns).map(|(chunk, column)| chunk.append(column, now)).collect();
            appended.map_err(|e| unwritable(&self.part, e))?;
            self.rows += now.len();
            let long: usize = self.group.iter().map(|chunk| chunk.long_bytes).sum();
            if self.rows == self.limits.rows || long >= self.limits.long_bytes {
                self.end_group().map_err(|e| unwritable(&self.part, e))?;
            }
            rows = later;
        }
        Ok(())
    }

    fn end_group(&mut self) -> std::result::Result<(), ParquetError> {
        self.rows = 0;
        let chunks = std::mem::take(&mut self.group);
        for (chunk, column) in chunks.iter().zip(self.columns) {
            if chunk.too_large > 0 {
                *self.too_large.entry(column.name).or_default() += chunk.too_large;
            }
        }
        let closed: std::result::Result<Vec<_>, _> = chunks.into_par_iter().map(Chunk::close).collect();
        let mut group = self.file.next_row_group()?;
        for (pages, closed) in closed? {
            group.append_column(&pages, closed)?;
        }
        group.close().map(drop)
    }

    /// Completes the file and renames it to its path. Returns the number of values that were too large for their column
    /// and are null, by column.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(mut self) -> Result<BTreeMap<&'static str, usize>> {
        let ended = if self.group.is_empty() { Ok(()) } else { self.end_group() };
        ended.and_then(|()| self.file.close()).map_err(|e| unwritable(&self.part, e))?;
        fs::rename(&self.part, &self.path).map_err(|e| Error::file(&self.path, "write", e))?;
        Ok(self.too_large)
    }
}

/// Writer settings: Snappy compression, which every reader supports, and dictionaries except for keys, which are
/// unique.
fn properties<R>(columns: &[Column<R>], metadata: &FileMetadata) -> WriterProperties {
    let pairs = metadata.pairs.iter().map(|(key, value)| KeyValue::new(key.clone(), value.clone()));
    let mut properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(metadata.created_by.clone())
        .set_key_value_metadata(Some(pairs.collect()));
    for column in columns {
        if column.kind == CellKind::Key {
            let path = ColumnPath::from(column.name);
            properties = properties.set_column_dictionary_enabled(path, false);
        }
    }
    properties.build()
}

fn unwritable(path: &Path, error: ParquetError) -> Error {
    let error = match error {
        ParquetError::External(error) => std::io::Error::other(error),
        other => std::io::Error::other(other),
    };
    Error::file(path, "write", error)
}

#[cfg(test)]
mod tests;
