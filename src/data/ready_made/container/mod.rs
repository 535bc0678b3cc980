//! Files of a ready-made set: [`SetFile`].

mod archive;
mod card;
mod choose;
mod class_labels;
mod decompress;
mod find;
mod json;
mod json_scan;
mod parquet;
mod parquet_columns;
mod shards;
mod splits;
mod table;
mod tree;
mod yaml;

use std::io::Read as _;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::cells::{Cell, FileLabel, RowPlace, Step, Table};
use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::shell_word;

pub(crate) use archive::Archive;
pub(crate) use find::is_set_folder;
pub(super) use find::{FoundFiles, Joined, find_files};
pub(crate) use parquet_columns::ParquetColumns;
pub(crate) use tree::cached_snapshot;

/// Supported file types, for messages.
const SUPPORTED: &str = ".parquet, .tsv, .csv, .jsonl, .ndjson or .json (the texts also as .gz), or a .zip of these";

/// One file of a table.
#[derive(Debug)]
pub(crate) struct SetFile {
    pub(super) label: FileLabel,
    kind: FileKind,
    /// Decompressed copy of a compressed file, deleted when dropped.
    decompressed: Option<NamedTempFile>,
    /// Footer of a Parquet file.
    footer: parquet::Footer,
}

/// Format of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FileKind {
    Table { delimiter: u8 },
    JsonLines,
    Json,
    Parquet,
}

impl SetFile {
    /// Opens a file. Its extension decides its format.
    pub(super) fn open(path: PathBuf, config: String) -> Result<Self> {
        refuse_lfs_pointer(&path)?;
        let decompressed = if extension(&path) == "gz" { Some(decompress::decompress_gzip(&path)?) } else { None };
        Self::new(path, decompressed, config)
    }

    /// Opens a file of an archive.
    pub(super) fn from_member(archive: &Archive, name: &Path, config: String) -> Result<Self> {
        let decompressed = archive.decompress(&name.to_string_lossy())?;
        let mut file = Self::new(archive.path.join(name), Some(decompressed), config)?;
        file.label.inner = Some(name.parent().unwrap_or(Path::new("")).to_owned());
        Ok(file)
    }

    fn new(path: PathBuf, decompressed: Option<NamedTempFile>, config: String) -> Result<Self> {
        let uncompressed_name = match &*extension(&path) {
            "gz" => path.with_extension(""),
            _ => path.clone(),
        };
        let content = decompressed.as_ref().map_or(path.as_path(), NamedTempFile::path);
        let kind = match &*extension(&uncompressed_name) {
            name @ ("tsv" | "csv") => FileKind::Table { delimiter: table::delimiter(content, name)? },
            "jsonl" | "ndjson" => FileKind::JsonLines,
            "json" => FileKind::Json,
            "parquet" => FileKind::Parquet,
            "arrow" => {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                let program = "import sys, datasets; datasets.Dataset.from_file(sys.argv[1]).to_parquet('set.parquet')";
                let problem = format_args!(
                    "an Arrow file, which is not read; write Parquet: python -c \"{program}\" {} in its folder",
                    shell_word(&name)
                );
                return Err(Error::data(path.display(), problem));
            }
            _ => {
                let problem = format_args!("not a file of questions: {SUPPORTED} expected");
                return Err(Error::data(path.display(), problem));
            }
        };
        let label = FileLabel { path, inner: None, config };
        Ok(Self { label, kind, decompressed, footer: parquet::Footer::default() })
    }

    /// Path of the content: the decompressed copy of a compressed file, else the file.
    fn content_path(&self) -> &Path {
        self.decompressed.as_ref().map_or(&self.label.path, NamedTempFile::path)
    }

    /// Appends the rows of the file to a table. In a JSON file, `rows` is the path to the list of rows.
    pub(super) fn read(&self, rows: Option<&str>, table: &mut Table) -> Result<()> {
        if let Some(rows) = rows.filter(|_| self.kind != FileKind::Json) {
            let problem =
                format_args!("{} is not a JSON file of one object that could hold {rows:?}", self.label.path.display());
            return Err(Error::usage("--read rows", problem));
        }
        table.begin_file(self.label.clone());
        let path = self.content_path();
        let result = match self.kind {
            FileKind::Table { delimiter } => table::read(path, delimiter, table),
            FileKind::JsonLines => json::read_lines(path, table),
            FileKind::Json => json::read(path, rows, table),
            FileKind::Parquet => parquet::read(path, &self.footer, table),
        };
        // Name the compressed file instead of its temporary copy.
        result.map_err(|error| match error {
            Error::Data { place, problem } => {
                let place = place.replace(&path.display().to_string(), &self.label.path.display().to_string());
                Error::data(place, problem)
            }
            error => error,
        })
    }

    /// Reads the bytes or the text of one value: the end of the path `steps` in the cell of `column` in a row.
    pub(super) fn value(&self, row: &RowPlace, column: &str, steps: &[Step]) -> Result<Vec<u8>> {
        let cell = match (row, self.kind) {
            (RowPlace::Parquet { group, row, .. }, _) => {
                let path = self.content_path();
                return parquet::bytes(path, &self.footer, *group, *row, column, steps);
            }
            (RowPlace::Record(position), FileKind::Table { delimiter }) => {
                table::cell(self.content_path(), delimiter, position, column)?
            }
            (RowPlace::Json { offset, length, inner, .. }, _) => {
                let inner = inner.as_deref().map(|(index, list)| (*index, &**list));
                json::cell(self.content_path(), *offset, *length, inner, column)?
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

/// True for a ZIP file, by its name.
pub(crate) fn is_zip_file(path: &Path) -> bool {
    path.is_file() && extension(path) == "zip"
}

/// Extension of a file name, in lower case.
fn extension(path: &Path) -> String {
    path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_ascii_lowercase()
}

/// Refuses a Git LFS pointer, the placeholder of a file that was not downloaded.
pub(crate) fn refuse_lfs_pointer(path: &Path) -> Result<()> {
    const POINTER: &[u8] = b"version https://git-lfs.github.com/spec";
    let mut file = reading::open(path).map_err(|e| Error::file(path, "read", e))?;
    let mut head = [0; POINTER.len()];
    if file.read_exact(&mut head).is_ok() && head == POINTER {
        let problem = "not downloaded, only its pointer: git lfs pull in its folder brings the file";
        return Err(Error::data(path.display(), problem));
    }
    Ok(())
}
