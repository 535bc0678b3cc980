//! A figure of points and lines over two axes of numbers: [`PointPanel`].

use super::LineStyle;

/// Points and lines with one name.
#[derive(Debug, Clone)]
pub(crate) struct PointSeries {
    /// Name in the legend.
    pub name: String,
    pub style: LineStyle,
    /// Points that are drawn as marks.
    pub points: Vec<[f64; 2]>,
    pub lines: Vec<Vec<[f64; 2]>>,
}

/// Series between two axes.
#[derive(Debug, Clone)]
pub(crate) struct PointPanel {
    pub title: String,
    /// Titles of the horizontal and the vertical axis.
    pub axes: [&'static str; 2],
    pub series: Vec<PointSeries>,
}

impl PointPanel {
    /// Lowest and highest value on an axis: 0 horizontal, 1 vertical. `None` without a point.
    pub(crate) fn range(&self, axis: usize) -> Option<[f64; 2]> {
        self.series
            .iter()
            .flat_map(|series| series.points.iter().chain(series.lines.iter().flatten()))
            .map(|place| [place[axis]; 2])
            .reduce(|[low, high], [value, _]| [low.min(value), high.max(value)])
    }
}
