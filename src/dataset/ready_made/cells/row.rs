//! The rows of a ready-made set: [`Table`].

use std::collections::{BTreeSet, HashMap};
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use csv::Position;

use super::cell::{Cell, FieldNames};
use crate::dataset::ready_made::columns::map::Map;
use crate::dataset::ready_made::columns::names::{Role, known, plain};

/// The maximum number of columns of a set.
const MOST_COLUMNS: usize = 4096;

/// The maximum number of rows of a set; chosen: a row takes half a kilobyte, and a packed file of a few kilobytes can hold millions.
pub(in crate::dataset::ready_made) const MOST_ROWS: usize = 1_000_000;

/// The maximum length of all rows of a set without its images, in bytes; chosen.
const MOST_BYTES: usize = 1 << 30;

/// All rows of a set, in the order of its files.
#[derive(Debug, Default)]
pub(in crate::dataset::ready_made) struct Table {
    pub(in crate::dataset::ready_made) files: Vec<FileLabel>,
    pub(in crate::dataset::ready_made) columns: Vec<String>,
    places: HashMap<String, usize>,
    names: FieldNames,
    /// Whether the last file has a column.
    in_last_file: Vec<bool>,
    pub(in crate::dataset::ready_made) rows: Vec<Row>,
    /// The length of all rows, in bytes.
    bytes: usize,
    /// Changes to the rows, in words.
    pub(in crate::dataset::ready_made) notes: Vec<String>,
}

/// Facts about a file of rows besides its rows.
#[derive(Debug, Clone)]
pub(in crate::dataset::ready_made) struct FileLabel {
    /// The path of the file, for messages; of a file in an archive, behind that of the archive.
    pub(in crate::dataset::ready_made) path: PathBuf,
    /// The folder inside the archive that holds the file; `None` outside archives.
    pub(in crate::dataset::ready_made) inner: Option<PathBuf>,
    /// The configuration of the repository that it belongs to; empty if there is none.
    pub(in crate::dataset::ready_made) config: String,
}

/// One row. Cells of columns that come later than its own may lack.
#[derive(Debug)]
pub(in crate::dataset::ready_made) struct Row {
    /// The index of its file.
    pub(in crate::dataset::ready_made) file: usize,
    pub(in crate::dataset::ready_made) place: RowPlace,
    cells: Box<[Cell]>,
}

/// Where a row stands in its file. Sets have millions of rows, so that what few of them need is in a box.
#[derive(Debug, Clone)]
pub(in crate::dataset::ready_made) enum RowPlace {
    /// A record of a table of text.
    Record(Position),
    /// A value of a JSON file: its first byte, its length, and the number of its line or of the value, counted from 1.
    Json {
        offset: u64,
        length: usize,
        number: u64,
        unit: JsonUnit,
        /// The place of the row in a list inside the value, and the field that holds the list, if rows are nested.
        inner: Option<Box<(usize, Arc<str>)>>,
    },
    /// A row of a row group, and its number in the file, counted from 1.
    Parquet {
        group: usize,
        row: usize,
        number: u64,
    },
}

/// The unit of a JSON file that holds one row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::dataset::ready_made) enum JsonUnit {
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
            Self::Json {
                number,
                unit,
                inner,
                ..
            } => {
                write!(f, "{unit} {number}")?;
                let inner = inner.as_ref();
                inner.map_or(Ok(()), |inner| write!(f, ".{}", inner.0 + 1))
            }
            Self::Parquet { number, .. } => write!(f, "row {number}"),
        }
    }
}

impl Table {
    /// A file of rows begins.
    pub(in crate::dataset::ready_made) fn begin_file(&mut self, file: FileLabel) {
        self.files.push(file);
        self.in_last_file.clear();
    }

    /// The columns of the last file.
    pub(in crate::dataset::ready_made) fn columns_of_last_file(&self) -> BTreeSet<String> {
        self.columns
            .iter()
            .zip(&self.in_last_file)
            .filter(|(_, is_there)| **is_there)
            .map(|(column, _)| column.clone())
            .collect()
    }

    fn saw(&mut self, column: usize) -> usize {
        let length = self.in_last_file.len().max(column + 1);
        self.in_last_file.resize(length, false);
        self.in_last_file[column] = true;
        column
    }

    /// The index of a column; a new one if there is none of this name.
    ///
    /// # Errors
    /// If there are more than [`MOST_COLUMNS`].
    pub(in crate::dataset::ready_made) fn column(&mut self, name: &str) -> Result<usize, String> {
        if let Some(&at) = self.places.get(name) {
            return Ok(self.saw(at));
        }
        let at = self.columns.len();
        if at == MOST_COLUMNS {
            return Err(format!(
                "more than {MOST_COLUMNS} columns; is it a table of questions?"
            ));
        }
        self.columns.push(name.to_owned());
        self.places.insert(name.to_owned(), at);
        Ok(self.saw(at))
    }

    /// The index of a column; `None` if there is none of this name.
    pub(in crate::dataset::ready_made) fn find(&self, name: &str) -> Option<usize> {
        self.places.get(name).copied()
    }

    /// Adds a row of the last file. Files in the cells are not kept.
    ///
    /// # Errors
    /// If there are more rows than [`MOST_ROWS`], or more bytes than [`MOST_BYTES`].
    pub(in crate::dataset::ready_made) fn push(
        &mut self,
        place: RowPlace,
        cells: Vec<(usize, Cell)>,
    ) -> Result<(), String> {
        if self.rows.len() == MOST_ROWS {
            return Err(too_many_rows());
        }
        let width = cells.iter().map(|(at, _)| at + 1).max().unwrap_or(0);
        let mut row = vec![Cell::Absent; width];
        for (at, cell) in cells {
            row[at] = cell.without_files(&mut self.names);
        }
        self.bytes += row.iter().map(Cell::length).sum::<usize>();
        if self.bytes > MOST_BYTES {
            return Err(format!(
                "the rows have more than {} MB without their images; write a part of them to a file of its own",
                MOST_BYTES >> 20
            ));
        }
        self.rows.push(Row {
            file: self.files.len().saturating_sub(1),
            place,
            cells: row.into(),
        });
        Ok(())
    }

    /// Parses the cells of columns of text that a map takes as lists or structs, as tables hold them in JSON: `turns.0.value`.
    pub(in crate::dataset::ready_made) fn parse_cells<'m>(
        &mut self,
        maps: impl Iterator<Item = &'m Map>,
    ) {
        let names = maps
            .flat_map(|map| &map.entries)
            .flat_map(|entry| &entry.columns);
        let columns = names
            .filter(|name| self.find(name).is_none())
            .filter_map(|name| self.find(name.split_once('.')?.0));
        for column in columns.collect::<BTreeSet<usize>>() {
            for row in &mut self.rows {
                let Some(cell) = row.cells.get_mut(column) else {
                    continue;
                };
                if let Some(parsed) = cell.parsed() {
                    *cell = parsed.without_files(&mut self.names);
                }
            }
        }
    }

    /// Frees the cells of columns that are not read again.
    pub(in crate::dataset::ready_made) fn forget(&mut self, columns: &BTreeSet<usize>) {
        for row in &mut self.rows {
            for at in columns {
                if let Some(cell) = row.cells.get_mut(*at) {
                    *cell = Cell::Absent;
                }
            }
        }
    }

    /// Adds a column of ids from a row on, if there is no column of ids.
    ///
    /// # Errors
    /// As [`Self::column`].
    pub(in crate::dataset::ready_made) fn add_ids(
        &mut self,
        from: usize,
        ids: Vec<String>,
    ) -> Result<(), String> {
        let names = known(Role::Id);
        if self
            .columns
            .iter()
            .any(|column| names.contains(&plain(column)))
        {
            return Ok(());
        }
        let at = self.column("id")?;
        for (row, id) in self.rows[from..].iter_mut().zip(ids) {
            let mut cells = std::mem::take(&mut row.cells).into_vec();
            cells.resize(cells.len().max(at + 1), Cell::Absent);
            cells[at] = Cell::Text(id);
            row.cells = cells.into();
        }
        let note = "the names of the rows in the file are the column id";
        self.notes.push(note.to_owned());
        Ok(())
    }

    /// The file and place of a row, for messages.
    pub(in crate::dataset::ready_made) fn place(&self, row: usize) -> String {
        let row = &self.rows[row];
        format!("{}, {}", self.files[row.file].path.display(), row.place)
    }
}

/// The error of a set with too many rows.
pub(in crate::dataset::ready_made) fn too_many_rows() -> String {
    format!(
        "more than {MOST_ROWS} rows, which are not read; write a part of them to a file of its own"
    )
}

impl Row {
    /// The cell of a column.
    pub(in crate::dataset::ready_made) fn cell(&self, column: usize) -> &Cell {
        self.cells.get(column).unwrap_or(&Cell::Absent)
    }
}
