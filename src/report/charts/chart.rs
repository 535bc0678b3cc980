//! Data of a report's figures, before they are drawn: line charts over the levels ([`Chart`]), bars, points, counts and
//! thresholds.
//!
//! Lines differ by colour, and also by dash and marker, so that they can be distinguished without colour.

pub(crate) mod bars;
pub(crate) mod counts;
pub(crate) mod data;
pub(crate) mod figure_chart;
pub(crate) mod points;
pub(crate) mod reliability;
pub(crate) mod thresholds;

use serde::Serialize;

use crate::report::text::words::light;
use crate::types::degradations::Axis;
use crate::types::{AxisLevel, EnhancerName, Variant};
use darkqa_score::estimate::Estimate;

/// Colour of axes and text, and of lines that belong to no model.
pub(crate) const INK: [u8; 3] = [34, 34, 34];

/// Six colours, found by search. Each has a contrast with white of at least 3.1. Any two differ by a CIEDE2000 distance
/// of at least 21 in normal, protanopic, deuteranopic and tritanopic vision (Machado, Oliveira and Fernandes 2009,
/// severity 1).
pub(crate) const COLOURS: [[u8; 3]; 6] = [
    [0x01, 0x97, 0xea],
    [0x72, 0x11, 0x57],
    [0x7a, 0x82, 0x02],
    [0xb3, 0x62, 0x81],
    [0x24, 0x05, 0xf4],
    [0x2d, 0x45, 0x19],
];

/// A drawn figure of a report.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Figure {
    /// Name of the figure in files.
    pub name: &'static str,
    /// Caption, with the note of the chart.
    pub caption: String,
    /// The figure as SVG.
    pub svg: String,
    /// Data of the chart as JSON, for the page's script; `None` for a figure that the page shows as a static image.
    pub data: Option<String>,
}

/// SVG files of the figures: path in the report's folder, and contents.
pub(crate) fn svg_files(figures: Vec<Figure>) -> impl Iterator<Item = (String, Vec<u8>)> {
    figures.into_iter().map(|figure| {
        let name = format!("figures/{}.svg", figure.name);
        (name, figure.svg.into_bytes())
    })
}

/// Number of a line's colour, dash and marker. The same number gives the same style in every figure of a report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LineStyle(pub usize);

impl LineStyle {
    /// Style of reference lines: chance, and the most frequent true answer.
    pub(crate) const REFERENCE: Self = Self(27);
    /// Style of the model that `--reference` draws in black.
    pub(crate) const BLACK: Self = Self(1000);

    /// Style of a curve of a built-in reference model, such as the observer. References differ by dash and marker.
    pub(crate) fn built_in(index: usize) -> Self {
        Self(Self::BLACK.0 + 1 + index)
    }

    /// True if the line is drawn in the colour of axes and text, or in black.
    pub(crate) fn is_ink(self) -> bool {
        self == Self::REFERENCE || self.0 >= Self::BLACK.0
    }

    /// Colour of the line, as red, green and blue.
    pub(crate) fn rgb(self) -> [u8; 3] {
        match self {
            Self::BLACK => [0; 3],
            _ if self.is_ink() => INK,
            Self(number) => COLOURS[number % COLOURS.len()],
        }
    }
}

/// Data of a line in a panel.
#[derive(Debug, Clone)]
pub(crate) enum LineContent {
    /// Points over the levels, with a band of their intervals.
    Curve(Vec<(AxisLevel, Estimate)>),
    /// A horizontal line: a share that does not depend on the level.
    Flat(f64),
    /// Separate marks for photographs in the dark.
    Marks(Vec<DarkMark>),
}

/// Share of a set of photographs in the dark. Their darkness is measured, not one of the levels, so the mark is never
/// joined to a curve of synthetic images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DarkMark {
    /// Lower quartile, median and upper quartile of the photographs' exposure drop, in EV.
    pub ev: [f64; 3],
    pub share: Estimate,
}

/// One line of a panel.
#[derive(Debug, Clone)]
pub(crate) struct PlotLine {
    /// Name in the legend. Lines with the same name share one entry.
    pub name: String,
    pub style: LineStyle,
    pub content: LineContent,
    /// The line's model; `None` for a line about several models, or about none.
    pub model: Option<String>,
    /// Filter that selects the line's items in the list of the page; `None` if the list does not show them.
    pub items: Option<LineItems>,
}

/// Filter for the page's list of items: the items that a model was asked in one variant, in one family or in all.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct LineItems {
    model: String,
    /// Variant and enhancer in words, as the list of items names them.
    light: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub family: Option<String>,
}

impl LineItems {
    /// Selects the items of all families; `None` unless `models` has exactly one model.
    pub(crate) fn for_model(models: &[&str], variant: &Variant, enhancer: Option<&EnhancerName>) -> Option<Self> {
        let [model] = models else {
            return None;
        };
        Some(Self { model: (*model).to_owned(), light: light(variant, enhancer), family: None })
    }
}

/// One panel of a chart.
#[derive(Debug, Clone)]
pub(crate) struct Panel {
    /// Title, with the number of questions.
    pub title: String,
    pub lines: Vec<PlotLine>,
    /// The model of all lines; `None` if there are several.
    pub model: Option<String>,
}

impl PlotLine {
    /// True if nothing of the line is drawn.
    pub(crate) fn is_empty(&self) -> bool {
        match &self.content {
            LineContent::Curve(points) => points.is_empty(),
            LineContent::Marks(marks) => marks.is_empty(),
            LineContent::Flat(_) => false,
        }
    }
}

impl Panel {
    /// Levels of all curves of the panel, from L0.
    pub(crate) fn levels(&self) -> Vec<AxisLevel> {
        let mut levels: Vec<AxisLevel> = self
            .lines
            .iter()
            .flat_map(|line| match &line.content {
                LineContent::Curve(points) => points.iter().map(|(level, _)| *level).collect(),
                LineContent::Flat(_) | LineContent::Marks(_) => Vec::new(),
            })
            .collect();
        levels.sort_unstable();
        levels.dedup();
        levels
    }

    /// Largest value on the horizontal axis, in the unit of the levels.
    pub(crate) fn axis_end(&self) -> f64 {
        let marks = self
            .lines
            .iter()
            .flat_map(|line| match &line.content {
                LineContent::Marks(marks) => &marks[..],
                LineContent::Flat(_) | LineContent::Curve(_) => &[],
            })
            .map(|mark| mark.ev[2]);
        self.levels().into_iter().map(AxisLevel::value).chain(marks).fold(0.0, f64::max)
    }

    /// Title of the horizontal axis.
    pub(crate) fn axis_title(&self) -> String {
        let axis = self.levels().into_iter().find_map(AxisLevel::axis);
        let Axis { title, unit, .. } = axis.unwrap_or(Axis::LIGHT);
        format!("level; {title} in {unit}")
    }
}

/// A figure of panels with one legend.
#[derive(Debug, Clone)]
pub(crate) struct Chart {
    /// Title of the vertical axis, with its unit.
    pub measure: &'static str,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
    /// Number of panels in a row.
    pub columns: usize,
    /// Text for the end of the caption.
    pub note: String,
}
