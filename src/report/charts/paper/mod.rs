//! Drawing of figures for reports and papers, as PDF, SVG and pgfplots, with one bundled font.
//!
//! A chart becomes a [`Sheet`] of shapes in points; PDF and SVG write the same shapes. Captions are separate texts, not
//! part of a sheet.

mod figure;
mod font;
mod legend;
mod lines;
mod look;
mod overview;
mod pdf;
mod sheet;
mod svg;
mod tables;
mod tex;
mod title;

use super::chart::FigureChart;

pub(crate) use figure::{count_figure, figure, point_figure};
pub(crate) use look::{FigureColours, Look};
pub(crate) use overview::{OverviewSheet, overview_sheet};
pub(crate) use pdf::pdf;
pub(crate) use sheet::Sheet;
pub(crate) use svg::svg;
pub(crate) use tables::tables;
pub(crate) use tex::tex;

/// Draws a figure as a sheet.
pub(crate) fn sheet(figure: &FigureChart, look: &Look) -> Sheet {
    match figure {
        FigureChart::Lines(chart) => lines::lines(chart, look),
        FigureChart::Bars(chart) => figure::bars(chart, look),
        FigureChart::Reliability(chart) => figure::reliability(chart, look),
        FigureChart::Thresholds(chart) => figure::thresholds(chart, look),
    }
}
