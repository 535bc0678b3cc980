//! `summary.csv` and `summary.json` of a run of open questions.

use std::path::Path;

use serde::Serialize;

use super::OpenReport;
use crate::error::Result;
use crate::report::files::{as_csv, written};
use crate::score::estimate::Estimate;
use crate::score::open::{Against, OpenSummary};
use crate::types::manifest::RunManifest;
use crate::types::{AxisLevel, EnhancerName, ReadingName, View};

/// The schema of `summary.json`.
const SCHEMA: &str = "darkqa.openeqa-summary/1";

/// One row, in the order of the columns; scores and differences between 0 and 1.
#[derive(Serialize)]
struct Row<'a> {
    model: &'a str,
    view: Option<View>,
    level: Option<AxisLevel>,
    variant: &'static str,
    enhancer: Option<&'a EnhancerName>,
    by: &'static str,
    group: &'a str,
    due: usize,
    n: usize,
    missing: usize,
    unjudged: usize,
    unmarked: usize,
    null: usize,
    cut: usize,
    value: Option<f64>,
    low: Option<f64>,
    high: Option<f64>,
    /// Less the same model on lit frames.
    drop: Option<f64>,
    drop_low: Option<f64>,
    drop_high: Option<f64>,
    drop_n: Option<usize>,
    /// Less the same without an enhancer.
    gain: Option<f64>,
    gain_low: Option<f64>,
    gain_high: Option<f64>,
    reading: Option<&'a ReadingName>,
}

fn rows(summary: &OpenSummary) -> impl Iterator<Item = Row<'_>> {
    summary.cells.iter().map(|cell| {
        let subject = &cell.subject;
        let change = |against| -> Option<Estimate> {
            Some(summary.change(subject, against, &cell.group)?.difference)
        };
        let (drop, gain) = (change(Against::Lit), change(Against::Raw));
        Row {
            model: &subject.model,
            view: subject.view,
            level: subject.level,
            variant: subject.variant.word(),
            enhancer: subject.enhancer.as_ref(),
            by: cell.group.kind(),
            group: cell.group.name(),
            due: cell.due,
            n: cell.score.map_or(0, |score| score.n),
            missing: cell.missing,
            unjudged: cell.unjudged,
            unmarked: cell.unmarked,
            null: cell.null,
            cut: cell.cut,
            value: cell.score.map(|score| score.value),
            low: cell.score.map(|score| score.low),
            high: cell.score.map(|score| score.high),
            drop: drop.map(|drop| drop.value),
            drop_low: drop.map(|drop| drop.low),
            drop_high: drop.map(|drop| drop.high),
            drop_n: drop.map(|drop| drop.n),
            gain: gain.map(|gain| gain.value),
            gain_low: gain.map(|gain| gain.low),
            gain_high: gain.map(|gain| gain.high),
            reading: subject.variant.reading.as_ref(),
        }
    })
}

/// The summary as CSV.
pub(super) fn csv(summary: &OpenSummary) -> Result<Vec<u8>> {
    as_csv(rows(summary))
}

#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    folder: Option<&'a Path>,
    run: &'a RunManifest,
    judge: Option<&'a str>,
    protocol: String,
    clustered_by: &'static str,
    clusters: usize,
    rows: Vec<Row<'a>>,
}

/// The summary as JSON: the run's manifest, who marked and how, and the rows of the CSV; with the folder where it is not itself in
/// there.
pub fn json(report: &OpenReport<'_>, folder: Option<&Path>) -> Result<String> {
    let summary = report.summary;
    written(&Document {
        schema: SCHEMA,
        folder,
        run: report.manifest,
        judge: report.judge,
        protocol: report.protocol.to_string(),
        clustered_by: summary.unit,
        clusters: summary.clusters,
        rows: rows(summary).collect(),
    })
}
