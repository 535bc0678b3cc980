//! Reader of Parquet files of data sets.
//!
//! [`read()`] decodes every row once, for a table that keeps only the digests of images. [`bytes()`] later reads one
//! image: it skips the pages before the image by their headers.
//!
//! Names of the classes in a Parquet file that the library `datasets` of Hugging Face wrote: [`ClassLabels`].

use std::cell::RefCell;
use std::collections::HashMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use parquet::basic::Compression;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::{ByteArray, ByteArrayType};
use parquet::file::metadata::{FileMetaData, ParquetMetaData, ParquetMetaDataReader, RowGroupMetaData};
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::file::serialized_reader::SerializedPageReader;
use parquet::record::{Field, Row as Record};
use serde_json::Value;

use super::super::cells::{MAX_ROWS, PathStep, RowPlace, SetRows, parse_list, too_many_rows};
use super::json::MAX_ROW_BYTES;
use crate::ready_made::cells::Cell;
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, guarded};
use darkqa_base::types::shell_word;

/// Rows that are decoded together; the images of all of them are in memory at once.
const BATCH_ROWS: usize = 8;

pub(super) fn open(path: &Path) -> Result<File> {
    files::open(path).map_err(|e| Error::file(path, "read", e))
}

/// Footer of a Parquet file, parsed on first use.
#[derive(Debug, Default)]
pub(super) struct Footer(OnceLock<Arc<ParquetMetaData>>);

impl Footer {
    pub(super) fn metadata(&self, path: &Path) -> Result<Arc<ParquetMetaData>> {
        if let Some(known) = self.0.get() {
            return Ok(Arc::clone(known));
        }
        let file = open(path)?;
        let footer = guarded(|| {
            let mut reader = ParquetMetaDataReader::new();
            reader.try_parse(&file).and_then(|()| reader.finish()).map_err(|e| e.to_string())
        });
        let footer = footer.map_err(|problem| corrupt_file(path, &problem))?;
        Ok(Arc::clone(self.0.get_or_init(|| Arc::new(footer))))
    }
}

/// Error for a file that the Parquet library cannot read.
pub(super) fn corrupt_file(path: &Path, problem: &str) -> Error {
    let problem = problem.trim_start_matches("Parquet error: ");
    Error::data(path.display(), format_args!("not a whole Parquet file: {problem}; download or write it again"))
}

/// The number of rows in a file, from its footer.
pub(super) fn count(path: &Path) -> Result<u64> {
    let rows = Footer::default().metadata(path)?.file_metadata().num_rows();
    Ok(u64::try_from(rows).unwrap_or(0))
}

/// Appends the rows of a file to a table.
///
/// # Errors
/// If the file is corrupt, a compression codec is not supported, or there are too many rows or too many bytes in a row.
pub(super) fn read(path: &Path, footer: &Footer, table: &mut SetRows) -> Result<()> {
    let metadata = footer.metadata(path)?;
    check_codecs(path, &metadata)?;
    // The footer has the number of rows: reject a large file before reading any row.
    let stated = metadata.file_metadata().num_rows();
    if usize::try_from(stated).is_ok_and(|rows| rows > MAX_ROWS) {
        return Err(Error::data(path.display(), too_many_rows()));
    }
    let labels = ClassLabels::new(metadata.file_metadata());
    let file = open(path)?;
    let mut columns: Vec<(String, usize)> = Vec::new();
    let mut too_long = None;
    let mut add_row = |place: RowPlace, record: Record| -> Result<(), String> {
        let size: usize = record.get_column_iter().map(|(_, field)| byte_length(field)).sum();
        if size > MAX_ROW_BYTES {
            let problem = format!("more than {} MB in a row", MAX_ROW_BYTES >> 20);
            too_long = Some((place, problem.clone()));
            return Err(problem);
        }
        let mut cells = Vec::new();
        for (index, (name, field)) in record.into_columns().into_iter().enumerate() {
            if columns.get(index).is_none_or(|(known, _)| *known != name) {
                let column = table.add_column(&name)?;
                columns.truncate(index);
                columns.push((name, column));
            }
            let (name, column) = &columns[index];
            cells.push((*column, labels.named(name, convert_field(field))));
        }
        table.push(place, cells)
    };
    guarded(|| {
        let reader = SerializedFileReader::new(file).map_err(|e| e.to_string())?;
        let mut number = 0;
        for group in 0..reader.num_row_groups() {
            let rows = reader.get_row_group(group).map_err(|e| e.to_string())?;
            let records = parquet::record::reader::TreeBuilder::new()
                .with_batch_size(BATCH_ROWS)
                .as_iter(reader.metadata().file_metadata().schema_descr_ptr(), &*rows)
                .map_err(|e| e.to_string())?;
            for (row, record) in records.enumerate() {
                number += 1;
                let record = record.map_err(|e| format!("row {number}: {e}"))?;
                add_row(RowPlace::Parquet { group, row, number }, record)?;
            }
        }
        Ok(())
    })
    .map_err(|problem| match too_long {
        Some((row, problem)) => Error::data(format_args!("{}, {row}", path.display()), problem),
        None => corrupt_file(path, &problem),
    })
}

/// Size of a value in bytes; numbers count as 8.
fn byte_length(field: &Field) -> usize {
    match field {
        Field::Null => 0,
        Field::Str(text) => text.len(),
        Field::Bytes(bytes) => bytes.len(),
        Field::Group(record) => record.get_column_iter().map(|(_, field)| byte_length(field)).sum(),
        Field::ListInternal(list) => list.elements().iter().map(byte_length).sum(),
        Field::MapInternal(map) => map.entries().iter().map(|(key, value)| byte_length(key) + byte_length(value)).sum(),
        _ => size_of::<u64>(),
    }
}

/// Rejects a file with a compression codec that is not supported.
pub(super) fn check_codecs(path: &Path, footer: &ParquetMetaData) -> Result<()> {
    let columns = footer.row_groups().iter().flat_map(RowGroupMetaData::columns);
    for column in columns {
        let codec = column.compression();
        let is_supported = matches!(
            codec,
            Compression::UNCOMPRESSED | Compression::SNAPPY | Compression::GZIP(_) | Compression::ZSTD(_)
        );
        if !is_supported {
            let problem = format!(
                "the column {:?} is compressed by {codec}, which is not read; write it again, as again.parquet: python -c \"import sys, pyarrow.parquet as p; p.write_table(p.read_table(sys.argv[1]), 'again.parquet')\" {}",
                column.column_path().string(),
                shell_word(&path.to_string_lossy())
            );
            return Err(Error::data(path.display(), problem));
        }
    }
    Ok(())
}

/// Converts a Parquet value to a cell. NaN is an absent cell; types without a cell of their own become text.
fn convert_field(field: Field) -> Cell {
    match field {
        Field::Null => Cell::Absent,
        Field::Bool(is_true) => Cell::Bool(is_true),
        Field::Str(text) => Cell::Text(text),
        Field::Bytes(bytes) => Cell::Bytes(bytes.data().into()),
        Field::Float(value) if value.is_nan() => Cell::Absent,
        Field::Double(value) if value.is_nan() => Cell::Absent,
        Field::Float(value) => number(&value),
        Field::Double(value) => number(&value),
        Field::Byte(value) => number(&value),
        Field::Short(value) => number(&value),
        Field::Int(value) => number(&value),
        Field::Long(value) => number(&value),
        Field::UByte(value) => number(&value),
        Field::UShort(value) => number(&value),
        Field::UInt(value) => number(&value),
        Field::ULong(value) => number(&value),
        Field::Group(record) => Cell::Fields(
            record.into_columns().into_iter().map(|(name, field)| (name.into(), convert_field(field))).collect(),
        ),
        Field::ListInternal(list) => Cell::List(list.elements().iter().cloned().map(convert_field).collect()),
        other => Cell::Text(other.to_string()),
    }
}

fn number(value: &impl ToString) -> Cell {
    Cell::Number(value.to_string().into())
}

/// Reader of one leaf column of a row group. It keeps its position between calls, because the next image is usually a
/// few rows ahead.
struct Cursor {
    path: PathBuf,
    group: usize,
    leaf: usize,
    /// Index in the row group of the next row to read.
    next: usize,
    reader: ColumnReaderImpl<ByteArrayType>,
    /// Definition level of a value that is not null.
    max_definition: i16,
    /// Whether a row can have several values.
    is_list: bool,
}

thread_local! {
    /// Cursor of this thread. One is enough, because a thread reads the images of a file in order.
    static CURSOR: RefCell<Option<Cursor>> = const { RefCell::new(None) };
}

impl Cursor {
    fn open(path: &Path, footer: &ParquetMetaData, group: usize, leaf: usize) -> Result<Self, String> {
        let file = files::open(path).map_err(|e| e.to_string())?;
        let row_group = &footer.row_groups()[group];
        let chunk = &row_group.columns()[leaf];
        let rows = usize::try_from(row_group.num_rows()).unwrap_or(0);
        let pages = SerializedPageReader::new(Arc::new(file), chunk, rows, None).map_err(|e| e.to_string())?;
        let reader = get_column_reader(chunk.column_descr_ptr(), Box::new(pages));
        let ColumnReader::ByteArrayColumnReader(reader) = reader else {
            return Err("no column of bytes".to_owned());
        };
        Ok(Self {
            path: path.to_owned(),
            group,
            leaf,
            next: 0,
            reader,
            max_definition: chunk.column_descr().max_def_level(),
            is_list: chunk.column_descr().max_rep_level() > 0,
        })
    }

    /// True if the row is in the column of the cursor, at or after its position.
    fn can_reach(&self, path: &Path, group: usize, leaf: usize, row: usize) -> bool {
        self.path == path && (self.group, self.leaf) == (group, leaf) && self.next <= row
    }

    /// Reads the value of a row, or one item if the column is a list, and moves past the row.
    fn read_value(&mut self, row: usize, item: usize) -> Result<Vec<u8>, String> {
        self.reader.skip_records(row - self.next).map_err(|e| e.to_string())?;
        self.next = row + 1;
        let (mut definitions, mut repetitions) = (Vec::new(), Vec::new());
        let mut values: Vec<ByteArray> = Vec::new();
        self.reader
            .read_records(1, Some(&mut definitions), Some(&mut repetitions), &mut values)
            .map_err(|e| e.to_string())?;
        let item = if self.is_list { item } else { 0 };
        if definitions.get(item).is_some_and(|level| *level < self.max_definition) {
            return Err("the value is null".to_owned());
        }
        // `values` has no nulls: the index is the number of non-null items before this one.
        let index = if definitions.is_empty() {
            item
        } else {
            definitions.iter().take(item).filter(|level| **level == self.max_definition).count()
        };
        values.get(index).map(|value| value.data().to_vec()).ok_or_else(|| "the value is gone".to_owned())
    }
}

/// Reads the bytes of one value of bytes or text. `row` counts from the start of row group `group`, and `steps` is the
/// path to the value inside the cell of `column`.
///
/// # Errors
/// If the file is corrupt or does not have this value.
pub(super) fn bytes(
    path: &Path,
    footer: &Footer,
    group: usize,
    row: usize,
    column: &str,
    steps: &[PathStep],
) -> Result<Vec<u8>> {
    let footer = footer.metadata(path)?;
    let item = steps.iter().find_map(|step| match step {
        PathStep::Item(at) => Some(*at),
        PathStep::Field(_) => None,
    });
    guarded(|| {
        let columns = footer.row_groups().get(group).ok_or("no such row group")?.columns();
        let leaf = leaf_index(columns, column, steps).ok_or("no such column")?;
        let kept = CURSOR.take().filter(|kept| kept.can_reach(path, group, leaf, row));
        let mut cursor = match kept {
            Some(cursor) => cursor,
            None => Cursor::open(path, &footer, group, leaf)?,
        };
        let value = cursor.read_value(row, item.unwrap_or(0))?;
        let is_list = cursor.is_list;
        CURSOR.set(Some(cursor));
        let Some(item) = item.filter(|_| !is_list) else {
            return Ok(value);
        };
        // The column has no list: the value is a list as text.
        std::str::from_utf8(&value)
            .ok()
            .and_then(parse_list)
            .and_then(|items| items.into_iter().nth(item))
            .map(String::into_bytes)
            .ok_or_else(|| "the value is gone".to_owned())
    })
    .map_err(|problem| corrupt_file(path, &problem))
}

/// Index of the first leaf column under `column` whose path has the fields of `steps` in their order, the last one at
/// its end; any leaf matches if `steps` has no field. Parts of the path between them are the lists of Parquet.
fn leaf_index(
    columns: &[parquet::file::metadata::ColumnChunkMetaData],
    column: &str,
    steps: &[PathStep],
) -> Option<usize> {
    let fields: Vec<&String> = steps
        .iter()
        .filter_map(|step| match step {
            PathStep::Field(name) => Some(name),
            PathStep::Item(_) => None,
        })
        .collect();
    columns.iter().position(|chunk| {
        let Some((first, path)) = chunk.column_path().parts().split_first() else {
            return false;
        };
        let mut parts = path.iter();
        first == column
            && fields.iter().all(|field| parts.any(|part| part == *field))
            && fields.last().is_none_or(|field| path.last() == Some(*field))
    })
}

/// Names of the classes by column. The cells of such a column are the numbers of classes, counted from 0.
#[derive(Debug, Default)]
pub(super) struct ClassLabels(HashMap<String, Vec<String>>);

impl ClassLabels {
    /// Reads the features in the metadata of a file; none if it has no such metadata.
    ///
    /// Classes that are named after columns of the file, as `choice1` and `choice2`, are left out: their numbers select
    /// the column.
    pub(super) fn new(file: &FileMetaData) -> Self {
        let features = file
            .key_value_metadata()
            .into_iter()
            .flatten()
            .find(|entry| entry.key == "huggingface")
            .and_then(|entry| serde_json::from_str::<Value>(entry.value.as_deref()?).ok())
            .unwrap_or_default();
        let features = features.pointer("/info/features").and_then(Value::as_object);
        let columns = file.schema().get_fields();
        let labels = features.into_iter().flatten().filter_map(|(column, feature)| {
            let names: Vec<String> = feature
                .get("names")
                .filter(|_| feature["_type"] == "ClassLabel")?
                .as_array()?
                .iter()
                .map(|name| name.as_str().map(str::to_owned))
                .collect::<Option<_>>()?;
            let are_columns = names.iter().all(|name| columns.iter().any(|column| column.name() == name));
            (!are_columns).then(|| (column.clone(), names))
        });
        Self(labels.collect())
    }

    /// The name of the class in place of its number; other cells are unchanged.
    pub(super) fn named(&self, column: &str, cell: Cell) -> Cell {
        let name = match &cell {
            Cell::Number(number) => {
                self.0.get(column).zip(number.parse::<usize>().ok()).and_then(|(names, number)| names.get(number))
            }
            _ => None,
        };
        name.map_or(cell, |name| Cell::Text(name.clone()))
    }
}
