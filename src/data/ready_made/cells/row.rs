//! The rows of a ready-made set: [`SetRows`].
//!
//! Question and answer in a conversation: [`ConversationPaths`].
//!
//! A conversation is a list of turns. LLaVA writes a turn as `{"from": "human", "value": "…"}`, chat interfaces as
//! `{"role": "user", "content": "…"}`, where the content may be a list of parts, `{"type": "text", "text": "…"}`.

use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap};
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use csv::Position;

use super::cell::{Cell, FieldNames};
use crate::ready_made::columns::map::{ColumnMap, ColumnRole, known_names, normalize};

/// Maximum number of columns of a set (chosen).
const MAX_COLUMNS: usize = 4096;

/// Maximum number of rows of a set (chosen): a row takes half a kilobyte of memory, and a compressed file of a few
/// kilobytes can have millions of rows.
pub(crate) const MAX_ROWS: usize = 1_000_000;

/// Maximum memory for all rows of a set without its images, in bytes (chosen).
const MAX_TABLE_BYTES: usize = 1 << 30;

/// All rows of a set, in the order of its files.
#[derive(Debug, Default)]
pub(crate) struct SetRows {
    pub files: Vec<FileLabel>,
    pub columns: Vec<String>,
    /// Index of each column by its name.
    column_indices: HashMap<String, usize>,
    field_names: FieldNames,
    /// Whether the last file has each column.
    in_last_file: Vec<bool>,
    pub rows: Vec<Row>,
    /// Memory of all rows, in bytes.
    bytes: usize,
    /// Messages about changes to the rows.
    pub notes: Vec<String>,
}

/// Name and configuration of a file of rows.
#[derive(Debug, Clone)]
pub(crate) struct FileLabel {
    /// Path of the file, for messages. For a file in an archive, it starts with the path of the archive.
    pub path: PathBuf,
    /// Folder of the file inside its archive; `None` outside archives.
    pub inner: Option<PathBuf>,
    /// Configuration of the repository; empty if there is none.
    pub config: String,
}

/// One row. Trailing absent cells are not stored.
#[derive(Debug)]
pub(crate) struct Row {
    /// Index of its file in [`SetRows::files`].
    pub file: usize,
    pub place: RowPlace,
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

impl SetRows {
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
        let names = known_names(ColumnRole::Id);
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

/// Roles that ask.
const ASKING: [&str; 2] = ["human", "user"];

/// Roles that answer.
const ANSWERING: [&str; 4] = ["gpt", "assistant", "model", "bot"];

/// Paths of the first question and its answer in a column of conversations, in the notation of `--map`.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct ConversationPaths {
    pub question: String,
    /// `None` if the question has no answer.
    pub answer: Option<String>,
}

impl ConversationPaths {
    /// Paths in the first column of conversations; `None` if there is no such column.
    pub(crate) fn find(table: &SetRows) -> Option<Self> {
        let row = table.rows.first()?;
        table.columns.iter().enumerate().find_map(|(index, name)| Self::from_cell(name, row.cell(index)))
    }

    /// Paths in a cell of a column; `None` if the cell is not a conversation.
    pub(crate) fn from_cell(column: &str, cell: &Cell) -> Option<Self> {
        let cell = cell.parsed().map_or(Cow::Borrowed(cell), Cow::Owned);
        let Cell::List(turns) = &*cell else {
            return None;
        };
        let (index, question) = first_turn(column, turns, &ASKING, 0)?;
        let answer = first_turn(column, turns, &ANSWERING, index).map(|(_, path)| path);
        Some(Self { question, answer })
    }
}

/// Index of the first turn from `start` that has one of the roles, and the path of its text.
fn first_turn(column: &str, turns: &[Cell], roles: &[&str], start: usize) -> Option<(usize, String)> {
    let (index, turn) = turns.iter().enumerate().skip(start).find(|(_, turn)| has_role(turn, roles))?;
    Some((index, format!("{column}.{index}.{}", text_path(turn)?)))
}

/// True if a turn is by one of these roles.
fn has_role(turn: &Cell, roles: &[&str]) -> bool {
    ["from", "role"]
        .iter()
        .find_map(|field| turn.field(field)?.text())
        .is_some_and(|role| roles.contains(&role.trim().to_ascii_lowercase().as_str()))
}

/// Path of the text inside a turn.
fn text_path(turn: &Cell) -> Option<String> {
    ["value", "content", "text"].iter().find_map(|field| match turn.field(field)? {
        Cell::Text(_) => Some((*field).to_owned()),
        Cell::List(parts) => {
            let index = parts.iter().position(|part| matches!(part.field("text"), Some(Cell::Text(_))))?;
            Some(format!("{field}.{index}.text"))
        }
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn paths(cell: Value) -> Option<(String, Option<String>)> {
        let paths = ConversationPaths::from_cell("chat", &Cell::from(cell))?;
        Some((paths.question, paths.answer))
    }

    #[test]
    fn the_first_question_and_its_answer_are_found() {
        let llava = json!([{"from": "human", "value": "?"}, {"from": "gpt", "value": "A"}]);
        let expected = Some(("chat.0.value".to_owned(), Some("chat.1.value".to_owned())));
        assert_eq!(paths(llava.clone()), expected);
        assert_eq!(paths(json!(llava.to_string())), expected);
        let parts = json!([
            {"role": "system", "content": "Be brief."},
            {"role": "user", "content": [{"type": "image"}, {"type": "text", "text": "?"}]},
        ]);
        assert_eq!(paths(parts), Some(("chat.1.content.1.text".to_owned(), None)));
        for other in [json!("[\"x\"]"), json!(["human"]), json!({"from": "human"}), json!([])] {
            assert_eq!(paths(other), None);
        }
    }
}
