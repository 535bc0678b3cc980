//! Charts of OpenEQA scores by level of degradation: [`figures`].

use super::open_report::OpenReport;
use super::tables::ladder;
use crate::error::Result;
use crate::report::charts::chart::figure_chart::FigureChart;
use crate::report::charts::chart::{Chart, Figure, LineContent, LineStyle, Panel, PlotLine};
use crate::report::charts::paper::figure;
use crate::report::text::ladder::{Ladder, Series, SeriesByLevel};
use crate::types::AxisLevel;
use crate::types::text::counted;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::open::{Group, OpenCell};

/// Draws a chart of all questions and a chart with a panel for each category. Empty if the run has fewer than two
/// levels.
pub(super) fn figures(report: &OpenReport<'_>) -> Result<Vec<Figure>> {
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
    Panel { title: title(report, group), lines: curves.chain(flat_lines).collect(), model: None }
}

/// Scores of a series over the levels. L0 is the start of the series in the ladder.
fn curve(
    ladder: &Ladder<'_, OpenCell>,
    series: &Series<'_>,
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
