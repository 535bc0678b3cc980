//! `summary.json`: a head about the run, and the rows of `summary.csv` that are shown.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Serialize, Serializer};

use crate::error::{Error, Result};
use crate::report::choice_report::ChoiceReport;
use crate::report::report_length::ReportLength;
use crate::sentences::Sentence;
use crate::tables::{BASELINE, strict_groups, summary_rows};
use crate::text::alert::Alert;
use crate::text::csv::fields;
use crate::text::noise_profiles::NoiseProfiles;
use crate::text::table::{Table, TableRow};
use crate::types::UnreadReason;
use crate::types::manifests::RunManifest;

/// A head, and the rows of tables as objects with the column names as keys.
#[derive(Serialize)]
struct Document<'a, H> {
    #[serde(flatten)]
    head: H,
    /// The rows of the summary; left out with the findings alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    rows: Option<Rows<'a>>,
    /// Every table by the name of its file; only in a full report.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    tables: BTreeMap<&'a str, Rows<'a>>,
}

/// The rows of tables with the same columns as objects.
pub(super) struct Rows<'a>(&'a [Table]);

impl<'a> Rows<'a> {
    /// The rows of one table.
    pub(super) fn new(table: &'a Table) -> Self {
        Self(std::slice::from_ref(table))
    }
}

impl Serialize for Rows<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let rows = self.0.iter();
        serializer.collect_seq(
            rows.flat_map(|table| table.rows.iter().map(move |row| Named { table, row })),
        )
    }
}

struct Named<'a> {
    table: &'a Table,
    row: &'a TableRow,
}

impl Serialize for Named<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let cells = self.table.cells(self.row);
        serializer.collect_map(cells.flat_map(|(column, cell)| {
            let names = &column.heads.csv;
            names.iter().zip(fields(cell, names.len()))
        }))
    }
}

/// A head, the summary's rows, and in a full report every table, as one JSON document.
///
/// # Errors
/// If the document cannot be written.
pub(super) fn document(
    head: impl Serialize,
    rows: &Table,
    tables: &[Table],
    length: ReportLength,
) -> Result<String> {
    let document = Document {
        head,
        rows: (length != ReportLength::Findings).then(|| Rows::new(rows)),
        tables: tables
            .chunk_by(|one, other| one.name == other.name)
            .filter(|parts| {
                let mut columns = parts[0].columns.iter();
                length == ReportLength::Full && columns.any(|column| !column.heads.csv.is_empty())
            })
            .map(|parts| (parts[0].name, Rows(parts)))
            .collect(),
    };
    serde_json::to_string_pretty(&document)
        .map(|text| text + "\n")
        .map_err(|e| Error::data("summary.json", e))
}

/// The head of the summary of an evaluation.
#[derive(Serialize)]
struct Head<'a> {
    #[serde(flatten)]
    runs: RunsHead<'a>,
    /// The noise profiles of the noisy images.
    readings: NoiseProfiles,
    unread: &'a BTreeMap<UnreadReason, usize>,
    alerts: &'a [Alert],
    findings: &'a [Sentence],
    /// The rows of `groups.csv`, without the observer if it is not shown.
    #[serde(skip_serializing_if = "Option::is_none")]
    groups: Option<Rows<'a>>,
    /// The rows of `baseline.csv`.
    #[serde(skip_serializing_if = "Option::is_none")]
    baseline: Option<Rows<'a>>,
}

/// The head of a summary of runs: one run with its folder, or several; the others are left out.
#[derive(Serialize)]
pub(super) struct RunsHead<'a> {
    schema: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    folder: Option<&'a Path>,
    #[serde(skip_serializing_if = "Option::is_none")]
    run: Option<&'a RunManifest>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    runs: Vec<ComparedRun<'a>>,
}

/// One of several runs.
#[derive(Serialize)]
struct ComparedRun<'a> {
    folder: &'a Path,
    run: &'a RunManifest,
}

/// The runs that a summary is about.
#[derive(Debug, Clone, Copy)]
pub(crate) enum RunList<'a> {
    /// One run, with its folder if the summary is not stored there.
    One(&'a RunManifest, Option<&'a Path>),
    /// Several runs, each with its folder.
    Several(&'a [(&'a RunManifest, &'a Path)]),
}

impl<'a> RunList<'a> {
    /// The head of a summary in this schema.
    pub(super) fn head(self, schema: &'static str) -> RunsHead<'a> {
        let (run, folder, runs) = match self {
            Self::One(run, folder) => (Some(run), folder, [].as_slice()),
            Self::Several(runs) => (None, None, runs),
        };
        let runs = runs
            .iter()
            .map(|&(run, folder)| ComparedRun { folder, run });
        RunsHead {
            schema,
            folder,
            run,
            runs: runs.collect(),
        }
    }
}

/// The summary of runs as JSON.
///
/// # Errors
/// If the document cannot be written.
pub(crate) fn summary(
    report: &ChoiceReport<'_>,
    runs: RunList<'_>,
    length: ReportLength,
) -> Result<String> {
    let mut tables = report.tables.iter();
    let groups = strict_groups(report.findings);
    let head = Head {
        runs: runs.head("darkqa.summary/1"),
        readings: NoiseProfiles::new(&report.findings.grid.subjects),
        unread: &report.findings.summary.unread,
        alerts: &report.alerts,
        findings: &report.sentences,
        groups: (!groups.is_empty()).then_some(Rows(&groups)),
        baseline: tables.find(|table| table.name == BASELINE).map(Rows::new),
    };
    document(
        head,
        &summary_rows(&report.findings.summary, &report.findings.grid.listing),
        &report.tables,
        length,
    )
}
