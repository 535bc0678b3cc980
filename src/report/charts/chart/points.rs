//! Panels of points and lines over two numeric axes: [`PointPanel`].

use super::LineStyle;

/// Points and lines that share a name and a style.
#[derive(Debug, Clone)]
pub(crate) struct PointSeries {
    /// Name in the legend.
    pub name: String,
    pub style: LineStyle,
    /// Points that are drawn as marks: horizontal and vertical value.
    pub points: Vec<[f64; 2]>,
    /// Lines without marks, each through its points.
    pub lines: Vec<Vec<[f64; 2]>>,
}

/// One panel with its series.
#[derive(Debug, Clone)]
pub(crate) struct PointPanel {
    pub title: String,
    /// Titles of the horizontal and the vertical axis.
    pub axes: [&'static str; 2],
    pub series: Vec<PointSeries>,
}

impl PointPanel {
    /// Lowest and highest value on an axis (0 horizontal, 1 vertical); `None` without a point.
    pub(crate) fn range(&self, axis: usize) -> Option<[f64; 2]> {
        self.series
            .iter()
            .flat_map(|series| series.points.iter().chain(series.lines.iter().flatten()))
            .map(|point| [point[axis]; 2])
            .reduce(|[low, high], [value, _]| [low.min(value), high.max(value)])
    }
}
