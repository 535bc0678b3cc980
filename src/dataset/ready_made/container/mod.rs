//! The files of a ready-made set: [`SetFile`].

mod archive;
mod card;
mod choose;
mod find;
mod json;
mod json_scan;
mod packed;
mod parquet;
mod shards;
mod splits;
mod table;
mod tree;
mod yaml;

use std::io::Read as _;
use std::path::{Path, PathBuf};

use super::cells::{Cell, FileLabel, RowPlace, Step, Table};
use tempfile::NamedTempFile;

use crate::error::{Error, Result};
use crate::files::reading;

pub(in crate::dataset) use archive::Archive;
pub(in crate::dataset) use find::is_set_folder;
pub(super) use find::{FoundFiles, Joined, find_files};

/// The endings of the files that are read.
pub(super) const READ: &str =
    ".parquet, .tsv, .csv, .jsonl, .ndjson or .json (the texts also as .gz), or a .zip of these";

/// One file of rows.
#[derive(Debug)]
pub(in crate::dataset) struct SetFile {
    pub(super) label: FileLabel,
    kind: FileKind,
    /// The unpacked copy of a compressed file, gone when the file is closed.
    unpacked: Option<NamedTempFile>,
    /// Of a Parquet file, once it is read.
    footer: parquet::Footer,
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
        let unpacked = if ending(&path) == "gz" {
            Some(packed::unpacked(&path)?)
        } else {
            None
        };
        Self::new(path, unpacked, config)
    }

    /// A file of an archive.
    pub(super) fn from_member(archive: &Archive, name: &Path, config: String) -> Result<Self> {
        let unpacked = archive.unpacked(&name.to_string_lossy())?;
        let file = Self::new(archive.path.join(name), Some(unpacked), config)?;
        let inner = Some(name.parent().unwrap_or(Path::new("")).to_owned());
        let label = FileLabel {
            inner,
            ..file.label
        };
        Ok(Self { label, ..file })
    }

    fn new(path: PathBuf, unpacked: Option<NamedTempFile>, config: String) -> Result<Self> {
        let bare = match &*ending(&path) {
            "gz" => path.with_extension(""),
            _ => path.clone(),
        };
        let read = unpacked
            .as_ref()
            .map_or(path.as_path(), NamedTempFile::path);
        let kind = match &*ending(&bare) {
            name @ ("tsv" | "csv") => FileKind::Table {
                delimiter: table::delimiter(read, name)?,
            },
            "jsonl" | "ndjson" => FileKind::JsonLines,
            "json" => FileKind::Json,
            "parquet" => FileKind::Parquet,
            _ => {
                let problem = format_args!("not a file of questions: {READ} expected");
                return Err(Error::data(path.display(), problem));
            }
        };
        let label = FileLabel {
            path,
            inner: None,
            config,
        };
        Ok(Self {
            label,
            kind,
            unpacked,
            footer: parquet::Footer::default(),
        })
    }

    /// The file that is read: the unpacked copy of a compressed one.
    fn read_path(&self) -> &Path {
        self.unpacked
            .as_ref()
            .map_or(&self.label.path, NamedTempFile::path)
    }

    /// Adds the rows of the file to a table.
    pub(super) fn read(&self, rows: Option<&str>, table: &mut Table) -> Result<()> {
        if let Some(rows) = rows.filter(|_| self.kind != FileKind::Json) {
            let problem = format_args!(
                "{} is not a JSON file of one object that could hold {rows:?}",
                self.label.path.display()
            );
            return Err(Error::usage("--read rows", problem));
        }
        table.begin_file(self.label.clone());
        let path = self.read_path();
        let read = match self.kind {
            FileKind::Table { delimiter } => table::read(path, delimiter, table),
            FileKind::JsonLines => json::read_lines(path, table),
            FileKind::Json => json::read(path, rows, table),
            FileKind::Parquet => parquet::read(path, &self.footer, table),
        };
        // The unpacked copy has a name that nobody knows.
        let named = |place: &str| {
            place.replace(
                &path.display().to_string(),
                &self.label.path.display().to_string(),
            )
        };
        read.map_err(|error| match error {
            Error::Data { place, problem } => Error::data(named(&place), problem),
            error => error,
        })
    }

    /// The bytes or the text of a value: in a row, in a column, at the steps inside its cell.
    pub(super) fn value(&self, row: &RowPlace, column: &str, steps: &[Step]) -> Result<Vec<u8>> {
        let cell = match (row, self.kind) {
            (RowPlace::Parquet { group, row, .. }, _) => {
                let file = (self.read_path(), &self.footer);
                return parquet::bytes(file, (*group, *row), column, steps);
            }
            (RowPlace::Record(position), FileKind::Table { delimiter }) => {
                table::cell(self.read_path(), delimiter, position, column)?
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
                let inner = inner.as_ref().map(|inner| (inner.0, &*inner.1));
                json::cell(self.read_path(), (*offset, *length), inner, column)?
            }
            (RowPlace::Record(_), _) => Cell::Absent,
        };
        match cell.value_at(steps) {
            Some(Cell::Bytes(bytes)) => Ok(bytes.into_vec()),
            Some(Cell::Text(text)) => Ok(text.into_bytes()),
            _ => {
                let place = format!("{}, {row}", self.label.path.display());
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
    let mut file = reading::open(path).map_err(|e| Error::file(path, "read", e))?;
    let mut head = [0; POINTER.len()];
    if file.read_exact(&mut head).is_ok() && head == POINTER {
        let problem =
            "not downloaded, only its pointer: git lfs pull in its folder brings the file";
        return Err(Error::data(path.display(), problem));
    }
    Ok(())
}
