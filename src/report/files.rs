//! `summary.csv` and `summary.json`: every number of a run with its interval.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use crate::error::{Error, Result};
use crate::score::accuracy::{Cell, Summary};
use crate::score::choice::Mode;
use crate::types::manifest::RunManifest;
use crate::types::{AxisLevel, EnhancerName, Family, ReadingName, View, Why};

/// The schema of `summary.json`.
const SCHEMA: &str = "darkqa.summary/1";

/// One row, in the order of the columns.
#[derive(Serialize)]
struct Row<'a> {
    model: &'a str,
    view: Option<View>,
    level: Option<AxisLevel>,
    variant: &'static str,
    enhancer: Option<&'a EnhancerName>,
    family: &'a str,
    mode: Mode,
    n: usize,
    right: Option<usize>,
    unparsed: usize,
    failed: usize,
    value: Option<f64>,
    low: Option<f64>,
    high: Option<f64>,
    /// The share of questions answered rightly every time; a column only where questions were asked more than once.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[expect(
        clippy::option_option,
        reason = "the column may be absent, and a cell in it empty"
    )]
    always: Option<Option<f64>>,
    reading: Option<&'a ReadingName>,
}

fn rows(summary: &Summary) -> impl Iterator<Item = Row<'_>> {
    let repeated = summary.cells.iter().any(|cell| cell.always.is_some());
    summary.cells.iter().map(move |cell| Row {
        always: repeated.then(|| cell.always.map(|always| always.value)),
        ..Row::of(cell)
    })
}

impl<'a> Row<'a> {
    fn of(cell: &'a Cell) -> Self {
        let subject = &cell.subject;
        Self {
            model: &subject.model,
            view: subject.view,
            level: subject.level,
            variant: subject.variant.word(),
            enhancer: subject.enhancer.as_ref(),
            family: cell.family.as_ref().map_or(Family::TOTAL, Family::name),
            mode: cell.mode,
            n: cell.accuracy.map_or(0, |accuracy| accuracy.n),
            right: subject.view.map(|_| cell.right),
            unparsed: cell.unparsed,
            failed: cell.failed,
            value: cell.accuracy.map(|accuracy| accuracy.value),
            low: cell.accuracy.map(|accuracy| accuracy.low),
            high: cell.accuracy.map(|accuracy| accuracy.high),
            always: None,
            reading: subject.variant.reading.as_ref(),
        }
    }
}

/// The summary as CSV: `model, view, level, variant, enhancer, family, mode, n, right, unparsed, failed, value, low,
/// high`, `always` where questions were asked more than once, and `reading`; a cell is empty where there is nothing to say.
pub fn csv(summary: &Summary) -> Result<Vec<u8>> {
    as_csv(rows(summary))
}

/// Rows of a summary as CSV.
pub(super) fn as_csv(rows: impl Iterator<Item = impl Serialize>) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let unwritten = |e: &dyn std::fmt::Display| Error::data("summary.csv", e);
    for row in rows {
        writer.serialize(row).map_err(|e| unwritten(&e))?;
    }
    writer.into_inner().map_err(|e| unwritten(&e))
}

#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    folder: Option<&'a Path>,
    #[serde(skip_serializing_if = "Option::is_none")]
    run: Option<&'a RunManifest>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    runs: Vec<Compared<'a>>,
    unread: &'a BTreeMap<Why, usize>,
    rows: Vec<Row<'a>>,
}

/// A run among several.
#[derive(Serialize)]
struct Compared<'a> {
    folder: &'a Path,
    run: &'a RunManifest,
}

/// The summary of several runs as JSON: their folders and manifests, and the rows of the CSV.
pub fn json_of_several(summary: &Summary, runs: &[(&RunManifest, &Path)]) -> Result<String> {
    let runs = runs.iter().map(|&(run, folder)| Compared { folder, run });
    written(&Document {
        schema: SCHEMA,
        folder: None,
        run: None,
        runs: runs.collect(),
        unread: &summary.unread,
        rows: rows(summary).collect(),
    })
}

/// The summary as JSON: the run's manifest and the rows of the CSV; with the folder where it is not itself in there.
pub fn json(summary: &Summary, run: &RunManifest, folder: Option<&Path>) -> Result<String> {
    written(&Document {
        schema: SCHEMA,
        folder,
        run: Some(run),
        runs: Vec::new(),
        unread: &summary.unread,
        rows: rows(summary).collect(),
    })
}

/// A summary as JSON.
pub(super) fn written(document: &impl Serialize) -> Result<String> {
    serde_json::to_string_pretty(document)
        .map(|text| text + "\n")
        .map_err(|e| Error::data("summary.json", e))
}
