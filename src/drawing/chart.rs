//! Figures of reports: a [`Chart`] of lines over the levels, and others.
//!
//! Lines differ by colour, and also by dash and marker, so that they can be distinguished without colour.

pub(crate) mod bars;
pub(crate) mod counts;
pub(crate) mod data;
pub(crate) mod drawn;
pub(crate) mod points;
pub(crate) mod reliability;
pub(crate) mod thresholds;

use serde::Serialize;

use crate::text::words::light;
use crate::types::degradations::Axis;
use crate::types::{AxisLevel, EnhancerName, Variant};
use darkqa_score::estimate::Estimate;

/// Colour of axes and text, and of lines that belong to no model.
pub(crate) const INK: [u8; 3] = [34, 34, 34];

/// Six colours, found by search: contrast with white of 3.1 at least, and a distance by CIEDE2000 of any two of 21 at least in normal,
/// protanopic, deuteranopic and tritanopic sight (Machado, Oliveira and Fernandes 2009, severity 1).
pub(crate) const COLOURS: [[u8; 3]; 6] = [
    [0x01, 0x97, 0xea],
    [0x72, 0x11, 0x57],
    [0x7a, 0x82, 0x02],
    [0xb3, 0x62, 0x81],
    [0x24, 0x05, 0xf4],
    [0x2d, 0x45, 0x19],
];

/// One figure of a report.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Figure {
    /// Name of the figure in files.
    pub name: &'static str,
    /// Caption, with the note of the chart.
    pub caption: String,
    /// The figure as SVG.
    pub svg: String,
    /// The data of the chart for the script of the page; `None` for a figure that the page shows as it is.
    pub data: Option<String>,
}

/// Figures as files: name and contents.
pub(crate) fn files(figures: Vec<Figure>) -> impl Iterator<Item = (String, Vec<u8>)> {
    figures.into_iter().map(|figure| {
        let name = format!("figures/{}.svg", figure.name);
        (name, figure.svg.into_bytes())
    })
}

/// Colour, dash and marker of a line. The same number gives the same style in every figure of a report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LineStyle(pub usize);

impl LineStyle {
    /// Style of lines that belong to no model: chance, and the most frequent true answer.
    pub(crate) const REFERENCE: Self = Self(27);
    /// Style of the model that a reader asked to be drawn black.
    pub(crate) const BLACK: Self = Self(1000);

    /// Red, green and blue of the colour.
    pub(crate) fn rgb(self) -> [u8; 3] {
        match self {
            Self::REFERENCE => INK,
            Self::BLACK => [0; 3],
            Self(number) => COLOURS[number % COLOURS.len()],
        }
    }
}

/// Data of a line in a panel.
#[derive(Debug, Clone)]
pub(crate) enum PanelContent {
    /// Points over the levels, with a band of their intervals.
    Curve(Vec<(AxisLevel, Estimate)>),
    /// A share that is the same at all levels.
    Flat(f64),
    /// Shares at a darkness that is no level.
    Marks(Vec<DarkMark>),
}

/// A share at a darkness that is no level: a photograph in the dark. It is never joined to a curve, which is of synthetic images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DarkMark {
    /// Lower quartile, median and upper quartile of the exposure drop, in EV.
    pub ev: [f64; 3],
    /// The share with its interval.
    pub share: Estimate,
}

/// One line of a panel.
#[derive(Debug, Clone)]
pub(crate) struct PlotLine {
    /// Name in the legend. Lines with the same name share one entry.
    pub name: String,
    pub style: LineStyle,
    pub content: PanelContent,
    /// The model that it is about; `None` of a line about several, or about none.
    pub model: Option<String>,
    /// The items behind its points in the list of the page; `None` if the list does not show them.
    pub items: Option<LineItems>,
}

/// The items behind the points of a line: those that a model was asked in one variant, of one family or of all.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct LineItems {
    model: String,
    /// Variant and enhancer in words, as the list of items names them.
    light: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub family: Option<String>,
}

impl LineItems {
    /// The items of all families that the only one of these models was asked; `None` of several models.
    pub(crate) fn for_model(
        models: &[&str],
        variant: &Variant,
        enhancer: Option<&EnhancerName>,
    ) -> Option<Self> {
        let [model] = models else {
            return None;
        };
        Some(Self {
            model: (*model).to_owned(),
            light: light(variant, enhancer),
            family: None,
        })
    }
}

/// One panel of a chart.
#[derive(Debug, Clone)]
pub(crate) struct Panel {
    /// Title, with the number of questions.
    pub title: String,
    pub lines: Vec<PlotLine>,
    /// The model that all its lines are about; `None` if there are several.
    pub model: Option<String>,
}

impl PlotLine {
    /// Whether nothing of the line is drawn.
    pub(crate) fn is_empty(&self) -> bool {
        match &self.content {
            PanelContent::Curve(points) => points.is_empty(),
            PanelContent::Marks(marks) => marks.is_empty(),
            PanelContent::Flat(_) => false,
        }
    }
}

impl Panel {
    /// The levels of its curves, from L0.
    pub(crate) fn levels(&self) -> Vec<AxisLevel> {
        let mut levels: Vec<AxisLevel> = self
            .lines
            .iter()
            .flat_map(|line| match &line.content {
                PanelContent::Curve(points) => points.iter().map(|(level, _)| *level).collect(),
                PanelContent::Flat(_) | PanelContent::Marks(_) => Vec::new(),
            })
            .collect();
        levels.sort_unstable();
        levels.dedup();
        levels
    }

    /// The right end of the axis, in the unit of the levels.
    pub(crate) fn farthest(&self) -> f64 {
        let marks = self
            .lines
            .iter()
            .flat_map(|line| match &line.content {
                PanelContent::Marks(marks) => &marks[..],
                PanelContent::Flat(_) | PanelContent::Curve(_) => &[],
            })
            .map(|mark| mark.ev[2]);
        self.levels()
            .into_iter()
            .map(AxisLevel::value)
            .chain(marks)
            .fold(0.0, f64::max)
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
    /// Further text of the caption.
    pub note: String,
}
