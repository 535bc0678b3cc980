//! Figures of a report on questions without true answers: [`figures`].

use crate::error::Result;
use crate::report::charts::chart::figure_chart::FigureChart;
use crate::report::charts::chart::{Chart, Figure, LineContent, LineStyle, Panel, PlotLine};
use crate::report::charts::paper::figure;
use crate::report::text::ladder::{Ladder, Series, SeriesByLevel};
use crate::types::AxisLevel;
use crate::types::text::counted;
use darkqa_score::comparisons::self_agreement::SelfAgreement;
use darkqa_score::comparisons::self_agreement::cell::{AgreementCell, CellRole};
use darkqa_score::estimate::Estimate;

/// Draws agreement by level with its floor, and the evidence kept, each with a panel for each variant. Empty if only
/// one level was asked.
///
/// # Errors
/// If a figure cannot be drawn.
pub(super) fn figures(found: &SelfAgreement<'_>) -> Result<Vec<Figure>> {
    let ladder = Ladder::new(found.whole().map(|cell| (&cell.subject, cell))).with_clean();
    if ladder.levels.len() < 2 {
        return Ok(Vec::new());
    }
    let note = format!(
        "n = {} in {}; bands and bars are 95 % intervals by {unit}; strict parsing",
        counted(found.items(), "item"),
        counted(found.grid.clusters, &found.unit.to_string()),
        unit = found.unit
    );
    let agreement = panels(found, &ladder, |cell| cell.agreement, |panel| panel.extend(floors(found)));
    let evidence = panels(
        found,
        &ladder,
        |cell| match cell.role() {
            // The ceiling is 100 % by definition.
            CellRole::Ceiling => None,
            _ => cell.evidence?.ok(),
        },
        |_| {},
    );
    let charts = [
        (
            "agreement",
            "Agreement of each model with its own answer at L0, not with the truth. L0: the same images asked again, the ceiling. \
             Broken lines: without images, the floor.",
            "agreement in %",
            agreement,
        ),
        (
            "evidence",
            "Evidence kept: the share of the way from the floor to the ceiling. Below 0 and above 100 % the line lies on the edge.",
            "evidence kept in %",
            evidence,
        ),
    ];
    let mut figures = Vec::new();
    for (name, caption, measure, panels) in charts {
        let panels: Vec<Panel> = panels.into_iter().filter(has_points).collect();
        if panels.is_empty() {
            continue;
        }
        let chart = Chart { measure, panels, columns: 2, note: note.clone() };
        figures.push(figure(name, caption, &FigureChart::Lines(chart))?);
    }
    Ok(figures)
}

/// True if a curve of the panel has a point.
fn has_points(panel: &Panel) -> bool {
    panel.lines.iter().any(|line| matches!(&line.content, LineContent::Curve(points) if !points.is_empty()))
}

/// One panel for each variant, raw or with one enhancer, with a line for each model. `add` adds further lines to a
/// panel.
fn panels(
    found: &SelfAgreement<'_>,
    ladder: &Ladder<'_, AgreementCell>,
    value: impl Fn(&AgreementCell) -> Option<Estimate>,
    add: impl Fn(&mut Vec<PlotLine>),
) -> Vec<Panel> {
    let mut panels: Vec<(String, Vec<PlotLine>)> = Vec::new();
    for (series, cells) in &ladder.series {
        // A series of clean frames alone has one level and makes no line.
        if series.axis().is_none() {
            continue;
        }
        let line = line(found, series, cells, &value);
        let title = series.light(&[]);
        match panels.iter_mut().find(|(known, _)| *known == title) {
            Some((_, lines)) => lines.push(line),
            None => panels.push((title, vec![line])),
        }
    }
    panels
        .into_iter()
        .map(|(title, mut lines)| {
            add(&mut lines);
            Panel { title: format!("{title}, n {}", found.items()), lines, model: None }
        })
        .collect()
}

fn line(
    found: &SelfAgreement<'_>,
    series: &Series<'_>,
    cells: &SeriesByLevel<'_, AgreementCell>,
    value: impl Fn(&AgreementCell) -> Option<Estimate>,
) -> PlotLine {
    let points: Vec<(AxisLevel, Estimate)> =
        cells.iter().filter_map(|(level, cell)| Some((*level, value(cell)?))).collect();
    PlotLine {
        name: series.model.to_owned(),
        style: style(found, series.model),
        content: LineContent::Curve(points),
        model: Some(series.model.to_owned()),
        items: None,
    }
}

/// Line style of a model, by its index in the report.
fn style(found: &SelfAgreement<'_>, model: &str) -> LineStyle {
    let models = found.models();
    let index = models.iter().position(|known| *known == model);
    LineStyle(index.unwrap_or(models.len()))
}

/// Horizontal line for each model that was asked without images.
fn floors(found: &SelfAgreement<'_>) -> Vec<PlotLine> {
    found
        .whole()
        .filter(|cell| cell.role() == CellRole::Floor)
        .filter_map(|cell| {
            let model = &*cell.subject.model;
            Some(PlotLine {
                name: format!("{model} without images"),
                style: style(found, model),
                content: LineContent::Flat(cell.agreement?.value),
                model: Some(model.to_owned()),
                items: None,
            })
        })
        .collect()
}
