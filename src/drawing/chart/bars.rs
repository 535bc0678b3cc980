//! A figure of bars: shares that lie on no axis, as those of photographs in the dark, raw and enhanced ([`BarChart`]).

use super::LineStyle;
use darkqa_score::estimate::Estimate;

/// One bar.
#[derive(Debug, Clone)]
pub(crate) struct Bar {
    /// Name in the legend, and shortened below the bar.
    pub name: String,
    pub style: LineStyle,
    pub share: Estimate,
}

/// The bars of one model.
#[derive(Debug, Clone)]
pub(crate) struct BarPanel {
    pub title: String,
    pub bars: Vec<Bar>,
    /// A share that is drawn as a broken line: chance.
    pub line: Option<f64>,
}

/// A figure of panels of bars, side by side.
#[derive(Debug, Clone)]
pub(crate) struct BarChart {
    pub panels: Vec<BarPanel>,
    /// Further text of the caption.
    pub note: String,
}
