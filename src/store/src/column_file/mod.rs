//! A table that is written as one Parquet file, row group by row group: [`ColumnFile`].

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
use darkqa_ground::error::{Error, Result};
use darkqa_ground::files::{create_new, unfinished};

pub use self::column::{Cell, CellKind, Column, Presence};
pub use self::metadata::{CREATED_BY, FileMetadata};

/// How large a row group may become, which is in memory until it ends.
#[derive(Debug, Clone, Copy)]
struct GroupLimits {
    rows: usize,
    /// Bytes of long texts, before compression.
    long_bytes: usize,
}

/// Chosen: a million rows, as readers like them, or as many as have 256 MB of long texts.
const LIMITS: GroupLimits = GroupLimits {
    rows: 1 << 20,
    long_bytes: 256 << 20,
};

/// A table whose rows are `R`. The file has its name only once it is complete.
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
    /// Begins a file at a path, with these metadata.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn create(path: &Path, columns: &'c [Column<R>], metadata: &FileMetadata) -> Result<Self> {
        let part = unfinished(path);
        let file = create_new(&part).map_err(|e| Error::file(&part, "write", e))?;
        let wrong = |e: ParquetError| unwritable(&part, e);
        let properties = Arc::new(properties(columns, metadata));
        let fields: std::result::Result<Vec<_>, _> = columns.iter().map(Column::field).collect();
        let schema = Type::group_type_builder("records")
            .with_fields(fields.map_err(wrong)?)
            .build()
            .map_err(wrong)?;
        let file = SerializedFileWriter::new(file, Arc::new(schema), Arc::clone(&properties));
        Ok(Self {
            file: file.map_err(wrong)?,
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

    /// Appends rows, the columns on all cores.
    ///
    /// # Errors
    /// If a row does not fit the columns, or the file cannot be written.
    pub fn append(&mut self, mut rows: &[R]) -> Result<()> {
        while !rows.is_empty() {
            if self.group.is_empty() {
                let columns = self.file.schema_descr().columns().iter();
                self.group = columns
                    .map(|column| Chunk::new(Arc::clone(column), Arc::clone(&self.properties)))
                    .collect();
            }
            let (now, later) = rows.split_at(rows.len().min(self.limits.rows - self.rows));
            let appended: std::result::Result<(), ParquetError> = self
                .group
                .par_iter_mut()
                .zip(self.columns)
                .map(|(chunk, column)| chunk.append(column, now))
                .collect();
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
        let closed: std::result::Result<Vec<_>, _> =
            chunks.into_par_iter().map(Chunk::close).collect();
        let mut group = self.file.next_row_group()?;
        for (pages, closed) in closed? {
            group.append_column(&pages, closed)?;
        }
        group.close().map(drop)
    }

    /// Ends the file and gives it its name. Returns how many numbers were too large for their columns, and are null.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(mut self) -> Result<BTreeMap<&'static str, usize>> {
        let ended = if self.group.is_empty() {
            Ok(())
        } else {
            self.end_group()
        };
        ended
            .and_then(|()| self.file.close())
            .map_err(|e| unwritable(&self.part, e))?;
        fs::rename(&self.part, &self.path).map_err(|e| Error::file(&self.path, "write", e))?;
        Ok(self.too_large)
    }
}

/// Snappy, which every reader has; dictionaries for all but keys, which have no value twice.
fn properties<R>(columns: &[Column<R>], metadata: &FileMetadata) -> WriterProperties {
    let pairs = metadata
        .pairs
        .iter()
        .map(|(key, value)| KeyValue::new(key.clone(), value.clone()));
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
