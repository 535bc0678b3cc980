//! Tables of text: TSV as VLMEvalKit writes it (`vlmeval/dataset/image_mcq.py`), and CSV.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use csv::{ByteRecord, Position, Reader, ReaderBuilder};

use super::super::cell::Cell;
use super::super::row::{RowPlace, Table};
use crate::error::{Error, Result};
use crate::files::reading;

/// The ending decides the delimiter; a CSV file without a comma in its header has semicolons, as spreadsheets write it in many countries.
pub(super) fn delimiter(path: &Path, ending: &str) -> Result<u8> {
    if ending == "tsv" {
        return Ok(b'\t');
    }
    let file = reading::open(path).map_err(|e| Error::file(path, "read", e))?;
    let mut header = Vec::new();
    let mut file = BufReader::new(file.take(LONGEST_RECORD));
    file.read_until(b'\n', &mut header)
        .map_err(|e| Error::file(path, "read", e))?;
    let is_comma = header.contains(&b',') || !header.contains(&b';');
    Ok(if is_comma { b',' } else { b';' })
}

/// The maximum length of a record, in bytes: an image of 48 MB in base64.
const LONGEST_RECORD: u64 = 64 << 20;

/// A file of which no record is longer than it may be.
struct Bounded {
    file: File,
    /// How many bytes may be read for the record.
    left: u64,
}

impl Bounded {
    /// A record begins.
    fn begin(&mut self) {
        self.left = LONGEST_RECORD;
    }
}

impl Read for Bounded {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.left = self
            .left
            .checked_sub(count as u64)
            .ok_or_else(|| io::Error::other(TOO_LONG))?;
        Ok(count)
    }
}

impl Seek for Bounded {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

const TOO_LONG: &str = "more than 64 MB; is a quote missing before it or in it?";

fn reader(path: &Path, delimiter: u8) -> Result<Reader<Bounded>> {
    let file = reading::open(path).map_err(|e| Error::file(path, "read", e))?;
    let left = LONGEST_RECORD;
    Ok(ReaderBuilder::new()
        .delimiter(delimiter)
        .flexible(true)
        .from_reader(Bounded { file, left }))
}

/// Adds the rows of a file.
pub(super) fn read(path: &Path, delimiter: u8, table: &mut Table) -> Result<()> {
    let mut reader = reader(path, delimiter)?;
    let wrong = |e: csv::Error| Error::data(path.display(), e);
    let header = reader.byte_headers().map_err(wrong)?.clone();
    let mut columns = Vec::new();
    for name in &header {
        let name = text(name).map_err(|problem| Error::line(path, 1, problem))?;
        let name = name.trim();
        if columns.iter().any(|(known, _)| known == name) && !name.is_empty() {
            let problem = format_args!("two columns are called {name:?}; rename one");
            return Err(Error::line(path, 1, problem));
        }
        let at = table.column(name);
        let at = at.map_err(|problem| Error::line(path, 1, problem))?;
        columns.push((name.to_owned(), at));
    }
    let mut record = ByteRecord::new();
    let mut number = 0;
    loop {
        number += 1;
        let line = reader.position().line();
        let begins = |e: csv::Error| {
            let place = format!("{}, record {number}, line {line}", path.display());
            Error::data(place, e)
        };
        reader.get_mut().begin();
        if !reader.read_byte_record(&mut record).map_err(begins)? {
            break;
        }
        let position = record.position().cloned().unwrap_or_else(Position::new);
        let at = |problem: String| {
            Error::data(
                format_args!("{}, line {}", path.display(), position.line()),
                problem,
            )
        };
        if let Some(stray) = record
            .iter()
            .skip(columns.len())
            .find(|cell| !cell.is_empty())
        {
            let problem = format!(
                "{} cells, but the header has {}, so that {:?} has no column; put cells that hold the delimiter in quotes",
                record.len(),
                columns.len(),
                String::from_utf8_lossy(stray)
            );
            return Err(at(problem));
        }
        let mut cells = Vec::with_capacity(columns.len());
        for ((name, column), cell) in columns.iter().zip(&record) {
            let text = text(cell).map_err(|problem| at(format!("column {name:?}: {problem}")))?;
            if !text.is_empty() {
                cells.push((*column, Cell::Text(text.to_owned())));
            }
        }
        let pushed = table.push(RowPlace::Record(position.clone()), cells);
        pushed.map_err(at)?;
    }
    Ok(())
}

/// The cell of a row in a column, whole.
pub(super) fn cell(path: &Path, delimiter: u8, position: &Position, column: &str) -> Result<Cell> {
    let wrong = |e: csv::Error| Error::data(path.display(), e);
    let mut reader = reader(path, delimiter)?;
    let header = reader.byte_headers().map_err(wrong)?;
    let at = header
        .iter()
        .position(|name| name.trim_ascii() == column.as_bytes());
    let mut record = ByteRecord::new();
    reader.seek(position.clone()).map_err(wrong)?;
    reader.read_byte_record(&mut record).map_err(wrong)?;
    let cell = at.and_then(|at| record.get(at)).unwrap_or_default();
    Ok(text(cell).map_or(Cell::Absent, |text| Cell::Text(text.to_owned())))
}

/// The text of a cell; the error names the first byte that is no UTF-8.
fn text(cell: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(cell).map_err(|e| {
        format!(
            "byte {} of the cell is not UTF-8; save the file as UTF-8",
            e.valid_up_to() + 1
        )
    })
}
