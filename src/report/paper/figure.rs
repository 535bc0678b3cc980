//! A figure of a report at the width of a page: [`figure`].

use super::{Look, Palette, sheet, svg};
use crate::error::{Error, Result};
use crate::report::chart::Figure;
use crate::report::chart::drawn::Drawn;

/// Width in points of a figure with panels side by side, and of one with a panel in a row: a page of A4 has 510 points between margins
/// of 15 mm.
const WIDE: f64 = 510.0;
const NARROW: f64 = 340.0;
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
    let look = Look {
        width,
        letters: LETTERS,
        palette: Palette::Colour,
    };
    let no_pictures = |_: &_| Err(Error::data("figure", "has no pictures"));
    Ok(Figure {
        name,
        caption: format!("{caption} ({}.)", shown.note()),
        svg: svg(&sheet(shown, &look).on_paper(), &no_pictures)?,
        data: shown.data()?,
    })
}
