//! Single columns of a Parquet file, read in batches: [`ParquetColumns`].

use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::{ByteArray, DataType};
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData};
use parquet::file::serialized_reader::SerializedPageReader;

use super::super::cells::PathStep;
use super::parquet::{Footer, bytes, check_codecs, corrupt_file, open};
use super::refuse_lfs_pointer;
use darkqa_base::error::{Error, Result};
use darkqa_base::files::guarded;
use darkqa_base::types::text::excerpt;

/// Rows that are decoded together (chosen).
const BATCH_ROWS: usize = 8192;

/// Maximum number of rows of a file (chosen): a compressed file of a few bytes can state billions of rows.
const MAX_ROWS: u64 = 5_000_000;

/// Maximum number of characters that are kept of a text (chosen).
const MAX_TEXT_CHARS: usize = 2_000;

/// A Parquet file of which single columns are read. Other columns, whatever their size, are not decoded.
#[derive(Debug)]
pub struct ParquetColumns {
    path: PathBuf,
    footer: Footer,
    metadata: Arc<ParquetMetaData>,
}

/// Consecutive rows of a row group.
#[derive(Debug)]
pub struct ColumnBatch {
    /// Number of the row group.
    pub group: usize,
    /// Index in the row group of the first row.
    pub first_row: usize,
    /// Values of each requested column, one a row; NaN for a null.
    pub numbers: Vec<Vec<f64>>,
}

impl ParquetColumns {
    /// Opens a file.
    ///
    /// # Errors
    /// If the file cannot be read, is not a whole Parquet file, or has too many rows.
    pub fn open(path: &Path) -> Result<Self> {
        refuse_lfs_pointer(path)?;
        let footer = Footer::default();
        let metadata = footer.metadata(path)?;
        check_codecs(path, &metadata)?;
        let rows = metadata
            .row_groups()
            .iter()
            .map(|group| u64::try_from(group.num_rows()).unwrap_or(u64::MAX))
            .fold(0, u64::saturating_add);
        if rows > MAX_ROWS {
            let problem = format_args!("{rows} rows; at most {MAX_ROWS} in a file are read");
            return Err(Error::data(path.display(), problem));
        }
        Ok(Self { path: path.to_owned(), footer, metadata })
    }

    /// Names of the columns, in their order.
    pub fn names(&self) -> Vec<&str> {
        let schema = self.metadata.file_metadata().schema();
        schema.is_group().then(|| schema.get_fields().iter().map(|field| field.name())).into_iter().flatten().collect()
    }

    /// Reads columns of numbers, batch by batch.
    ///
    /// # Errors
    /// If the file lacks a column or is damaged, or `add` fails.
    pub fn numbers(&self, columns: &[&str], mut add: impl FnMut(ColumnBatch) -> Result<()>) -> Result<()> {
        for group in 0..self.metadata.row_groups().len() {
            let mut readers =
                columns.iter().map(|column| self.reader(group, column)).collect::<Result<Vec<LeafReader>>>()?;
            let mut first_row = 0;
            loop {
                let numbers = guarded(|| {
                    readers.iter_mut().map(LeafReader::next_numbers).collect::<Result<Vec<Vec<f64>>, String>>()
                })
                .map_err(|problem| corrupt_file(&self.path, &problem))?;
                let rows = numbers.first().map_or(0, Vec::len);
                if numbers.iter().any(|column| column.len() != rows) {
                    let problem = "its columns have different numbers of rows";
                    return Err(corrupt_file(&self.path, problem));
                }
                if rows == 0 {
                    break;
                }
                add(ColumnBatch { group, first_row, numbers })?;
                first_row += rows;
            }
        }
        Ok(())
    }

    /// Reads a column of texts, one a row; `None` for a null. Long texts are cut.
    ///
    /// # Errors
    /// If the file lacks the column, has more than `max_rows` rows, or is damaged.
    pub fn texts(&self, column: &str, max_rows: usize) -> Result<Vec<Option<String>>> {
        let mut texts = Vec::new();
        for group in 0..self.metadata.row_groups().len() {
            let mut reader = self.reader(group, column)?;
            loop {
                let batch = guarded(|| reader.next_texts()).map_err(|problem| corrupt_file(&self.path, &problem))?;
                if batch.is_empty() {
                    break;
                }
                texts.extend(batch);
                if texts.len() > max_rows {
                    let problem = format_args!("more than {max_rows} rows");
                    return Err(Error::data(self.path.display(), problem));
                }
            }
        }
        Ok(texts)
    }

    /// Reads the bytes of an image in a column of the type `struct<bytes, path>`. `row` counts from the start of the
    /// row group.
    ///
    /// # Errors
    /// If the file lacks the column or is damaged, or the bytes are null.
    pub fn image(&self, column: &str, group: usize, row: usize) -> Result<Vec<u8>> {
        let field = [PathStep::Field("bytes".to_owned())];
        bytes(&self.path, &self.footer, group, row, column, &field)
    }

    /// Reader of a column of single values in a row group.
    fn reader(&self, group: usize, column: &str) -> Result<LeafReader> {
        let row_group = self.metadata.row_group(group);
        let chunk = row_group
            .columns()
            .iter()
            .find(|chunk| {
                // A list could hold any number of values in a row.
                chunk.column_path().parts() == [column] && chunk.column_descr().max_rep_level() == 0
            })
            .ok_or_else(|| {
                let problem = format_args!("no column {column:?} of single values");
                Error::data(self.path.display(), problem)
            })?;
        let file = open(&self.path)?;
        guarded(|| LeafReader::open(file, chunk, row_group.num_rows()))
            .map_err(|problem| corrupt_file(&self.path, &problem))
    }
}

/// Reader of a leaf column in a row group.
struct LeafReader {
    column: String,
    reader: ColumnReader,
    /// Definition level of a value that is not null.
    max_definition: i16,
}

impl LeafReader {
    fn open(file: std::fs::File, chunk: &ColumnChunkMetaData, rows: i64) -> Result<Self, String> {
        let rows = usize::try_from(rows).unwrap_or(0);
        let pages = SerializedPageReader::new(Arc::new(file), chunk, rows, None).map_err(|e| e.to_string())?;
        Ok(Self {
            column: chunk.column_path().string(),
            reader: get_column_reader(chunk.column_descr_ptr(), Box::new(pages)),
            max_definition: chunk.column_descr().max_def_level(),
        })
    }

    /// The next rows of a column of numbers; empty at the end.
    fn next_numbers(&mut self) -> Result<Vec<f64>, String> {
        let max_definition = self.max_definition;
        let rows = match &mut self.reader {
            ColumnReader::Int32ColumnReader(reader) => next_rows(reader, max_definition, |value| f64::from(*value)),
            // Exact up to 2⁵³; indices are smaller.
            ColumnReader::Int64ColumnReader(reader) => next_rows(reader, max_definition, |value| *value as f64),
            ColumnReader::FloatColumnReader(reader) => next_rows(reader, max_definition, |value| f64::from(*value)),
            ColumnReader::DoubleColumnReader(reader) => next_rows(reader, max_definition, |value| *value),
            _ => Err(format!("the column {:?} has no numbers", self.column)),
        }?;
        Ok(rows.into_iter().map(|value| value.unwrap_or(f64::NAN)).collect())
    }

    /// The next rows of a column of texts; empty at the end.
    fn next_texts(&mut self) -> Result<Vec<Option<String>>, String> {
        let max_definition = self.max_definition;
        match &mut self.reader {
            ColumnReader::ByteArrayColumnReader(reader) => next_rows(reader, max_definition, |value: &ByteArray| {
                excerpt(&String::from_utf8_lossy(value.data()), MAX_TEXT_CHARS)
            }),
            _ => Err(format!("the column {:?} has no texts", self.column)),
        }
    }
}

/// Reads a batch of rows of a column that is no list.
fn next_rows<T: DataType, V>(
    reader: &mut ColumnReaderImpl<T>,
    max_definition: i16,
    convert: impl Fn(&T::T) -> V,
) -> Result<Vec<Option<V>>, String> {
    let (mut definitions, mut values) = (Vec::new(), Vec::new());
    reader.read_records(BATCH_ROWS, Some(&mut definitions), None, &mut values).map_err(|e| e.to_string())?;
    if definitions.is_empty() {
        return Ok(values.iter().map(|value| Some(convert(value))).collect());
    }
    let mut values = values.iter();
    Ok(definitions
        .iter()
        .map(|level| {
            let value = (*level == max_definition).then(|| values.next()).flatten();
            value.map(&convert)
        })
        .collect())
}
