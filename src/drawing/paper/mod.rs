//! The figures of reports, and of papers at the width of a column, with one bundled font: as PDF, SVG and pgfplots.
//!
//! A chart becomes a [`Sheet`] of marks in points; PDF and SVG write the same marks. What a figure says in words stands in its caption,
//! which is a text of its own.

mod axes;
mod bars;
mod counts;
mod figure;
mod font;
mod legend;
mod lines;
mod look;
mod overview;
mod pdf;
mod pdf_font;
mod points;
mod reliability;
mod rows;
mod samples;
mod sheet;
mod svg;
mod tables;
mod tex;
mod thresholds;
mod title;

pub(crate) use figure::{count_figure, figure, point_figure};
pub(crate) use look::{Look, Palette};
pub(crate) use overview::{OverviewSheet, overview_sheet};
pub(crate) use pdf::pdf;
pub(crate) use sheet::Sheet;
pub(crate) use svg::svg;
pub(crate) use tables::tables;
pub(crate) use tex::tex;

use crate::drawing::chart::drawn::Drawn;

/// Draws a figure as a sheet.
pub(crate) fn sheet(figure: &Drawn, look: &Look) -> Sheet {
    match figure {
        Drawn::Lines(chart) => lines::lines(chart, look),
        Drawn::Bars(chart) => bars::bars(chart, look),
        Drawn::Reliability(chart) => reliability::reliability(chart, look),
        Drawn::Thresholds(chart) => thresholds::thresholds(chart, look),
    }
}
