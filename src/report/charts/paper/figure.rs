//! SVG figures of reports, at the width of a page: [`figure`], [`point_figure`] and [`count_figure`].

use super::counts::counts;
use super::points::points;
use super::rows::{arrange_in_rows, column_look};
use super::{Look, Palette, Sheet, sheet, svg};
use crate::error::{Error, Result};
use crate::report::charts::chart::Figure;
use crate::report::charts::chart::counts::CountPanel;
use crate::report::charts::chart::figure_chart::FigureChart;
use crate::report::charts::chart::points::PointPanel;

/// Width in points of a figure with several panels side by side: an A4 page between margins of 15 mm.
const WIDE: f64 = 510.0;
/// Width in points of a figure with one panel in a row (chosen).
const NARROW: f64 = 340.0;
/// Width in points of a panel of points and lines (chosen).
const PANEL: f64 = 300.0;
/// Font size in points.
const FONT_SIZE: f64 = 8.5;

/// Draws a figure of a report. The note of the chart is appended to the caption.
///
/// # Errors
/// If the data cannot be serialized.
pub(crate) fn figure(name: &'static str, caption: &str, chart: &FigureChart) -> Result<Figure> {
    let width = match chart {
        FigureChart::Lines(chart) if chart.columns.min(chart.panels.len()) == 1 => NARROW,
        FigureChart::Reliability(chart) if chart.panels.len() == 1 => NARROW,
        _ => WIDE,
    };
    Ok(Figure {
        name,
        caption: format!("{caption} ({}.)", chart.note()),
        svg: to_svg(sheet(chart, &look(width)))?,
        data: chart.script_data()?,
    })
}

/// Draws panels of points and lines side by side, as SVG.
///
/// # Errors
/// None in practice: only an embedded image can fail, and the panels have none.
pub(crate) fn point_figure(panels: &[PointPanel]) -> Result<String> {
    let columns = panels.len().max(1);
    let look = look(PANEL * columns as f64);
    let panels = panels.iter().map(|panel| points(panel, &column_look(columns, &look)));
    to_svg(arrange_in_rows(panels, columns, &look))
}

/// Draws panels of counts in two columns, as SVG.
///
/// # Errors
/// None in practice: only an embedded image can fail, and the panels have none.
pub(crate) fn count_figure(panels: &[CountPanel]) -> Result<String> {
    to_svg(counts(panels, &look(WIDE)))
}

fn look(width: f64) -> Look {
    Look { width, font_size: FONT_SIZE, palette: Palette::Colour }
}

/// SVG of a sheet without images, on a white background.
fn to_svg(sheet: Sheet) -> Result<String> {
    svg(&sheet.on_paper(), &|_| Err(Error::data("figure", "has no pictures")))
}
