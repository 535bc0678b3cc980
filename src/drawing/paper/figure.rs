//! Figures of reports at the width of a page, as SVG: [`figure`], [`point_figure`] and [`count_figure`].

use super::counts::counts;
use super::points::points;
use super::rows::{column, in_rows};
use super::{Look, Palette, Sheet, sheet, svg};
use crate::drawing::chart::Figure;
use crate::drawing::chart::counts::CountPanel;
use crate::drawing::chart::drawn::Drawn;
use crate::drawing::chart::points::PointPanel;
use crate::error::{Error, Result};

/// Width in points of a figure with panels side by side, and of one with a panel in a row: a page of A4 has 510 points between margins
/// of 15 mm.
const WIDE: f64 = 510.0;
const NARROW: f64 = 340.0;
/// Width in points of a panel of points and lines; chosen.
const PANEL: f64 = 300.0;
/// Height of the letters in points.
const LETTERS: f64 = 8.5;

/// A figure of a report from what it shows. The caption gets the note of the chart.
///
/// # Errors
/// If the data cannot be written.
pub(crate) fn figure(name: &'static str, caption: &str, shown: &Drawn) -> Result<Figure> {
    let width = match shown {
        Drawn::Lines(chart) if chart.columns.min(chart.panels.len()) == 1 => NARROW,
        Drawn::Reliability(chart) if chart.panels.len() == 1 => NARROW,
        _ => WIDE,
    };
    Ok(Figure {
        name,
        caption: format!("{caption} ({}.)", shown.note()),
        svg: without_pictures(sheet(shown, &look(width)))?,
        data: shown.data()?,
    })
}

/// Panels of points and lines side by side.
///
/// # Errors
/// None in practice: a panel has no picture, which alone may fail.
pub(crate) fn point_figure(panels: &[PointPanel]) -> Result<String> {
    let columns = panels.len().max(1);
    let look = look(PANEL * columns as f64);
    let panels = panels
        .iter()
        .map(|panel| points(panel, &column(columns, &look)));
    without_pictures(in_rows(panels, columns, &look))
}

/// Panels of counts in two columns.
///
/// # Errors
/// None in practice: a panel has no picture, which alone may fail.
pub(crate) fn count_figure(panels: &[CountPanel]) -> Result<String> {
    without_pictures(counts(panels, &look(WIDE)))
}

fn look(width: f64) -> Look {
    Look {
        width,
        letters: LETTERS,
        palette: Palette::Colour,
    }
}

fn without_pictures(sheet: Sheet) -> Result<String> {
    svg(&sheet.on_paper(), &|_| {
        Err(Error::data("figure", "has no pictures"))
    })
}
