//! Drawing of figures for reports and papers, as PDF, SVG and pgfplots, with one bundled font.
//!
//! A chart becomes a [`Sheet`] of shapes in points; PDF and SVG write the same shapes. Captions are separate texts, not
//! part of a sheet.

mod axes;
mod figure;
mod font;
mod legend;
mod look;
mod overview;
mod page;
mod panel;
mod pdf;
mod sheet;
mod svg;
mod tables;
mod tex;

pub use figure::{count_figure, figure, point_figure, sheet};
pub use look::{FigureColours, Look};
pub use overview::{OverviewSheet, overview_sheet};
pub use pdf::pdf;
pub use sheet::Sheet;
pub use svg::svg;
pub use tables::tables;
pub use tex::tex;
