//! Files of a ready-made set: [`SetFile`].
//!
//! Reader for text tables: CSV, and TSV as written by VLMEvalKit (`vlmeval/dataset/image_mcq.py`).

mod archive;
mod card;
mod choose;
mod find;
mod json;
mod parquet;
mod parquet_columns;
mod tree;

use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use csv::{ByteRecord, Position, Reader, ReaderBuilder};
use tempfile::NamedTempFile;

use super::cells::{Cell, FileLabel, PathStep, RowPlace, SetRows};
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::shell_word;

pub use archive::Archive;
pub use find::is_set_folder;
pub use parquet_columns::ParquetColumns;
pub use tree::cached_snapshot;

pub(super) use find::{FileRelation, FoundFiles, find_files};

/// Supported file types, for messages.
const SUPPORTED: &str = ".parquet, .tsv, .csv, .jsonl, .ndjson or .json (the texts also as .gz), or a .zip of these";

/// One file of a table.
#[derive(Debug)]
pub struct SetFile {
    pub(super) label: FileLabel,
    kind: RowFormat,
    /// Decompressed copy of a compressed file, deleted when dropped.
    decompressed: Option<NamedTempFile>,
    /// Footer of a Parquet file.
    footer: parquet::Footer,
}

/// Format of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RowFormat {
    Table { delimiter: u8 },
    JsonLines,
    Json,
    Parquet,
}

impl SetFile {
    /// Opens a file. Its extension decides its format.
    pub(super) fn open(path: PathBuf, config: String) -> Result<Self> {
        refuse_lfs_pointer(&path)?;
        let decompressed = if extension(&path) == "gz" { Some(archive::decompress_gzip(&path)?) } else { None };
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
            name @ ("tsv" | "csv") => RowFormat::Table { delimiter: delimiter(content, name)? },
            "jsonl" | "ndjson" => RowFormat::JsonLines,
            "json" => RowFormat::Json,
            "parquet" => RowFormat::Parquet,
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
    pub(super) fn read(&self, rows: Option<&str>, table: &mut SetRows) -> Result<()> {
        if let Some(rows) = rows.filter(|_| self.kind != RowFormat::Json) {
            let problem =
                format_args!("{} is not a JSON file of one object that could hold {rows:?}", self.label.path.display());
            return Err(Error::usage("--read rows", problem));
        }
        table.begin_file(self.label.clone());
        let path = self.content_path();
        let result = match self.kind {
            RowFormat::Table { delimiter } => read(path, delimiter, table),
            RowFormat::JsonLines => json::read_lines(path, table),
            RowFormat::Json => json::read(path, rows, table),
            RowFormat::Parquet => parquet::read(path, &self.footer, table),
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
    pub(super) fn value(&self, row: &RowPlace, column: &str, steps: &[PathStep]) -> Result<Vec<u8>> {
        let cell = match (row, self.kind) {
            (RowPlace::Parquet { group, row, .. }, _) => {
                let path = self.content_path();
                return parquet::bytes(path, &self.footer, *group, *row, column, steps);
            }
            (RowPlace::Record(position), RowFormat::Table { delimiter }) => {
                cell(self.content_path(), delimiter, position, column)?
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
pub fn is_zip_file(path: &Path) -> bool {
    path.is_file() && extension(path) == "zip"
}

/// Extension of a file name, in lower case.
fn extension(path: &Path) -> String {
    path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_ascii_lowercase()
}

/// Refuses a Git LFS pointer, the placeholder of a file that was not downloaded.
pub fn refuse_lfs_pointer(path: &Path) -> Result<()> {
    const POINTER: &[u8] = b"version https://git-lfs.github.com/spec";
    let mut file = files::open(path).map_err(|e| Error::file(path, "read", e))?;
    let mut head = [0; POINTER.len()];
    if file.read_exact(&mut head).is_ok() && head == POINTER {
        let problem = "not downloaded, only its pointer: git lfs pull in its folder brings the file";
        return Err(Error::data(path.display(), problem));
    }
    Ok(())
}

/// Returns the delimiter of a table: a tab for the ending `tsv`; otherwise a comma, or, if the header has none, a
/// semicolon or tab that it has. Spreadsheets write semicolons in many countries.
fn delimiter(path: &Path, ending: &str) -> Result<u8> {
    if ending == "tsv" {
        return Ok(b'\t');
    }
    let file = files::open(path).map_err(|e| Error::file(path, "read", e))?;
    let mut header = Vec::new();
    let mut file = BufReader::new(file.take(MAX_RECORD_BYTES));
    file.read_until(b'\n', &mut header).map_err(|e| Error::file(path, "read", e))?;
    Ok([b',', b';', b'\t'].into_iter().find(|delimiter| header.contains(delimiter)).unwrap_or(b','))
}

/// Maximum length of a record, in bytes: enough for an image of 48 MB in base64.
const MAX_RECORD_BYTES: u64 = 64 << 20;

/// A file that fails to read once a record exceeds [`MAX_RECORD_BYTES`].
struct RecordLimited {
    file: File,
    /// Bytes that may still be read for the current record.
    remaining: u64,
    quotes: QuoteCheck,
}

/// Finds missing quotes. The reader would take all rows up to the next quote as one cell.
struct QuoteCheck {
    delimiter: u8,
    state: CellState,
    line: usize,
    /// Line on which the current quoted cell begins.
    first_line: usize,
    /// First line of a cell of several lines whose closing quote is followed by text.
    fault: Option<usize>,
    last_byte: u8,
    /// Whether a record ends with CR and LF, as spreadsheets write. The reader ends it at CR, and takes LF for the
    /// start of the next.
    has_crlf: bool,
}

/// Position in a cell.
#[derive(Clone, Copy)]
enum CellState {
    Start,
    Unquoted,
    Quoted,
    /// After a quote in a quoted cell: the end of the cell, or the first of two that stand for one.
    Quote,
}

impl QuoteCheck {
    fn new(delimiter: u8) -> Self {
        Self { delimiter, state: CellState::Start, line: 1, first_line: 1, fault: None, last_byte: 0, has_crlf: false }
    }

    fn add(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let is_end = byte == self.delimiter || byte == b'\n' || byte == b'\r';
            self.state = match (self.state, byte) {
                (CellState::Start, b'"') => {
                    self.first_line = self.line;
                    CellState::Quoted
                }
                (CellState::Quoted, b'"') => CellState::Quote,
                (CellState::Quoted, _) | (CellState::Quote, b'"') => CellState::Quoted,
                (_, _) if is_end => CellState::Start,
                (CellState::Quote, _) => {
                    if self.first_line != self.line {
                        self.fault.get_or_insert(self.first_line);
                    }
                    CellState::Unquoted
                }
                (CellState::Start | CellState::Unquoted, _) => CellState::Unquoted,
            };
            self.line += usize::from(byte == b'\n');
            self.has_crlf |= (self.last_byte, byte) == (b'\r', b'\n') && matches!(self.state, CellState::Start);
            self.last_byte = byte;
        }
    }

    /// First line of the first cell with a missing quote, after the whole file was read.
    fn faulty_line(&self) -> Option<usize> {
        let is_open = matches!(self.state, CellState::Quoted);
        self.fault.or(is_open.then_some(self.first_line))
    }
}

impl RecordLimited {
    /// Resets the limit for the next record.
    fn start_record(&mut self) {
        self.remaining = MAX_RECORD_BYTES;
    }
}

impl Read for RecordLimited {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.remaining = self.remaining.checked_sub(count as u64).ok_or_else(|| io::Error::other(TOO_LONG))?;
        self.quotes.add(&buffer[..count]);
        Ok(count)
    }
}

impl Seek for RecordLimited {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Message for a record longer than [`MAX_RECORD_BYTES`].
const TOO_LONG: &str = "more than 64 MB; is a quote missing before it or in it?";

fn open_reader(path: &Path, delimiter: u8) -> Result<Reader<RecordLimited>> {
    let file = files::open(path).map_err(|e| Error::file(path, "read", e))?;
    Ok(ReaderBuilder::new().delimiter(delimiter).flexible(true).from_reader(RecordLimited {
        file,
        remaining: MAX_RECORD_BYTES,
        quotes: QuoteCheck::new(delimiter),
    }))
}

/// Adds all rows of a file to a table.
fn read(path: &Path, delimiter: u8, table: &mut SetRows) -> Result<()> {
    let mut reader = open_reader(path, delimiter)?;
    let header = reader.byte_headers().map_err(|e| Error::data(path.display(), e))?.clone();
    let mut columns = Vec::new();
    for name in &header {
        let name = decode(name).map_err(|problem| Error::line(path, 1, problem))?;
        let name = name.trim();
        if columns.iter().any(|(known, _)| known == name) && !name.is_empty() {
            let problem = format_args!("two columns are called {name:?}; rename one");
            return Err(Error::line(path, 1, problem));
        }
        let column = table.add_column(name).map_err(|problem| Error::line(path, 1, problem))?;
        columns.push((name.to_owned(), column));
    }
    let mut record = ByteRecord::new();
    let mut number = 0;
    loop {
        number += 1;
        let mut position = reader.position().clone();
        reader.get_mut().start_record();
        let result = reader.read_byte_record(&mut record);
        position.set_line(position.line() + u64::from(reader.get_ref().quotes.has_crlf));
        let line = position.line();
        let has_record = result.map_err(|e| {
            let place = format!("{}, record {number}, line {line}", path.display());
            Error::data(place, e)
        })?;
        if !has_record {
            break;
        }
        let row_error = |problem: String| Error::data(format_args!("{}, line {line}", path.display()), problem);
        if let Some(stray) = record.iter().skip(columns.len()).find(|cell| !cell.is_empty()) {
            let problem = format!(
                "{} cells, but the header has {}, so that {:?} has no column; put cells that hold the delimiter in quotes",
                record.len(),
                columns.len(),
                String::from_utf8_lossy(stray)
            );
            return Err(row_error(problem));
        }
        let mut cells = Vec::with_capacity(columns.len());
        for ((name, column), cell) in columns.iter().zip(&record) {
            let text = decode(cell).map_err(|problem| row_error(format!("column {name:?}: {problem}")))?;
            if !text.is_empty() {
                cells.push((*column, Cell::Text(text.to_owned())));
            }
        }
        table.push(RowPlace::Record(position.clone()), cells).map_err(row_error)?;
    }
    match reader.get_ref().quotes.faulty_line() {
        None => Ok(()),
        Some(line) => {
            let problem = "a quoted cell begins here and takes in the next lines; its closing quote is missing, or a quote in it is not doubled";
            Err(Error::line(path, line, problem))
        }
    }
}

/// Reads one whole cell, given the position of its record and the name of its column.
fn cell(path: &Path, delimiter: u8, position: &Position, column: &str) -> Result<Cell> {
    let mut reader = open_reader(path, delimiter)?;
    let index = reader
        .byte_headers()
        .map_err(|e| Error::data(path.display(), e))?
        .iter()
        .position(|name| name.trim_ascii() == column.as_bytes());
    let mut record = ByteRecord::new();
    reader.seek(position.clone()).map_err(|e| Error::data(path.display(), e))?;
    reader.read_byte_record(&mut record).map_err(|e| Error::data(path.display(), e))?;
    let cell = index.and_then(|index| record.get(index)).unwrap_or_default();
    Ok(decode(cell).map_or(Cell::Absent, |text| Cell::Text(text.to_owned())))
}

/// Decodes a cell as UTF-8. The error names the first invalid byte, counted from 1.
fn decode(cell: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(cell)
        .map_err(|e| format!("byte {} of the cell is not UTF-8; save the file as UTF-8", e.valid_up_to() + 1))
}
