//! Data of a report's figures, before they are drawn: line charts over the levels ([`Chart`]), bars, points, counts and
//! thresholds.
//!
//! Lines differ by colour, and also by dash and marker, so that they can be distinguished without colour.
//!
//! Bar charts ([`BarChart`]), for shares that have no place on an axis of levels, such as those of photographs in the
//! dark.
//!
//! Bar panels of counts by name: [`CountPanel`].
//!
//! Data of a line chart for the page's script, which redraws it at the available width: [`ChartData`].
//!
//! Any of the charts that a report's figure can have: [`FigureChart`].
//!
//! Panels of points and lines over two numeric axes: [`PointPanel`].
//!
//! Reliability diagrams, accuracy over confidence: [`ReliabilityChart`].
//!
//! Charts of thresholds with one row for each curve: [`ThresholdChart`].

use serde::Serialize;

use crate::error::Result;
use crate::report::text::terminal::to_script_json;
use crate::report::text::words::{self, light, percent, with_interval};
use crate::types::degradations::Axis;
use crate::types::{AxisLevel, EnhancerName, Variant};
use darkqa_score::estimate::Estimate;
use darkqa_score::threshold::Threshold;

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
    /// Light at L0 in lux, for the title of the axis; `None` if it is not known.
    pub lux: Option<f64>,
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
        let axis = axis.unwrap_or(Axis::LIGHT);
        let Axis { title, unit, .. } = axis;
        let light = self.lux.filter(|_| axis == Axis::LIGHT);
        let light = light.map(|lux| format!(" ({} lux at L0, half at each EV)", words::lux(lux, 0.0)));
        format!("level; {title} in {unit}{}", light.unwrap_or_default())
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

/// Maximum number of bars in a panel (chosen).
const MAX_BARS: usize = 24;

/// Counts by name, drawn as bars.
#[derive(Debug, Clone)]
pub(crate) struct CountPanel {
    pub title: String,
    pub bars: Vec<(String, u64)>,
}

impl CountPanel {
    /// Sorts the counts from the largest and leaves out zeros. If more than [`MAX_BARS`] remain, the smallest are added
    /// up in one bar.
    pub(crate) fn from_counts(title: &str, counts: impl Iterator<Item = (String, u64)>) -> Self {
        let mut bars: Vec<(String, u64)> = counts.filter(|(_, count)| *count > 0).collect();
        bars.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        if bars.len() > MAX_BARS {
            let rest = bars.split_off(MAX_BARS - 1);
            bars.push((format!("{} others", rest.len()), rest.iter().map(|(_, count)| count).sum()));
        }
        Self { title: title.to_owned(), bars }
    }
}

/// A line chart as data. Shares are between 0 and 1. Texts are formatted as in tables, so that the script rounds
/// nothing.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct ChartData {
    measure: &'static str,
    panels: Vec<PanelData>,
}

#[derive(Debug, Clone, Serialize)]
struct PanelData {
    title: String,
    /// The model of all lines; `None` if there are several.
    model: Option<String>,
    /// Title of the horizontal axis.
    axis: String,
    unit: &'static str,
    levels: Vec<LevelData>,
    /// Right end of the horizontal axis, in its unit.
    end: f64,
    lines: Vec<LineData>,
}

#[derive(Debug, Clone, Serialize)]
struct LevelData {
    name: String,
    value: f64,
}

#[derive(Debug, Clone, Serialize)]
struct LineData {
    name: String,
    /// Number of the line's style: colour, dash and mark.
    style: usize,
    model: Option<String>,
    /// Filter for the list of items, applied when a point is clicked.
    #[serde(skip_serializing_if = "Option::is_none")]
    items: Option<LineItems>,
    #[serde(flatten)]
    content: ContentData,
}

#[derive(Debug, Clone, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum ContentData {
    /// Points over the levels.
    Curve { points: Vec<PointData> },
    /// One share at all levels.
    Flat { share: f64, text: String },
    /// Photographs in the dark, which are not at a level.
    Marks { points: Vec<PointData> },
}

#[derive(Debug, Clone, Serialize)]
struct PointData {
    /// Position on the horizontal axis, in its unit: lower end, middle and upper end.
    x: [f64; 3],
    /// Share, and both ends of its interval.
    y: [f64; 3],
    /// Share with its interval, as in tables.
    text: String,
}

impl ChartData {
    /// Serializes a chart as JSON that can be embedded in a page's script.
    ///
    /// # Errors
    /// None in practice: JSON can represent every value of a chart.
    pub(crate) fn json(chart: &Chart) -> Result<String> {
        to_script_json(&Self::new(chart))
    }

    fn new(chart: &Chart) -> Self {
        Self { measure: chart.measure, panels: chart.panels.iter().map(panel_data).collect() }
    }
}

fn panel_data(panel: &Panel) -> PanelData {
    let levels = panel.levels();
    let axis = levels.iter().find_map(|level| level.axis());
    PanelData {
        title: panel.title.clone(),
        model: panel.model.clone(),
        axis: panel.axis_title(),
        unit: axis.unwrap_or(Axis::LIGHT).unit,
        levels: levels.iter().map(|level| LevelData { name: level.to_string(), value: level.value() }).collect(),
        end: panel.axis_end(),
        lines: panel.lines.iter().map(line_data).collect(),
    }
}

fn line_data(line: &PlotLine) -> LineData {
    let content = match &line.content {
        LineContent::Flat(share) => ContentData::Flat { share: *share, text: percent(*share) },
        LineContent::Curve(points) => ContentData::Curve {
            points: points
                .iter()
                .map(|(level, share)| PointData {
                    x: [level.value(); 3],
                    y: [share.value, share.low, share.high],
                    text: with_interval(*share),
                })
                .collect(),
        },
        LineContent::Marks(marks) => ContentData::Marks {
            points: marks
                .iter()
                .map(|mark| PointData {
                    x: mark.ev,
                    y: [mark.share.value, mark.share.low, mark.share.high],
                    text: with_interval(mark.share),
                })
                .collect(),
        },
    };
    LineData {
        name: line.name.clone(),
        style: line.style.0,
        model: line.model.clone(),
        items: line.items.clone(),
        content,
    }
}

/// Chart of a figure, before it is drawn.
#[derive(Debug, Clone)]
pub(crate) enum FigureChart {
    Lines(Chart),
    Bars(BarChart),
    Thresholds(ThresholdChart),
    Reliability(ReliabilityChart),
}

impl FigureChart {
    /// Text for the end of the caption: number of items, and the meaning of bands and bars.
    pub(crate) fn note(&self) -> String {
        match self {
            Self::Lines(chart) => chart.note.clone(),
            Self::Bars(chart) => chart.note.clone(),
            Self::Reliability(chart) => chart.note.clone(),
            Self::Thresholds(chart) => format!("lines are 95 % intervals by {}", chart.unit),
        }
    }

    /// Data of the chart as JSON, for the page's script; `None` for a figure that the page shows as a static image.
    ///
    /// # Errors
    /// If the data cannot be serialized.
    pub(crate) fn script_data(&self) -> Result<Option<String>> {
        match self {
            Self::Lines(chart) => ChartData::json(chart).map(Some),
            Self::Bars(_) | Self::Thresholds(_) | Self::Reliability(_) => Ok(None),
        }
    }
}

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

/// Horizontal scale, from 0 to the end of a ladder of levels: 9 EV for light (L5), 140 ms for motion blur.
#[derive(Debug, Clone)]
pub(crate) struct LevelScale {
    pub end: f64,
    /// Distance between two ticks.
    pub step: i32,
    /// Name of the threshold.
    pub title: &'static str,
    pub unit: &'static str,
}

impl LevelScale {
    pub(crate) fn for_axis(axis: Axis) -> Self {
        let (end, step, title) =
            if axis == Axis::MOTION { (140.0, 20, "threshold of motion blur") } else { (9.0, 1, "darkness threshold") };
        Self { end, step, title, unit: axis.unit }
    }
}

/// The threshold of one curve.
#[derive(Debug, Clone)]
pub(crate) struct ThresholdRow {
    /// Model and condition.
    pub name: String,
    pub threshold: Threshold,
    /// Threshold with its interval, formatted.
    pub text: String,
}

/// A figure of the thresholds on one axis.
#[derive(Debug, Clone)]
pub(crate) struct ThresholdChart {
    pub rows: Vec<ThresholdRow>,
    pub scale: LevelScale,
    /// The unit of the intervals: scenes or frames.
    pub unit: String,
}
