//! Bar charts ([`BarChart`]), for shares that have no place on an axis of levels, such as those of photographs in the
//! dark.

use super::LineStyle;
use darkqa_score::estimate::Estimate;

/// One bar.
#[derive(Debug, Clone)]
pub(crate) struct Bar {
    /// Name below the bar, shortened to fit.
    pub name: String,
    pub style: LineStyle,
    pub share: Estimate,
}

/// The bars of one model.
#[derive(Debug, Clone)]
pub(crate) struct BarPanel {
    pub title: String,
    pub bars: Vec<Bar>,
    /// Share that guessing would reach, drawn as a broken line.
    pub chance: Option<f64>,
}

/// A figure with one row of bars for each model.
#[derive(Debug, Clone)]
pub(crate) struct BarChart {
    pub panels: Vec<BarPanel>,
    /// Text for the end of the caption.
    pub note: String,
}
