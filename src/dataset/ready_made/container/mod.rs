//! The files of a ready-made set: [`SetFile`].

mod card;
mod folder;
mod json;
mod json_scan;
mod parquet;
mod splits;
mod table;

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::cell::Cell;
use super::images::Step;
use super::row::{RowPlace, Table};
use crate::error::{Error, Result};

pub(in crate::dataset) use folder::holds_files;
pub(super) use folder::{FoundFiles, find};

/// The endings of the files that are read.
pub(super) const READ: &str = ".parquet, .tsv, .csv, .jsonl, .ndjson or .json";

/// One file of rows.
#[derive(Debug)]
pub(in crate::dataset) struct SetFile {
    pub(super) path: PathBuf,
    kind: FileKind,
    /// The configuration of the repository that it belongs to; empty if there is none.
    pub(super) config: String,
}

/// How rows stand in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FileKind {
    Table { delimiter: u8 },
    JsonLines,
    Json,
    Parquet,
}

impl SetFile {
    /// The file at a path, whose ending tells its kind.
    pub(super) fn open(path: PathBuf, config: String) -> Result<Self> {
        check_content(&path)?;
        let kind = match &*ending(&path) {
            name @ ("tsv" | "csv") => FileKind::Table {
                delimiter: table::delimiter(&path, name)?,
            },
            "jsonl" | "ndjson" => FileKind::JsonLines,
            "json" => FileKind::Json,
            "parquet" => FileKind::Parquet,
            _ => {
                let problem = format_args!("not a file of questions: {READ} expected");
                return Err(Error::data(path.display(), problem));
            }
        };
        Ok(Self { path, kind, config })
    }

    /// Adds the rows of the file to a table.
    pub(super) fn read(self, rows: Option<&str>, table: &mut Table) -> Result<()> {
        let (path, kind) = (self.path.clone(), self.kind);
        table.files.push(Arc::new(self));
        match kind {
            FileKind::Table { delimiter } => table::read(&path, delimiter, table),
            FileKind::JsonLines => json::read_lines(&path, table),
            FileKind::Json => json::read(&path, rows, table),
            FileKind::Parquet => parquet::read(&path, table),
        }
    }

    /// The bytes or the text of a value: in a row, in a column, at the steps inside its cell.
    pub(super) fn value(&self, row: &RowPlace, column: &str, steps: &[Step]) -> Result<Vec<u8>> {
        let cell = match (row, self.kind) {
            (RowPlace::Parquet { group, row, .. }, _) => {
                return parquet::bytes(&self.path, (*group, *row), column, steps);
            }
            (RowPlace::Record(position), FileKind::Table { delimiter }) => {
                table::cell(&self.path, delimiter, position, column)?
            }
            (
                RowPlace::Json {
                    offset,
                    length,
                    inner,
                    ..
                },
                _,
            ) => {
                let inner = inner.as_ref().map(|(at, list)| (*at, &**list));
                json::cell(&self.path, (*offset, *length), inner, column)?
            }
            (RowPlace::Record(_), _) => Cell::Absent,
        };
        match cell.at(steps) {
            Some(Cell::Bytes(bytes)) => Ok(bytes),
            Some(Cell::Text(text)) => Ok(text.into_bytes()),
            _ => {
                let place = format!("{}, {row}", self.path.display());
                let problem = format_args!("the column {column:?} has changed since it was read");
                Err(Error::data(place, problem))
            }
        }
    }
}

/// The ending of a name, in lower case.
fn ending(path: &Path) -> String {
    let ending = path.extension().and_then(|ending| ending.to_str());
    ending.unwrap_or_default().to_ascii_lowercase()
}

/// Refuses a pointer of Git LFS, which stands where a file was not downloaded.
fn check_content(path: &Path) -> Result<()> {
    const POINTER: &[u8] = b"version https://git-lfs.github.com/spec";
    let mut file = File::open(path).map_err(|e| Error::file(path, "read", e))?;
    let mut head = [0; POINTER.len()];
    if file.read_exact(&mut head).is_ok() && head == POINTER {
        let problem =
            "not downloaded, only its pointer: git lfs pull in its folder brings the file";
        return Err(Error::data(path.display(), problem));
    }
    Ok(())
}
