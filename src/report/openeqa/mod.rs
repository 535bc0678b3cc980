//! Report on open questions: its files ([`products`], [`summary_json`]) and its text for the terminal ([`render`]).
//!
//! Charts of OpenEQA scores by level of degradation: [`figures`].

mod open_report;
mod page;
mod tables;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use serde::Serialize;

use crate::error::Result;
use crate::report::charts::chart::{self, Chart, Figure, FigureChart, LineContent, LineStyle, Panel, PlotLine};
use crate::report::charts::paper::figure;
use crate::report::json;
use crate::report::products::{PAGE, table_files};
use crate::report::text::alert::{Alert, lines};
use crate::report::text::ladder::{Ladder, LadderSeries, SeriesByLevel};
use crate::report::text::table::Table;
use crate::report::text::terminal::{self, wrapped};
use crate::report::text::words::ProfileNames;
use crate::runs::outcome::ReportLength;
use crate::types::AxisLevel;
use crate::types::manifests::RunManifest;
use crate::types::text::counted;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::open::{Group, OpenCell};
use tables::ladder;

pub(crate) use open_report::{OpenReport, ReportedAnswer};
pub(crate) use tables::tables;

pub(super) use page::coverage;

/// Files of a run by name: numbers as CSV, the table as LaTeX, figures as SVG, answers and marks in upstream's format,
/// and the HTML page.
///
/// # Errors
/// If a file cannot be made.
pub(crate) fn products(report: &OpenReport<'_>, tables: &[Table]) -> Result<Vec<(String, Vec<u8>)>> {
    let figures = figures(report)?;
    let page = page::page(report, tables, &figures)?;
    let mut files = table_files(tables, &[], "Table")?;
    files.extend(chart::svg_files(figures));
    files.extend(tables::files(report)?);
    files.push((PAGE.to_owned(), page.into_bytes()));
    Ok(files)
}

/// Head of `summary.json`.
#[derive(Serialize)]
struct OpenHead<'a> {
    schema: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    folder: Option<&'a Path>,
    run: &'a RunManifest,
    /// Further runs of the report, by name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    joined: BTreeMap<&'a str, &'a RunManifest>,
    judge: Option<&'a str>,
    protocol: String,
    clustered_by: &'static str,
    clusters: usize,
    /// Noise profiles of the noisy images.
    readings: ProfileNames,
    alerts: &'a [Alert],
}

/// Serializes the summary as JSON: manifest of the run, judge, protocol, and the rows of the CSV file. `folder` is the
/// run's folder if the summary is stored elsewhere.
///
/// # Errors
/// If the summary cannot be serialized.
pub(crate) fn summary_json(
    report: &OpenReport<'_>,
    tables: &[Table],
    folder: Option<&Path>,
    length: ReportLength,
) -> Result<String> {
    let head = OpenHead {
        schema: "darkqa.openeqa-summary/1",
        folder,
        run: report.manifest,
        joined: report.runs.iter().skip(1).copied().collect(),
        judge: report.judge,
        protocol: report.protocol.to_string(),
        clustered_by: report.summary.unit,
        clusters: report.summary.clusters,
        readings: report.noise_profiles(),
        alerts: report.alerts,
    };
    json::document(head, &tables[0], tables, length)
}

/// Text of the report for the terminal: progress of an incomplete run, scores by level, split and category, number of
/// scored answers, and folders of the runs.
#[must_use]
pub(crate) fn render(report: &OpenReport<'_>, tables: &[Table], folders: &[&Path]) -> String {
    let mut text = lines(report.alerts);
    text += &terminal::progress(report.manifest, "answers and marks stored");
    match report.judge {
        Some(_) => text += &terminal::render(tables),
        None => text += "No answer is marked: name a judge with --judge NAME\n",
    }
    let open = report.noise_profiles().open_question();
    for line in coverage(report).into_iter().chain(open) {
        text += &wrapped("", &line, " ");
    }
    for folder in folders {
        let _ = writeln!(text, "run: {}", folder.display());
    }
    text
}

/// Draws a chart of all questions and a chart with a panel for each category. Empty if the run has fewer than two
/// levels.
fn figures(report: &OpenReport<'_>) -> Result<Vec<Figure>> {
    let whole = ladder(report.summary, &Group::All);
    if whole.levels.len() < 2 {
        return Ok(Vec::new());
    }
    let categories: Vec<Panel> = report
        .summary
        .groups()
        .into_iter()
        .filter(|group| matches!(group, Group::Category(_)))
        .flat_map(|group| panels(report, group, &whole))
        .collect();
    let note = format!(
        "bands and bars are 95 % intervals by {}, {}",
        report.summary.unit,
        counted(report.summary.clusters, "cluster")
    );
    let charts = [
        (
            "scores",
            if whole.without_level.is_empty() {
                "Score by level."
            } else {
                "Score by level. Broken lines: without images."
            },
            panels(report, &Group::All, &whole),
            1,
        ),
        ("categories", "Score by category.", categories, 3),
    ];
    let mut figures = Vec::new();
    for (name, caption, panels, columns) in charts {
        if panels.is_empty() {
            continue;
        }
        let chart = Chart { measure: "score in %", panels, columns, note: note.clone() };
        figures.push(figure(name, caption, &FigureChart::Lines(chart))?);
    }
    Ok(figures)
}

/// Panels of a group of questions: one per degradation axis.
fn panels(report: &OpenReport<'_>, group: &Group, whole: &Ladder<'_, OpenCell>) -> Vec<Panel> {
    ladder(report.summary, group)
        .by_axis()
        .into_iter()
        .map(|(_, ladder)| panel(report, group, whole, &ladder))
        .collect()
}

/// One panel: a curve per series, and a flat line per model without images. A series has the same line style in every
/// panel: that of its position in `whole`, the ladder of all questions.
fn panel(report: &OpenReport<'_>, group: &Group, whole: &Ladder<'_, OpenCell>, ladder: &Ladder<'_, OpenCell>) -> Panel {
    let series_count = whole.series.len();
    let curves = ladder.series.iter().map(|(series, cells)| {
        let position = whole.series.keys().position(|other| other == series);
        let style = LineStyle(position.unwrap_or(series_count));
        curve(ladder, series, cells, style)
    });
    let flat_lines = ladder
        .without_level
        .iter()
        .enumerate()
        .filter_map(|(index, (subject, cell))| flat_line(subject, cell, LineStyle(series_count + index)));
    Panel { title: title(report, group), lines: curves.chain(flat_lines).collect(), model: None, lux: None }
}

/// Scores of a series over the levels. L0 is the start of the series in the ladder.
fn curve(
    ladder: &Ladder<'_, OpenCell>,
    series: &LadderSeries<'_>,
    cells: &SeriesByLevel<'_, OpenCell>,
    style: LineStyle,
) -> PlotLine {
    let clean = ladder.l0_cell(series).map(|cell| (AxisLevel::L0, cell));
    let degraded = cells.iter().map(|(level, cell)| (*level, *cell)).filter(|(level, _)| *level != AxisLevel::L0);
    let points = clean.into_iter().chain(degraded).filter_map(|(level, cell)| Some((level, cell.score?))).collect();
    PlotLine {
        name: format!("{}, {}", series.model, series.light(&[])),
        style,
        content: LineContent::Curve(points),
        model: Some(series.model.to_owned()),
        items: None,
    }
}

/// Score of a model without images, which is the same at all levels; `None` without a score.
fn flat_line(subject: &ModelInCondition, cell: &OpenCell, style: LineStyle) -> Option<PlotLine> {
    Some(PlotLine {
        name: format!("{} without images", subject.model),
        style,
        content: LineContent::Flat(cell.score?.value),
        model: Some(subject.model.clone()),
        items: None,
    })
}

/// Title of a panel: the name of the group and its number of questions.
fn title(report: &OpenReport<'_>, group: &Group) -> String {
    let questions = match group {
        Group::All => report.questions.len(),
        Group::Split(name) | Group::Category(name) => {
            report.questions.iter().filter(|question| question.family.name() == name).count()
        }
    };
    format!("{}, n {questions}", group.name())
}
