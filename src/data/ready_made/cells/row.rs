//! The rows of a ready-made set: [`Table`].

use std::collections::{BTreeSet, HashMap};
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use csv::Position;

use super::cell::{Cell, FieldNames};
use crate::data::ready_made::columns::map::ColumnMap;
use crate::data::ready_made::columns::names::{Role, known_names, normalize};

/// Maximum number of columns of a set (chosen).
const MAX_COLUMNS: usize = 4096;

/// Maximum number of rows of a set (chosen): a row takes half a kilobyte of memory, and a compressed file of a few
/// kilobytes can have millions of rows.
pub(crate) const MAX_ROWS: usize = 1_000_000;

/// Maximum memory for all rows of a set without its images, in bytes (chosen).
const MAX_TABLE_BYTES: usize = 1 << 30;

/// All rows of a set, in the order of its files.
#[derive(Debug, Default)]
pub(crate) struct Table {
    pub(crate) files: Vec<FileLabel>,
    pub(crate) columns: Vec<String>,
    /// Index of each column by its name.
    column_indices: HashMap<String, usize>,
    field_names: FieldNames,
    /// Whether the last file has each column.
    in_last_file: Vec<bool>,
    pub(crate) rows: Vec<Row>,
    /// Memory of all rows, in bytes.
    bytes: usize,
    /// Messages about changes to the rows.
    pub(crate) notes: Vec<String>,
}

/// Name and configuration of a file of rows.
#[derive(Debug, Clone)]
pub(crate) struct FileLabel {
    /// Path of the file, for messages. For a file in an archive, it starts with the path of the archive.
    pub(crate) path: PathBuf,
    /// Folder of the file inside its archive; `None` outside archives.
    pub(crate) inner: Option<PathBuf>,
    /// Configuration of the repository; empty if there is none.
    pub(crate) config: String,
}

/// One row. Trailing absent cells are not stored.
#[derive(Debug)]
pub(crate) struct Row {
    /// Index of its file in [`Table::files`].
    pub(crate) file: usize,
    pub(crate) place: RowPlace,
    cells: Box<[Cell]>,
}

/// Position of a row in its file. Rarely used parts are boxed to save memory, because sets have up to a million rows.
#[derive(Debug, Clone)]
pub(crate) enum RowPlace {
    /// Record of a CSV or TSV file.
    Record(Position),
    /// Value in a JSON file.
    Json {
        /// Position of its first byte.
        offset: u64,
        /// Length in bytes.
        length: usize,
        /// Number of its line or of the value, counted from 1.
        number: u64,
        unit: JsonUnit,
        /// For nested rows: the index of the row in a list inside the value, and the field of this list.
        inner: Option<Box<(usize, Arc<str>)>>,
    },
    /// Row of a Parquet file.
    Parquet {
        /// Index of the row group.
        group: usize,
        /// Index in the row group.
        row: usize,
        /// Number in the file, counted from 1.
        number: u64,
    },
}

/// Part of a JSON file that is one row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum JsonUnit {
    Line,
    Object,
}

impl fmt::Display for JsonUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Line => "line",
            Self::Object => "object",
        })
    }
}

impl fmt::Display for RowPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Record(position) => write!(f, "line {}", position.line()),
            Self::Json { number, unit, inner, .. } => {
                write!(f, "{unit} {number}")?;
                match inner.as_deref() {
                    Some((index, _)) => write!(f, ".{}", index + 1),
                    None => Ok(()),
                }
            }
            Self::Parquet { number, .. } => write!(f, "row {number}"),
        }
    }
}

impl Table {
    /// Starts the rows of another file.
    pub(crate) fn begin_file(&mut self, file: FileLabel) {
        self.files.push(file);
        self.in_last_file.clear();
    }

    /// Columns of the last file.
    pub(crate) fn columns_of_last_file(&self) -> BTreeSet<String> {
        self.columns
            .iter()
            .zip(&self.in_last_file)
            .filter(|(_, is_present)| **is_present)
            .map(|(column, _)| column.clone())
            .collect()
    }

    /// Notes that the last file has the column, and returns the column.
    fn mark_in_last_file(&mut self, column: usize) -> usize {
        let length = self.in_last_file.len().max(column + 1);
        self.in_last_file.resize(length, false);
        self.in_last_file[column] = true;
        column
    }

    /// Index of a column of the current file. Adds the column if it is new.
    ///
    /// # Errors
    /// If there are more than [`MAX_COLUMNS`].
    pub(crate) fn add_column(&mut self, name: &str) -> Result<usize, String> {
        if let Some(&index) = self.column_indices.get(name) {
            return Ok(self.mark_in_last_file(index));
        }
        let index = self.columns.len();
        if index == MAX_COLUMNS {
            return Err(format!("more than {MAX_COLUMNS} columns; is it a table of questions?"));
        }
        self.columns.push(name.to_owned());
        self.column_indices.insert(name.to_owned(), index);
        Ok(self.mark_in_last_file(index))
    }

    /// Index of the column with this name.
    pub(crate) fn find(&self, name: &str) -> Option<usize> {
        self.column_indices.get(name).copied()
    }

    /// Adds a row of the last file; `cells` are by column index. Image bytes in the cells are replaced by their digest.
    ///
    /// # Errors
    /// If there are more rows than [`MAX_ROWS`], or more bytes than [`MAX_TABLE_BYTES`].
    pub(crate) fn push(&mut self, place: RowPlace, cells: Vec<(usize, Cell)>) -> Result<(), String> {
        if self.rows.len() == MAX_ROWS {
            return Err(too_many_rows());
        }
        let width = cells.iter().map(|(column, _)| column + 1).max().unwrap_or(0);
        let mut row = vec![Cell::Absent; width];
        for (column, cell) in cells {
            row[column] = cell.without_files(&mut self.field_names);
        }
        self.bytes += row.iter().map(Cell::memory_size).sum::<usize>();
        if self.bytes > MAX_TABLE_BYTES {
            return Err(format!(
                "the rows have more than {} MB without their images; write a part of them to a file of its own",
                MAX_TABLE_BYTES >> 20
            ));
        }
        self.rows.push(Row { file: self.files.len().saturating_sub(1), place, cells: row.into() });
        Ok(())
    }

    /// Parses JSON in the cells of text columns that a map addresses by a path, such as `turns.0.value`.
    pub(crate) fn parse_cells<'m>(&mut self, maps: impl Iterator<Item = &'m ColumnMap>) {
        let columns: BTreeSet<usize> = maps
            .flat_map(|map| &map.entries)
            .flat_map(|entry| &entry.columns)
            .filter(|name| self.find(name).is_none())
            .filter_map(|name| self.find(name.split_once('.')?.0))
            .collect();
        for column in columns {
            for row in &mut self.rows {
                let Some(cell) = row.cells.get_mut(column) else {
                    continue;
                };
                if let Some(parsed) = cell.parsed() {
                    *cell = parsed.without_files(&mut self.field_names);
                }
            }
        }
    }

    /// Frees the memory of columns that are not read again.
    pub(crate) fn clear_columns(&mut self, columns: &BTreeSet<usize>) {
        for row in &mut self.rows {
            for column in columns {
                if let Some(cell) = row.cells.get_mut(*column) {
                    *cell = Cell::Absent;
                }
            }
        }
    }

    /// Adds the ids of the rows from index `from` as a column, unless the table already has a column of ids.
    ///
    /// # Errors
    /// As [`Self::add_column`].
    pub(crate) fn add_ids(&mut self, from: usize, ids: Vec<String>) -> Result<(), String> {
        let names = known_names(Role::Id);
        if self.columns.iter().any(|column| names.contains(&normalize(column))) {
            return Ok(());
        }
        let column = self.add_column("id")?;
        for (row, id) in self.rows[from..].iter_mut().zip(ids) {
            let mut cells = std::mem::take(&mut row.cells).into_vec();
            cells.resize(cells.len().max(column + 1), Cell::Absent);
            cells[column] = Cell::Text(id);
            row.cells = cells.into();
        }
        let note = "the names of the rows in the file are the column id";
        self.notes.push(note.to_owned());
        Ok(())
    }

    /// File and position of a row, for messages.
    pub(crate) fn place(&self, row: usize) -> String {
        let row = &self.rows[row];
        format!("{}, {}", self.files[row.file].path.display(), row.place)
    }

    /// As [`Self::place`], but without the file if the set has only one, for messages that begin with the file of the
    /// set.
    pub(crate) fn place_in_set(&self, row: usize) -> String {
        match &*self.files {
            [_] => self.rows[row].place.to_string(),
            _ => self.place(row),
        }
    }
}

/// Error message for a set with too many rows.
pub(crate) fn too_many_rows() -> String {
    format!("more than {MAX_ROWS} rows, which are not read; write a part of them to a file of its own")
}

impl Row {
    /// Cell of a column; [`Cell::Absent`] if the row does not have it.
    pub(crate) fn cell(&self, column: usize) -> &Cell {
        self.cells.get(column).unwrap_or(&Cell::Absent)
    }
}
