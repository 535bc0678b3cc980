//! One column of a row group while it is written: [`Chunk`].

use bytes::Bytes;
use parquet::column::writer::{ColumnCloseResult, ColumnWriter, ColumnWriterImpl, get_column_writer};
use parquet::data_type::{ByteArray, DataType, FixedLenByteArray};
use parquet::errors::{ParquetError, Result};
use parquet::file::properties::WriterPropertiesPtr;
use parquet::schema::types::ColumnDescPtr;

use super::column::{Cell, CellKind, Column, Presence};
use super::pages::Pages;

/// The values of one column in one row group.
pub(super) struct Chunk {
    writer: ColumnWriter<'static>,
    pages: Pages,
    /// The last text, which is reused because neighbouring rows often have the same text.
    last: ByteArray,
    /// The sum of the lengths of long texts, in bytes.
    pub(super) long_bytes: usize,
    /// The number of values that are too large for the column and were written as null.
    pub(super) too_large: usize,
}

impl Chunk {
    pub(super) fn new(description: ColumnDescPtr, properties: WriterPropertiesPtr) -> Self {
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
    pub(super) fn append<R>(&mut self, column: &Column<R>, rows: &[R]) -> Result<()> {
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
    pub(super) fn close(self) -> Result<(Bytes, ColumnCloseResult)> {
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
) -> Result<()> {
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
