//! Writer of a table as a Parquet file, one row group at a time: [`ColumnFile`].
//!
//! One column of a row group while it is written: [`Chunk`].
//!
//! A column of a Parquet file, and its values: [`Column`], [`Cell`].
//!
//! [`FileMetadata`]: the metadata of a Parquet file.
//!
//! [`Pages`]: the compressed pages of one column in one row group, in memory.

#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use bytes::Bytes;
use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, Type as PhysicalType};
use parquet::column::page::{CompressedPage, PageWriteSpec, PageWriter};
use parquet::column::writer::{ColumnCloseResult, ColumnWriter, ColumnWriterImpl, get_column_writer};
use parquet::data_type::{ByteArray, DataType, FixedLenByteArray};
use parquet::errors::{self, ParquetError};
use parquet::file::metadata::{KeyValue, ParquetMetaDataReader};
use parquet::file::properties::{WriterProperties, WriterPropertiesPtr};
use parquet::file::writer::{SerializedFileWriter, SerializedPageWriter, TrackedWrite};
use parquet::schema::types::{ColumnDescPtr, ColumnPath, Type, TypePtr};
use rayon::prelude::*;

use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, create_new, guarded, unfinished};

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

/// The values of one column in one row group.
pub(super) struct Chunk {
    writer: ColumnWriter<'static>,
    pages: Pages,
    /// The last text, which is reused because neighbouring rows often have the same text.
    last: ByteArray,
    /// The sum of the lengths of long texts, in bytes.
    long_bytes: usize,
    /// The number of values that are too large for the column and were written as null.
    too_large: usize,
}

impl Chunk {
    fn new(description: ColumnDescPtr, properties: WriterPropertiesPtr) -> Self {
        let pages = Pages::new();
        Self {
            writer: get_column_writer(description, properties, Box::new(pages.clone())),
            pages,
            last: ByteArray::from(""),
            long_bytes: 0,
            too_large: 0,
        }
    }

    /// Appends the values of these rows.
    ///
    /// # Errors
    /// If a value is missing or has another type than the column.
    fn append<R>(&mut self, column: &Column<R>, rows: &[R]) -> errors::Result<()> {
        match &mut self.writer {
            ColumnWriter::Int32ColumnWriter(writer) => {
                let too_large = &mut self.too_large;
                write(writer, column, rows, |cell| match cell {
                    Cell::Int(number) => {
                        let stored = column.kind.to_stored(number);
                        *too_large += usize::from(stored.is_none());
                        Ok(stored)
                    }
                    other => Err(other),
                })
            }
            ColumnWriter::DoubleColumnWriter(writer) => write(writer, column, rows, |cell| match cell {
                Cell::Double(number) => Ok(Some(number)),
                other => Err(other),
            }),
            ColumnWriter::BoolColumnWriter(writer) => write(writer, column, rows, |cell| match cell {
                Cell::Bool(value) => Ok(Some(value)),
                other => Err(other),
            }),
            ColumnWriter::ByteArrayColumnWriter(writer) => {
                let (last, long_bytes) = (&mut self.last, &mut self.long_bytes);
                write(writer, column, rows, |cell| match cell {
                    Cell::Text(text) => {
                        if column.kind == CellKind::LongText {
                            *long_bytes += text.len();
                        }
                        if last.data() != text.as_bytes() {
                            *last = ByteArray::from(text.into_owned().into_bytes());
                        }
                        Ok(Some(last.clone()))
                    }
                    other => Err(other),
                })
            }
            ColumnWriter::FixedLenByteArrayColumnWriter(writer) => write(writer, column, rows, |cell| match cell {
                Cell::Bytes(bytes) => Ok(Some(FixedLenByteArray::from(bytes.to_vec()))),
                other => Err(other),
            }),
            _ => Err(ParquetError::General(format!("no values of {} are written", column.name))),
        }
    }

    /// Closes the column and returns its pages and its entry for the row group.
    fn close(self) -> errors::Result<(Bytes, ColumnCloseResult)> {
        let closed = self.writer.close()?;
        Ok((self.pages.take_bytes()?, closed))
    }
}

/// Writes the values of these rows. `read` converts a cell into a value, or `None` for null, and returns a cell of
/// another type as an error.
fn write<R, T: DataType>(
    writer: &mut ColumnWriterImpl<'_, T>,
    column: &Column<R>,
    rows: &[R],
    mut read: impl for<'r> FnMut(Cell<'r>) -> std::result::Result<Option<T::T>, Cell<'r>>,
) -> errors::Result<()> {
    let mut values = Vec::with_capacity(rows.len());
    let mut present = Vec::with_capacity(rows.len());
    for row in rows {
        let value = match (column.value)(row) {
            Cell::Null => None,
            cell => read(cell).map_err(|other| {
                let name = column.name;
                ParquetError::General(format!("{other:?} is not a value of the column {name}"))
            })?,
        };
        if value.is_none() && column.presence == Presence::Always {
            let name = column.name;
            let problem = format!("a row has no value in the column {name}");
            return Err(ParquetError::General(problem));
        }
        present.push(i16::from(value.is_some()));
        values.extend(value);
    }
    let present = (column.presence == Presence::MayBeNull).then_some(&*present);
    writer.write_batch(&values, present, None).map(drop)
}

/// A column of a table whose rows are `R`.
pub struct Column<R> {
    /// The name in the file.
    pub name: &'static str,
    /// The type of the values.
    pub kind: CellKind,
    /// Whether a value may be null.
    pub presence: Presence,
    /// Returns the value of a row.
    pub value: for<'r> fn(&'r R) -> Cell<'r>,
}

/// The type of the values of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellKind {
    /// A text that many rows share, such as a name.
    Text,
    /// A text of any length, which counts against the size of a row group.
    LongText,
    /// 16 bytes that are unique to the row.
    Key,
    /// 32 bytes.
    Digest,
    /// A signed integer of 8 bits.
    Int8,
    /// A signed integer of 16 bits.
    Int16,
    /// A signed integer of 32 bits.
    Int32,
    /// A floating-point number of 64 bits.
    Double,
    /// True or false.
    Bool,
}

/// Whether a value may be null.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Presence {
    /// Every row has a value.
    Always,
    /// Some rows may have none.
    MayBeNull,
}

/// The value of a row in a column.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell<'r> {
    /// No value.
    Null,
    /// A value of [`CellKind::Text`] and [`CellKind::LongText`].
    Text(Cow<'r, str>),
    /// A value of [`CellKind::Key`] and [`CellKind::Digest`].
    Bytes(&'r [u8]),
    /// A value of the kinds of integers.
    Int(i128),
    /// A value of [`CellKind::Double`].
    Double(f64),
    /// A value of [`CellKind::Bool`].
    Bool(bool),
}

impl<'r> Cell<'r> {
    /// A borrowed text; null for `None`.
    pub fn text(text: Option<&'r str>) -> Self {
        text.map_or(Self::Null, |text| Self::Text(text.into()))
    }

    /// An integer; null for `None`.
    pub fn int<T: TryInto<i128>>(number: Option<T>) -> Self {
        number.and_then(|number| number.try_into().ok()).map_or(Self::Null, Self::Int)
    }
}

impl CellKind {
    /// The number of bits of an integer kind; `None` for other kinds.
    fn bits(self) -> Option<u32> {
        match self {
            Self::Int8 => Some(8),
            Self::Int16 => Some(16),
            Self::Int32 => Some(32),
            _ => None,
        }
    }

    /// Converts a number to the stored type; `None` if it does not fit into the column.
    fn to_stored(self, number: i128) -> Option<i32> {
        let max = (1_i128 << (self.bits()? - 1)) - 1;
        (-max - 1..=max).contains(&number).then_some(number as i32)
    }
}

impl<R> Column<R> {
    /// The column in the schema of the file.
    fn field(&self) -> errors::Result<TypePtr> {
        let (physical, length) = match self.kind {
            CellKind::Text | CellKind::LongText => (PhysicalType::BYTE_ARRAY, 0),
            CellKind::Key => (PhysicalType::FIXED_LEN_BYTE_ARRAY, 16),
            CellKind::Digest => (PhysicalType::FIXED_LEN_BYTE_ARRAY, 32),
            CellKind::Int8 | CellKind::Int16 | CellKind::Int32 => (PhysicalType::INT32, 0),
            CellKind::Double => (PhysicalType::DOUBLE, 0),
            CellKind::Bool => (PhysicalType::BOOLEAN, 0),
        };
        let (logical, converted) = match self.kind {
            CellKind::Text | CellKind::LongText => (Some(LogicalType::String), ConvertedType::UTF8),
            CellKind::Int8 => (Some(LogicalType::integer(8, true)), ConvertedType::INT_8),
            CellKind::Int16 => (Some(LogicalType::integer(16, true)), ConvertedType::INT_16),
            _ => (None, ConvertedType::NONE),
        };
        let repetition = match self.presence {
            Presence::Always => Repetition::REQUIRED,
            Presence::MayBeNull => Repetition::OPTIONAL,
        };
        Type::primitive_type_builder(self.name, physical)
            .with_repetition(repetition)
            .with_length(length)
            .with_logical_type(logical)
            .with_converted_type(converted)
            .build()
            .map(Arc::new)
    }
}

/// Value of `created_by` in the Parquet files of this program.
pub const CREATED_BY: &str = concat!("darkqa-eval version ", env!("CARGO_PKG_VERSION"));

/// The metadata of a Parquet file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileMetadata {
    /// The program that wrote the file.
    pub created_by: String,
    /// Custom metadata: values by key.
    pub pairs: BTreeMap<String, String>,
}

impl FileMetadata {
    /// Reads the metadata of a file; `None` if the file does not exist or is not a complete Parquet file.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(path: &Path) -> Result<Option<Self>> {
        let file = match files::open(path) {
            Ok(file) => file,
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Error::file(path, "read", e)),
        };
        let footer = guarded(|| {
            let mut reader = ParquetMetaDataReader::new();
            reader.try_parse(&file).and_then(|()| reader.finish()).map_err(|e| e.to_string())
        });
        let Ok(footer) = footer else {
            return Ok(None);
        };
        let footer = footer.file_metadata();
        let pairs = footer
            .key_value_metadata()
            .into_iter()
            .flatten()
            .filter_map(|pair| Some((pair.key.clone(), pair.value.clone()?)))
            .collect();
        Ok(Some(Self { created_by: footer.created_by().unwrap_or_default().to_owned(), pairs }))
    }
}

/// The compressed pages of a column, shared by its writer and the row group. They are kept in memory, because all
/// columns of a row group grow at once, but the file contains one column after the other.
#[derive(Clone)]
pub(super) struct Pages(Arc<Mutex<TrackedWrite<Vec<u8>>>>);

impl Pages {
    fn new() -> Self {
        Self(Arc::new(Mutex::new(TrackedWrite::new(Vec::new()))))
    }

    /// Takes the bytes written so far.
    fn take_bytes(&self) -> errors::Result<Bytes> {
        let mut pages = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let pages = std::mem::replace(&mut *pages, TrackedWrite::new(Vec::new()));
        pages.into_inner().map(Bytes::from)
    }
}

impl PageWriter for Pages {
    fn write_page(&mut self, page: CompressedPage) -> errors::Result<PageWriteSpec> {
        let mut pages = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        SerializedPageWriter::new(&mut pages).write_page(page)
    }

    fn close(&mut self) -> errors::Result<()> {
        Ok(())
    }
}
