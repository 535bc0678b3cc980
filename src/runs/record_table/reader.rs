//! The records of a run for other Rust programs: [`StoredRun`].

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::vec;

use super::batches::RowBatches;
use super::row::TableDetail;
use crate::error::{Error, Result};
use crate::runs::stored::ExperimentKind;
use crate::store::{Cell, CellKind};
use crate::types::text::near_name::suggestion;
use crate::types::{ChoiceDetail, OpenDetail};

/// A run folder, of questions with choices or of open questions.
#[derive(Debug)]
pub struct StoredRun {
    folder: PathBuf,
    kind: ExperimentKind,
}

impl StoredRun {
    /// Opens the folder of a run.
    ///
    /// # Errors
    /// If the folder has no run, or one that this version cannot read.
    pub fn open(folder: impl AsRef<Path>) -> Result<Self> {
        let folder = folder.as_ref().to_owned();
        let kind = ExperimentKind::read(&folder)?;
        Ok(Self { folder, kind })
    }

    /// The records, one for each trial, with the columns and in the order of `records.parquet`. They are read in
    /// batches.
    ///
    /// # Errors
    /// If a line of the run is broken.
    pub fn records(&self) -> Result<Records> {
        match self.kind {
            ExperimentKind::Choice => Records::new::<ChoiceDetail>(&self.folder),
            ExperimentKind::Open => Records::new::<OpenDetail>(&self.folder),
        }
    }
}

/// An iterator over the records of a run.
pub struct Records {
    columns: Arc<[Heading]>,
    next_batch: Box<dyn FnMut() -> Result<Option<Vec<RunRecord>>> + Send>,
    batch: vec::IntoIter<RunRecord>,
}

/// Name and type of a column.
#[derive(Debug, Clone, Copy)]
struct Heading {
    name: &'static str,
    kind: CellKind,
}

/// A record of a run: the reply to one question by one model in one condition.
#[derive(Debug, Clone)]
pub struct RunRecord {
    columns: Arc<[Heading]>,
    cells: Vec<Cell<'static>>,
}

impl Records {
    fn new<D: TableDetail>(folder: &Path) -> Result<Self> {
        let table = D::columns();
        let columns: Arc<[Heading]> =
            table.iter().map(|column| Heading { name: column.name, kind: column.kind }).collect();
        let mut batches = RowBatches::<D>::open(folder)?;
        let headings = Arc::clone(&columns);
        Ok(Self {
            columns,
            next_batch: Box::new(move || -> Result<Option<Vec<RunRecord>>> {
                let rows = batches.next_batch()?;
                Ok(rows.map(|rows| {
                    rows.iter()
                        .map(|row| RunRecord {
                            columns: Arc::clone(&headings),
                            cells: table.iter().map(|column| owned_cell((column.value)(row))).collect(),
                        })
                        .collect()
                }))
            }),
            batch: Vec::new().into_iter(),
        })
    }

    /// The names of the columns, in their order.
    pub fn columns(&self) -> impl Iterator<Item = &'static str> + '_ {
        self.columns.iter().map(|column| column.name)
    }
}

impl Iterator for Records {
    type Item = Result<RunRecord>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(record) = self.batch.next() {
                return Some(Ok(record));
            }
            match (self.next_batch)() {
                Ok(Some(batch)) => self.batch = batch.into_iter(),
                Ok(None) => return None,
                Err(e) => {
                    // An error ends the iterator.
                    self.next_batch = Box::new(|| Ok(None));
                    return Some(Err(e));
                }
            }
        }
    }
}

impl RunRecord {
    /// The text in a column; `None` if it is null. Keys and digests are hexadecimal.
    ///
    /// # Errors
    /// If there is no such column, or its type is not text.
    pub fn text(&self, column: &str) -> Result<Option<&str>> {
        match self.cell(column)? {
            (Cell::Null, CellKind::Text | CellKind::LongText | CellKind::Key | CellKind::Digest) => Ok(None),
            (Cell::Text(text), _) => Ok(Some(text.as_ref())),
            _ => Err(other_type(column, "texts")),
        }
    }

    /// The number in a column; `None` if it is null.
    ///
    /// # Errors
    /// If there is no such column, or its type is not a number.
    pub fn number(&self, column: &str) -> Result<Option<f64>> {
        match self.cell(column)? {
            (Cell::Null, CellKind::Int8 | CellKind::Int16 | CellKind::Int32 | CellKind::Double) => Ok(None),
            (Cell::Int(number), _) => Ok(Some(*number as f64)),
            (Cell::Double(number), _) => Ok(Some(*number)),
            _ => Err(other_type(column, "numbers")),
        }
    }

    /// The truth value in a column; `None` if it is null.
    ///
    /// # Errors
    /// If there is no such column, or its type is not a truth value.
    pub fn flag(&self, column: &str) -> Result<Option<bool>> {
        match self.cell(column)? {
            (Cell::Null, CellKind::Bool) => Ok(None),
            (Cell::Bool(flag), _) => Ok(Some(*flag)),
            _ => Err(other_type(column, "truth values")),
        }
    }

    fn cell(&self, column: &str) -> Result<(&Cell<'static>, CellKind)> {
        let place = self.columns.iter().position(|known| known.name == column);
        let cell = place.and_then(|place| Some((self.cells.get(place)?, self.columns[place].kind)));
        cell.ok_or_else(|| {
            let names: Vec<&str> = self.columns.iter().map(|column| column.name).collect();
            let problem = format!("no such column of records{}", suggestion(column, &names));
            Error::data(column, problem)
        })
    }
}

fn other_type(column: &str, expected: &str) -> Error {
    Error::data(column, format_args!("the column holds no {expected}"))
}

/// Copies a cell so that it outlives its row. Bytes become hexadecimal text.
fn owned_cell(cell: Cell<'_>) -> Cell<'static> {
    match cell {
        Cell::Null => Cell::Null,
        Cell::Text(text) => Cell::Text(text.into_owned().into()),
        Cell::Bytes(bytes) => {
            let mut text = String::with_capacity(bytes.len() * 2);
            for byte in bytes {
                let _ = write!(text, "{byte:02x}");
            }
            Cell::Text(text.into())
        }
        Cell::Int(number) => Cell::Int(number),
        Cell::Double(number) => Cell::Double(number),
        Cell::Bool(flag) => Cell::Bool(flag),
    }
}
