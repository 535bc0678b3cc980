//! Reliability diagrams, accuracy over confidence: [`ReliabilityChart`].

use super::LineStyle;
use darkqa_score::estimate::Estimate;

/// The bins of one condition.
#[derive(Debug, Clone)]
pub(crate) struct ReliabilityLine {
    /// Name in the legend.
    pub name: String,
    pub style: LineStyle,
    /// Mean confidence and accuracy of each bin, in order of confidence.
    pub bins: Vec<(f64, Estimate)>,
}

/// One panel: the lines of one model.
#[derive(Debug, Clone)]
pub(crate) struct ReliabilityPanel {
    pub title: String,
    pub lines: Vec<ReliabilityLine>,
}

/// A figure of panels with one legend. Accuracy equals confidence on the diagonal of each panel.
#[derive(Debug, Clone)]
pub(crate) struct ReliabilityChart {
    pub panels: Vec<ReliabilityPanel>,
    /// Text for the end of the caption.
    pub note: String,
}
