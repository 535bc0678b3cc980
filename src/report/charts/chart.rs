//! Data of a report's figures before they are drawn: a [`Chart`] has [`Panel`]s with lines, bars, points or ranges over
//! levels, names or numbers.
//!
//! Lines differ by colour, and also by dash and marker, so that they can be distinguished without colour.
//!
//! A drawn figure, and its parts for the page: [`Figure`], [`FigureParts`].

use serde::Serialize;

use crate::text::words::{self, light};
use darkqa_base::types::degradations::Axis;
use darkqa_base::types::{AxisLevel, EnhancerName, Variant};
use darkqa_score::estimate::Estimate;
use darkqa_score::model_in_condition::CHANCE;
use darkqa_score::threshold::Threshold;

/// Colour of axes and text, and of lines that belong to no model.
pub const INK: [u8; 3] = [34, 34, 34];

/// Six colours, found by search. Each has a contrast with white of at least 3.1. Any two differ by a CIEDE2000 distance
/// of at least 21 in normal, protanopic, deuteranopic and tritanopic vision (Machado, Oliveira and Fernandes 2009,
/// severity 1).
pub const COLOURS: [[u8; 3]; 6] = [
    [0x01, 0x97, 0xea],
    [0x72, 0x11, 0x57],
    [0x7a, 0x82, 0x02],
    [0xb3, 0x62, 0x81],
    [0x24, 0x05, 0xf4],
    [0x2d, 0x45, 0x19],
];

/// A drawn figure of a report.
#[derive(Debug, Clone, Serialize)]
pub struct Figure {
    /// Name of the figure in files.
    pub name: &'static str,
    /// Caption, with the note of the chart.
    pub caption: String,
    /// The figure as SVG.
    pub svg: String,
    /// Parts for the page.
    pub parts: FigureParts,
}

/// Panels and legend of a figure on the page, which arranges them by its width.
#[derive(Debug, Clone, Serialize)]
pub struct FigureParts {
    /// Title of the vertical axis of the first panel.
    pub measure: String,
    /// Empty if names are at the bars or rows.
    pub legend: Vec<PageLine>,
    pub panels: Vec<PagePanel>,
    /// Each level with its severity, as in `L3 (6 EV)`; empty if no panel has levels.
    pub levels: Vec<String>,
    /// Index of the level whose values are shown first: the last one of the first panel.
    pub at: usize,
    /// True if the names of the lines are at their right ends, too.
    pub has_end_names: bool,
}

/// Entry of a legend.
#[derive(Debug, Clone, Serialize)]
pub struct PageLine {
    pub name: String,
    pub model: Option<String>,
    /// `curve`, `marks`, `flat` of a model without images, or `chance`.
    pub kind: &'static str,
    /// Sample of the line as SVG.
    pub sample: String,
}

/// Panel of a figure on the page.
#[derive(Debug, Clone, Serialize)]
pub struct PagePanel {
    pub title: String,
    /// The model of all lines; `None` if there are several.
    pub model: Option<String>,
    /// True for a panel with rows or many names, which needs more room.
    pub is_wide: bool,
    pub svg: String,
}

/// SVG files of the figures: path in the report's folder, and contents.
pub fn svg_files(figures: Vec<Figure>) -> impl Iterator<Item = (String, Vec<u8>)> {
    figures.into_iter().map(|figure| {
        let name = format!("figures/{}.svg", figure.name);
        (name, figure.svg.into_bytes())
    })
}

/// Number of a line's colour, dash and marker. The same number gives the same style in every figure of a report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LineStyle(pub usize);

impl LineStyle {
    /// Style of reference lines: chance, and the most frequent true answer.
    pub const REFERENCE: Self = Self(27);
    /// Style of the model that `--reference` draws in black.
    pub const BLACK: Self = Self(1000);

    /// Style of a curve of a built-in reference model, such as the observer. References differ by dash and marker.
    pub fn built_in(index: usize) -> Self {
        Self(Self::BLACK.0 + 1 + index)
    }

    /// True if the line is drawn in the colour of axes and text, or in black.
    pub fn is_ink(self) -> bool {
        self == Self::REFERENCE || self.0 >= Self::BLACK.0
    }

    /// Colour of the line, as red, green and blue.
    pub fn rgb(self) -> [u8; 3] {
        match self {
            Self::BLACK => [0; 3],
            _ if self.is_ink() => INK,
            Self(number) => COLOURS[number % COLOURS.len()],
        }
    }
}

/// Content of a line.
#[derive(Debug, Clone)]
pub enum LineContent {
    /// Joined points over the levels, with their intervals.
    Curve(Vec<(AxisLevel, Estimate)>),
    /// A horizontal line: a share that does not depend on the level.
    Flat(f64),
    /// Separate marks for photographs in the dark.
    Marks(Vec<DarkMark>),
    /// Separate points over numbers, with their intervals.
    Points(Vec<(f64, Estimate)>),
    /// A line over numbers, without marks.
    Path(Vec<[f64; 2]>),
    /// The bar of a name, with its value as text.
    Bar { value: Estimate, text: String },
    /// The interval of a name, which may be infinite, with its text.
    Range { threshold: Threshold, text: String },
}

/// Share of a set of photographs in the dark. Their darkness is measured, not one of the levels, so the mark is never
/// joined to a curve of synthetic images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DarkMark {
    /// Lower quartile, median and upper quartile of the photographs' exposure drop, in EV.
    pub ev: [f64; 3],
    pub share: Estimate,
}

/// One line of a panel.
#[derive(Debug, Clone)]
pub struct PlotLine {
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
#[derive(Debug, Clone)]
pub struct LineItems {
    pub model: String,
    /// Variant and enhancer in words, as the list of items names them.
    pub light: String,
    pub family: Option<String>,
}

impl LineItems {
    /// Selects the items of all families; `None` unless `models` has exactly one model.
    pub fn for_model(models: &[&str], variant: &Variant, enhancer: Option<&EnhancerName>) -> Option<Self> {
        let [model] = models else {
            return None;
        };
        Some(Self { model: (*model).to_owned(), light: light(variant, enhancer), family: None })
    }
}

impl LineContent {
    /// Points without intervals: horizontal and vertical value.
    pub fn points(points: Vec<[f64; 2]>) -> Self {
        Self::Points(points.into_iter().map(|[x, y]| (x, Estimate::exact(y, 1))).collect())
    }
}

/// Values of an axis.
#[derive(Debug, Clone, PartialEq)]
pub enum Scale {
    /// The levels of the curves, at their severities; with the light at L0 in lux, for the title, if it is known.
    Levels { lux: Option<f64> },
    /// Shares from 0 to 100 %, with a title.
    Percent(&'static str),
    /// Numbers, with a title.
    Numbers(&'static str),
    /// Numbers from 0 to `end`, with the distance between two ticks.
    UpTo { end: f64, step: u8, title: String },
    /// Counts, which are written at their bars.
    Counts,
    /// The names of bars or ranges. On the vertical axis each has a row.
    Names,
}

impl Scale {
    /// Scale of thresholds, from 0 to the end of a ladder of levels: 9 EV for light (L5), 140 ms for motion blur.
    pub fn thresholds(axis: Axis) -> Self {
        let (end, step, name) =
            if axis == Axis::MOTION { (140.0, 20, "threshold of motion blur") } else { (9.0, 1, "darkness threshold") };
        Self::UpTo { end, step, title: format!("{name} in {}", axis.unit) }
    }

    /// Title of the axis of a panel; empty for none.
    pub fn title(&self, panel: &Panel) -> String {
        match self {
            Self::Levels { .. } => panel.axis_title(),
            Self::Percent(title) | Self::Numbers(title) => (*title).to_owned(),
            Self::UpTo { title, .. } => title.clone(),
            Self::Counts | Self::Names => String::new(),
        }
    }
}

/// One panel of a chart.
#[derive(Debug, Clone)]
pub struct Panel {
    /// Title, with the number of questions; may be empty.
    pub title: String,
    pub x: Scale,
    pub y: Scale,
    pub lines: Vec<PlotLine>,
    /// The model of all lines; `None` if there are several.
    pub model: Option<String>,
}

/// Maximum number of bars in a panel of counts (chosen).
const MAX_BARS: usize = 24;

impl Panel {
    /// Panel of shares over the levels. `measure` is the title of the vertical axis, with its unit.
    pub fn over_levels(measure: &'static str, title: String, lines: Vec<PlotLine>) -> Self {
        Self { title, x: Scale::Levels { lux: None }, y: Scale::Percent(measure), lines, model: None }
    }

    /// Panel of counts by name, from the largest; zeros are left out. If more than [`MAX_BARS`] remain, the smallest
    /// are added up in one bar. The texts have each count with its share, as in `3 (75.0 %)`.
    pub fn from_counts(title: &str, counts: impl Iterator<Item = (String, u64)>) -> Self {
        let mut bars: Vec<(String, u64)> = counts.filter(|(_, count)| *count > 0).collect();
        bars.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        if bars.len() > MAX_BARS {
            let rest = bars.split_off(MAX_BARS - 1);
            bars.push((format!("{} others", rest.len()), rest.iter().map(|(_, count)| count).sum()));
        }
        let total: u64 = bars.iter().map(|(_, count)| count).sum();
        let bar = |(name, count): (String, u64)| {
            let text = format!("{count} ({:.1} %)", 100.0 * count as f64 / total as f64);
            let value = Estimate::exact(count as f64, count as usize);
            PlotLine::new(name, LineStyle(0), LineContent::Bar { value, text })
        };
        let lines = bars.into_iter().map(bar).collect();
        Self { title: title.to_owned(), x: Scale::Counts, y: Scale::Names, lines, model: None }
    }

    /// Panel of bars of shares by name, and the share that guessing would reach.
    pub fn from_bars(title: String, bars: Vec<PlotLine>, chance: Option<f64>) -> Self {
        let lines = bars.into_iter().chain(chance.map(PlotLine::chance)).collect();
        Self { title, x: Scale::Names, y: Scale::Percent(""), lines, model: None }
    }

    /// Levels of all curves of the panel, from L0.
    pub fn levels(&self) -> Vec<AxisLevel> {
        let mut levels: Vec<AxisLevel> = self
            .lines
            .iter()
            .flat_map(|line| match &line.content {
                LineContent::Curve(points) => points.iter().map(|(level, _)| *level).collect(),
                _ => Vec::new(),
            })
            .collect();
        levels.sort_unstable();
        levels.dedup();
        levels
    }

    /// Largest value on an axis of levels, in their unit.
    pub fn axis_end(&self) -> f64 {
        let marks = self
            .lines
            .iter()
            .flat_map(|line| match &line.content {
                LineContent::Marks(marks) => &marks[..],
                _ => &[],
            })
            .map(|mark| mark.ev[2]);
        self.levels().into_iter().map(AxisLevel::value).chain(marks).fold(0.0, f64::max)
    }

    /// Title of an axis of levels.
    pub fn axis_title(&self) -> String {
        let axis = self.levels().into_iter().find_map(AxisLevel::axis).unwrap_or(Axis::LIGHT);
        let Axis { title, unit, .. } = axis;
        let light = match self.x {
            Scale::Levels { lux: Some(lux) } if axis == Axis::LIGHT => {
                format!(" ({} lux at L0, half at each EV)", words::lux(lux, 0.0))
            }
            _ => String::new(),
        };
        format!("level; {title} in {unit}{light}")
    }

    /// Lowest and highest value of points and paths on an axis (0 horizontal, 1 vertical); `None` without any.
    pub fn range(&self, axis: usize) -> Option<[f64; 2]> {
        self.lines
            .iter()
            .flat_map(|line| match &line.content {
                LineContent::Points(points) => points.iter().map(|(x, y)| [*x, y.value]).collect(),
                LineContent::Path(points) => points.clone(),
                _ => Vec::new(),
            })
            .map(|point| [point[axis]; 2])
            .reduce(|[low, high], [value, _]| [low.min(value), high.max(value)])
    }

    /// Name and text of each bar or range, in the order of their places.
    pub fn places(&self) -> impl Iterator<Item = (&str, &str)> {
        self.lines.iter().filter_map(|line| match &line.content {
            LineContent::Bar { text, .. } | LineContent::Range { text, .. } => Some((&*line.name, &**text)),
            _ => None,
        })
    }

    /// True if an axis has names, so that the panel needs no legend.
    pub fn has_names(&self) -> bool {
        self.x == Scale::Names || self.y == Scale::Names
    }
}

impl PlotLine {
    /// Line about no model, without items.
    pub fn new(name: String, style: LineStyle, content: LineContent) -> Self {
        Self { name, style, content, model: None, items: None }
    }

    /// Bar of a share, with its number as text.
    pub fn bar(name: String, style: LineStyle, value: Estimate) -> Self {
        let text = format!("{:.1}", 100.0 * value.value);
        Self::new(name, style, LineContent::Bar { value, text })
    }

    /// Horizontal line at the share that guessing would reach.
    pub fn chance(share: f64) -> Self {
        Self::new(CHANCE.to_owned(), LineStyle::REFERENCE, LineContent::Flat(share))
    }

    /// True if nothing of the line is drawn.
    pub fn is_empty(&self) -> bool {
        match &self.content {
            LineContent::Curve(points) => points.is_empty(),
            LineContent::Marks(marks) => marks.is_empty(),
            LineContent::Points(points) => points.is_empty(),
            LineContent::Path(points) => points.is_empty(),
            LineContent::Flat(_) | LineContent::Bar { .. } | LineContent::Range { .. } => false,
        }
    }

    pub fn is_curve(&self) -> bool {
        matches!(self.content, LineContent::Curve(_))
    }

    /// True if the line has a place of its own on an axis of names.
    pub fn has_place(&self) -> bool {
        matches!(self.content, LineContent::Bar { .. } | LineContent::Range { .. })
    }
}

/// A figure of panels with one legend.
#[derive(Debug, Clone)]
pub struct Chart {
    /// The panels, row by row.
    pub panels: Vec<Panel>,
    /// Number of panels in a row.
    pub columns: usize,
    /// Text for the end of the caption: number of items, and the meaning of bands and bars.
    pub note: String,
}

impl Chart {
    /// True if all panels are over levels.
    pub fn is_over_levels(&self) -> bool {
        self.panels.iter().all(|panel| matches!(panel.x, Scale::Levels { .. }))
    }
}
