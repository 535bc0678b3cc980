//! Figures of the scores by level: [`figures`].

use super::open_report::OpenReport;
use super::tables::ladder;
use crate::drawing::chart::drawn::Drawn;
use crate::drawing::chart::{Chart, Figure, LineStyle, Panel, PanelContent, PlotLine};
use crate::drawing::paper::figure;
use crate::error::Result;
use crate::text::ladder::Ladder;
use crate::types::AxisLevel;
use darkqa_score::open::{Group, OpenCell};

/// Scores by level: all questions together, and by category if there are several.
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
        "bands and bars are 95 % intervals by {} ({} clusters)",
        report.summary.unit, report.summary.clusters
    );
    let charts = [
        (
            "scores",
            "Score by level. Broken lines: without images.",
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
        let chart = Chart {
            measure: "score in %",
            panels,
            columns,
            note: note.clone(),
        };
        figures.push(figure(name, caption, &Drawn::Lines(chart))?);
    }
    Ok(figures)
}

/// The panels of a group, one for each axis.
fn panels(report: &OpenReport<'_>, group: &Group, whole: &Ladder<'_, OpenCell>) -> Vec<Panel> {
    ladder(report.summary, group)
        .by_axis()
        .into_iter()
        .map(|(_, ladder)| panel(report, group, whole, &ladder))
        .collect()
}

/// A panel of a group: a curve for each series, and a flat line for each model without images. The style of a series is its place
/// in the `whole`.
fn panel(
    report: &OpenReport<'_>,
    group: &Group,
    whole: &Ladder<'_, OpenCell>,
    ladder: &Ladder<'_, OpenCell>,
) -> Panel {
    let seeing = whole.series.len();
    let lines = ladder.series.iter().map(|(series, cells)| {
        let index = whole.series.keys().position(|other| other == series);
        let start = ladder.start(series).map(|cell| (AxisLevel::L0, cell));
        let dark = cells
            .iter()
            .map(|(level, cell)| (*level, *cell))
            .filter(|(level, _)| *level != AxisLevel::L0);
        let points = start
            .into_iter()
            .chain(dark)
            .filter_map(|(level, cell)| Some((level, cell.score?)));
        PlotLine {
            name: format!("{}, {}", series.model, series.light(&[])),
            style: LineStyle(index.unwrap_or(seeing)),
            content: PanelContent::Curve(points.collect()),
            model: Some(series.model.to_owned()),
            items: None,
        }
    });
    let blind = ladder
        .without_level
        .iter()
        .enumerate()
        .filter_map(|(index, (subject, cell))| {
            Some(PlotLine {
                name: format!("{} without images", subject.model),
                style: LineStyle(seeing + index),
                content: PanelContent::Flat(cell.score?.value),
                model: Some(subject.model.clone()),
                items: None,
            })
        });
    let n = report.questions.len();
    let title = match group {
        Group::All => format!("all, n {n}"),
        part => {
            let questions = report
                .questions
                .iter()
                .filter(|question| question.family.name() == part.name())
                .count();
            format!("{}, n {questions}", part.name())
        }
    };
    Panel {
        title,
        lines: lines.chain(blind).collect(),
        model: None,
    }
}
