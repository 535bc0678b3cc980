//! The records of a run for other Rust programs: [`StoredRun`].
//!
//! Rows of the record table, read in batches: [`RowBatches`].
//!
//! Places of a run's records in its log file, in the order of the table: [`ordered_places`].
//!
//! A row of the table of records ([`RecordRow`]), and the interface to the columns of an experiment ([`TableDetail`]).

use std::collections::{BTreeSet, HashMap};
use std::fmt::Write as _;
use std::hash::Hash;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::vec;

use rayon::prelude::*;

use crate::renamed::rename_record;
use crate::stored::{ExperimentKind, read_run_manifest};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::{RecordedNames, RunManifest};
use darkqa_base::types::text::suggestion;
use darkqa_base::types::{
    ChoiceDetail, Condition, ConditionColumns, Digest, ModelListing, OpenDetail, QuestionId, Record, RunQuestion,
    Severity, TrialKey,
};
use darkqa_score::answers::record::Detail;
use darkqa_store::{Cell, CellKind, Column, LinePlace, RecordLog, each_question, each_trial};

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

/// Maximum number of records in a batch. Chosen to be enough for all cores.
const MAX_RECORDS: usize = 1 << 14;

/// Maximum size of a batch, in bytes. Only a batch of one record may exceed it. An arbitrary choice.
const MAX_BYTES: usize = 16 << 20;

/// Rows of a run in order, read in batches to keep the records out of memory.
pub(super) struct RowBatches<D: TableDetail> {
    log: RecordLog,
    rows: Rows<D>,
    /// Places of the records in the log, in the order of the rows.
    places: Vec<LinePlace>,
    /// Number of records read so far.
    read: usize,
}

impl<D: TableDetail> RowBatches<D> {
    /// Opens the run in a folder.
    ///
    /// # Errors
    /// If a line of the run is malformed.
    pub(super) fn open(folder: &Path) -> Result<Self> {
        let manifest = read_run_manifest(folder)?;
        let mut questions = Vec::new();
        each_question(folder, |question| {
            questions.push(question.without_evidence());
        })?;
        Ok(Self {
            places: ordered_places(folder, &manifest, &questions)?,
            rows: Rows::new(folder, &manifest, &questions)?,
            log: RecordLog::open(folder)?,
            read: 0,
        })
    }

    /// Reads the next batch; `None` at the end. A batch is empty if none of its records has a row.
    ///
    /// # Errors
    /// If a record is malformed.
    pub(super) fn next_batch(&mut self) -> Result<Option<Vec<RecordRow<D>>>> {
        let unread = &self.places[self.read..];
        if unread.is_empty() {
            return Ok(None);
        }
        let batch = &unread[..batch_length(unread)];
        let lines = self.log.lines(batch)?;
        let records: Result<Vec<Record<D>>> = lines.par_iter().map(|line| self.log.record::<D>(line)).collect();
        self.read += batch.len();
        let rows = records?.into_iter().filter_map(|record| self.rows.row(record)).collect();
        Ok(Some(rows))
    }
}

/// Number of records in a batch that starts with the first of these places.
fn batch_length(places: &[LinePlace]) -> usize {
    let mut bytes = 0;
    places
        .iter()
        .take(MAX_RECORDS)
        .take_while(|place| {
            bytes += place.length;
            bytes <= MAX_BYTES
        })
        .count()
        .max(1)
}

/// The place of a record with its sort keys, in 48 bytes, so that the records themselves need not be kept in memory.
#[derive(Debug, Clone, Copy)]
struct RecordPlace {
    /// Number of the question in the run, from 1; 0 if the run does not have it.
    question: u32,
    /// Number of the condition in order of appearance.
    condition: u32,
    /// Number of the model in order of appearance.
    model: u32,
    repeat: u32,
    key: TrialKey,
    line: LinePlace,
}

/// The place of the last record of each trial, in the order of [`sort_trials`](crate::stored::sort_trials).
///
/// # Errors
/// If a line is not a record.
fn ordered_places(folder: &Path, manifest: &RunManifest, questions: &[RunQuestion]) -> Result<Vec<LinePlace>> {
    let names = RecordedNames::from_manifest(manifest);
    let ids: HashMap<&QuestionId, u32> = questions.iter().map(|question| &question.id).zip(1..).collect();
    let mut conditions = Numbering::<Option<Condition>>::default();
    let mut models = Numbering::<String>::default();
    let mut all = Vec::new();
    each_trial(folder, |trial, line| {
        all.push(RecordPlace {
            question: ids.get(&trial.question).copied().unwrap_or(0),
            condition: conditions.number(trial.condition),
            model: models.number(trial.model),
            repeat: trial.repeat,
            key: trial.key,
            line,
        });
    })?;
    // Keep the last record of each trial.
    all.sort_unstable_by_key(|place| (place.key, std::cmp::Reverse(place.line.start)));
    all.dedup_by_key(|place| place.key);
    let conditions = conditions.ranks(Clone::clone);
    let listing = ModelListing::new(manifest.models.iter().cloned());
    let models = models.ranks(|model| {
        let model = names.table_name(model);
        (listing.place(model), model.to_owned())
    });
    all.sort_unstable_by_key(|place| {
        let condition = conditions[place.condition as usize];
        let model = models[place.model as usize];
        (place.question, condition, model, place.repeat, place.key)
    });
    Ok(all.into_iter().map(|place| place.line).collect())
}

/// Numbers for distinct values, in order of appearance.
struct Numbering<T>(HashMap<T, u32>);

impl<T> Default for Numbering<T> {
    fn default() -> Self {
        Self(HashMap::new())
    }
}

impl<T: Eq + Hash> Numbering<T> {
    fn number(&mut self, value: T) -> u32 {
        let next = self.0.len() as u32;
        *self.0.entry(value).or_insert(next)
    }

    /// The rank of each number when values are sorted by `key`. Values with equal keys have the same rank.
    fn ranks<K: Ord + Hash>(self, key: impl Fn(&T) -> K) -> Vec<usize> {
        let mut values: Vec<(T, u32)> = self.0.into_iter().collect();
        values.sort_unstable_by_key(|(_, number)| *number);
        let keys: Vec<K> = values.iter().map(|(value, _)| key(value)).collect();
        let sorted: BTreeSet<&K> = keys.iter().collect();
        let ranks: HashMap<&K, usize> = sorted.into_iter().zip(0..).collect();
        keys.iter().map(|key| ranks[key]).collect()
    }
}

/// Record detail of an experiment with a table of records.
pub(super) trait TableDetail: Detail + Sync + 'static {
    /// Name of the table with its version. New columns are appended without a new version.
    const TABLE: &'static str;

    /// Data of the whole run, read before its rows are written.
    type Context: Send + Sync;

    /// Data of a row in addition to its record.
    type Extra: Send + Sync;

    /// The columns, in order.
    fn columns() -> Vec<Column<RecordRow<Self>>>;

    /// Reads the data of the whole run that rows need.
    ///
    /// # Errors
    /// If a record is broken.
    fn context(folder: &Path, manifest: &RunManifest, questions: &[RunQuestion]) -> Result<Self::Context>;

    /// The additional data of a record's row; `None` if the record has no row.
    fn extra(context: &Self::Context, record: &Record<Self>) -> Option<Self::Extra>;

    /// Name of the frame or walk of the question.
    fn frame(&self) -> &str;

    /// Family or category of the question.
    fn family(&self) -> &str;

    /// The first image sent.
    fn image(&self) -> Option<SentImage<'_>>;
}

/// The image of a record as sent.
pub(super) struct SentImage<'a> {
    pub(super) digest: &'a Digest,
    pub(super) bytes: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) format: &'a str,
}

/// A record with the data of the run that its columns need.
pub(super) struct RecordRow<D: TableDetail> {
    pub(super) record: Record<D>,
    pub(super) condition: Arc<ConditionCells>,
    /// `None` if the run does not have the question.
    pub(super) question: Option<Arc<QuestionCells>>,
    pub(super) extra: D::Extra,
}

/// Values of the columns about a condition.
pub(super) struct ConditionCells {
    pub(super) condition: Option<String>,
    pub(super) level: Option<String>,
    pub(super) variant: String,
    pub(super) ev: Option<f64>,
    pub(super) severity: Option<f64>,
    pub(super) profile: Option<String>,
    pub(super) enhancer: Option<String>,
}

impl ConditionCells {
    fn new(condition: Option<&Condition>) -> Self {
        let columns = ConditionColumns::new(condition);
        Self {
            condition: columns.condition.map(ToString::to_string),
            level: columns.level.map(|level| level.to_string()),
            variant: columns.variant,
            ev: columns.ev,
            severity: columns.severity.map(Severity::value),
            profile: columns.reading.map(ToString::to_string),
            enhancer: columns.enhancer.map(ToString::to_string),
        }
    }
}

/// Values of the columns about a question.
pub(super) struct QuestionCells {
    /// `None` if the data set has no scenes.
    pub(super) scene: Option<String>,
    /// `None` if the true answer is unknown.
    pub(super) answer: Option<String>,
}

/// Makes the rows of a run's records.
pub(super) struct Rows<D: TableDetail> {
    names: RecordedNames,
    conditions: HashMap<Option<Condition>, Arc<ConditionCells>>,
    questions: HashMap<QuestionId, Arc<QuestionCells>>,
    context: D::Context,
}

impl<D: TableDetail> Rows<D> {
    /// Reads the data that the rows of a run need.
    ///
    /// # Errors
    /// If a record is broken.
    pub(super) fn new(folder: &Path, manifest: &RunManifest, questions: &[RunQuestion]) -> Result<Self> {
        let questions_by_id = questions
            .iter()
            .map(|question| {
                let cells = QuestionCells {
                    scene: Some(question.scene.clone()).filter(|scene| !scene.is_empty()),
                    answer: question.answer.clone(),
                };
                (question.id.clone(), Arc::new(cells))
            })
            .collect();
        Ok(Self {
            names: RecordedNames::from_manifest(manifest),
            conditions: HashMap::new(),
            questions: questions_by_id,
            context: D::context(folder, manifest, questions)?,
        })
    }

    /// The row of a record; `None` if it has none.
    pub(super) fn row(&mut self, mut record: Record<D>) -> Option<RecordRow<D>> {
        rename_record(&mut record, &self.names);
        let extra = D::extra(&self.context, &record)?;
        let condition = if let Some(known) = self.conditions.get(&record.condition) {
            Arc::clone(known)
        } else {
            let cells = Arc::new(ConditionCells::new(record.condition.as_ref()));
            self.conditions.insert(record.condition.clone(), Arc::clone(&cells));
            cells
        };
        Some(RecordRow { question: self.questions.get(&record.question).map(Arc::clone), condition, extra, record })
    }
}
