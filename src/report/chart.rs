//! Charts of lines over the levels, in panels, as SVG: [`Chart`].
//!
//! Lines differ by colour (Okabe and Ito 2008, distinguishable with any colour vision), and also by dash and marker, so that
//! they can be distinguished without colour. A page may replace the colours `INK`, `GRID` and `BACKGROUND` by those of its
//! theme.

pub(crate) mod bars;
pub(crate) mod data;
mod marks;
pub(crate) mod thresholds;

use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use serde::Serialize;

use crate::error::{Error, Result};
use crate::score::estimate::Estimate;
use crate::types::AxisLevel;
use crate::types::degradation::Axis;

/// Colour of axes and text.
const INK: RGBColor = RGBColor(34, 34, 34);
/// Colour of grid lines.
pub(super) const GRID: RGBColor = RGBColor(221, 221, 221);
/// Colour of the background.
pub(super) const BACKGROUND: RGBColor = RGBColor(255, 255, 255);

/// Okabe and Ito's colours without yellow, which is faint on white; grey is added.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(110, 110, 110),
];

/// Lengths of dash and gap in pixels; the first style is a solid line.
const DASHES: [(i32, i32); 4] = [(0, 0), (9, 5), (2, 4), (14, 4)];

/// Width and height of a panel in pixels, with its labels.
const PANEL: (i32, i32) = (400, 300);
/// Margins of a panel around its axes in pixels: left, top, right, bottom.
const MARGIN: [i32; 4] = [52, 34, 14, 58];
/// Width of a letter of a level's label in pixels, with room to the next label.
const LETTER: i32 = 8;
/// Height of a line of text in pixels.
const ROW: i32 = 20;

/// One figure of a report.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Figure {
    /// Name of the figure in files.
    pub name: &'static str,
    /// Caption on the page.
    pub caption: String,
    /// The figure as SVG.
    pub svg: String,
    /// What it shows, for the script of the page; `None` of a figure that the page shows as it is.
    pub data: Option<String>,
}

/// Figures as files: name and contents.
pub(super) fn files(figures: Vec<Figure>) -> impl Iterator<Item = (String, Vec<u8>)> {
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

    pub(super) fn colour(self) -> RGBColor {
        COLOURS[self.0 % COLOURS.len()]
    }

    /// Red, green and blue of the colour.
    pub(super) fn rgb(self) -> [u8; 3] {
        let colour = self.colour();
        [colour.0, colour.1, colour.2]
    }

    /// Lengths of dash and gap in pixels; `None` for a solid line.
    pub(super) fn dashes(self) -> Option<[f64; 2]> {
        match self.dash() {
            (0, _) => None,
            (drawn, gap) => Some([drawn.into(), gap.into()]),
        }
    }

    fn dash(self) -> (i32, i32) {
        DASHES[(self.0 + self.0 / COLOURS.len()) % DASHES.len()]
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
    pub(super) fn is_empty(&self) -> bool {
        match &self.content {
            PanelContent::Curve(points) => points.is_empty(),
            PanelContent::Marks(marks) => marks.is_empty(),
            PanelContent::Flat(_) => false,
        }
    }
}

impl Panel {
    /// The levels of its curves, from L0.
    pub(super) fn levels(&self) -> Vec<AxisLevel> {
        let levels = self.lines.iter().flat_map(|line| match &line.content {
            PanelContent::Curve(points) => points.iter().map(|(level, _)| *level).collect(),
            PanelContent::Flat(_) | PanelContent::Marks(_) => Vec::new(),
        });
        let mut levels: Vec<AxisLevel> = levels.collect();
        levels.sort_unstable();
        levels.dedup();
        levels
    }

    /// The right end of the axis, in the unit of the levels.
    pub(super) fn farthest(&self) -> f64 {
        let marks = self.lines.iter().flat_map(|line| match &line.content {
            PanelContent::Marks(marks) => &marks[..],
            PanelContent::Flat(_) | PanelContent::Curve(_) => &[],
        });
        let marks = marks.map(|mark| mark.ev[2]);
        let levels = self.levels().into_iter().map(AxisLevel::value);
        levels.chain(marks).fold(0.0, f64::max)
    }

    /// Title of the horizontal axis.
    pub(super) fn axis_title(&self) -> String {
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
    /// Note below the legend.
    pub note: String,
}

pub(super) type FigureArea<'a> = DrawingArea<SVGBackend<'a>, Shift>;

impl Chart {
    /// The chart as SVG.
    ///
    /// # Errors
    /// If the chart cannot be drawn.
    pub(crate) fn svg(&self) -> Result<String> {
        let columns = self.columns.clamp(1, self.panels.len().max(1));
        let rows = self.panels.len().div_ceil(columns) as i32;
        let width = columns as i32 * PANEL.0;
        let legend = self.legend(width);
        let below = legend.last().map_or(0, |(_, (_, y))| y + ROW) + ROW + 8;
        let size = (width as u32, (rows * PANEL.1 + below) as u32);
        let mut svg = String::new();
        let drawn = {
            let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            self.draw(&root, columns, rows, &legend)
        };
        drawn.map_err(|e| Error::data("figure", e))?;
        Ok(svg)
    }

    /// The first line of each name, with its position below the panels in pixels.
    fn legend(&self, width: i32) -> Vec<(&PlotLine, (i32, i32))> {
        let mut entries: Vec<(&PlotLine, (i32, i32))> = Vec::new();
        let (mut x, mut y) = (12, 4);
        for line in self.panels.iter().flat_map(|panel| &panel.lines) {
            if entries.iter().any(|(entry, _)| entry.name == line.name) {
                continue;
            }
            let length = 62 + 7 * line.name.chars().count() as i32;
            if x > 12 && x + length > width {
                (x, y) = (12, y + ROW);
            }
            entries.push((line, (x, y)));
            x += length;
        }
        entries
    }

    fn draw(
        &self,
        root: &FigureArea<'_>,
        columns: usize,
        rows: i32,
        legend: &[(&PlotLine, (i32, i32))],
    ) -> Result<(), String> {
        let failed = |e: DrawingAreaErrorKind<_>| e.to_string();
        root.fill(&BACKGROUND).map_err(failed)?;
        for (index, panel) in self.panels.iter().enumerate() {
            let corner = (
                (index % columns) as i32 * PANEL.0,
                (index / columns) as i32 * PANEL.1,
            );
            let frame = AxisFrame::new(corner, panel);
            frame.axes(root, panel, self.measure)?;
            for line in &panel.lines {
                frame.line(root, line)?;
            }
        }
        let top = rows * PANEL.1;
        for (line, (x, y)) in legend {
            let (x, y) = (*x, top + *y + ROW / 2);
            let ends = [(x, y), (x + 34, y)];
            match line.content {
                PanelContent::Marks(_) => {
                    draw_path(root, &ends, line.style.colour().stroke_width(1))?;
                }
                _ => draw_line(root, line.style, is_flat(&line.content), &ends)?,
            }
            match line.content {
                PanelContent::Curve(_) => draw_marker(root, line.style, (x + 17, y))?,
                PanelContent::Marks(_) => line.style.hollow(root, (x + 17, y))?,
                PanelContent::Flat(_) => {}
            }
            draw_text(root, &line.name, (x + 42, y), 13, LEFT)?;
        }
        let last = legend.last().map_or(top, |(_, (_, y))| top + y + ROW);
        draw_text(root, &self.note, (12, last + 12), 12, LEFT)?;
        root.present().map_err(failed)
    }
}

fn is_flat(content: &PanelContent) -> bool {
    matches!(content, PanelContent::Flat(_))
}

/// Anchors for text to the right of its place, to the left of it, and below it.
pub(super) const LEFT: (HPos, VPos) = (HPos::Left, VPos::Center);
pub(super) const RIGHT: (HPos, VPos) = (HPos::Right, VPos::Center);
pub(super) const BELOW: (HPos, VPos) = (HPos::Center, VPos::Top);

/// Position of a panel's axes in pixels, and the levels on them.
struct AxisFrame {
    left: i32,
    top: i32,
    width: i32,
    height: i32,
    levels: Vec<AxisLevel>,
    /// The right end of the axis, in the unit of the levels.
    farthest: f64,
}

impl AxisFrame {
    fn new((x, y): (i32, i32), panel: &Panel) -> Self {
        Self {
            left: x + MARGIN[0],
            top: y + MARGIN[1],
            width: PANEL.0 - MARGIN[0] - MARGIN[2],
            height: PANEL.1 - MARGIN[1] - MARGIN[3],
            farthest: panel.farthest(),
            levels: panel.levels(),
        }
    }

    /// Horizontal position of a level. The axis is to scale in the unit of the levels.
    fn x(&self, level: AxisLevel) -> i32 {
        self.x_of(level.value())
    }

    /// Horizontal position of a number in the unit of the levels.
    fn x_of(&self, value: f64) -> i32 {
        let (drop, max_drop) = (value as f32, self.farthest as f32);
        let share = if max_drop > 0.0 { drop / max_drop } else { 0.5 };
        self.left + 10 + ((self.width - 20) as f32 * share).round() as i32
    }

    /// The levels whose labels have room on the axis, from L0: each that does not overlap the one before.
    fn labelled(&self) -> Vec<AxisLevel> {
        let reach = |level: AxisLevel| level.to_string().len() as i32 * LETTER / 2;
        let mut labelled: Vec<AxisLevel> = Vec::new();
        for level in &self.levels {
            let end = labelled.last().map(|last| self.x(*last) + reach(*last));
            if end.is_none_or(|end| end < self.x(*level) - reach(*level)) {
                labelled.push(*level);
            }
        }
        labelled
    }

    fn y(&self, share: f64) -> i32 {
        self.top + self.height - (f64::from(self.height) * share.clamp(0.0, 1.0)).round() as i32
    }

    fn axes(&self, root: &FigureArea<'_>, panel: &Panel, measure: &str) -> Result<(), String> {
        let right = self.left + self.width;
        for step in 0..=5 {
            let share = f64::from(step) / 5.0;
            let y = self.y(share);
            draw_path(root, &[(self.left, y), (right, y)], GRID.stroke_width(1))?;
            let label = (step * 20).to_string();
            draw_text(root, &label, (self.left - 6, y), 12, RIGHT)?;
        }
        let bottom = self.top + self.height;
        draw_path(
            root,
            &[(self.left, bottom), (right, bottom)],
            INK.stroke_width(1),
        )?;
        let labelled = self.labelled();
        for level in &self.levels {
            let x = self.x(*level);
            draw_path(root, &[(x, bottom), (x, bottom + 4)], INK.stroke_width(1))?;
            if !labelled.contains(level) {
                continue;
            }
            let drop = level.value();
            draw_text(root, &level.to_string(), (x, bottom + 7), 12, BELOW)?;
            draw_text(root, &drop.to_string(), (x, bottom + 22), 11, BELOW)?;
        }
        let middle = self.left + self.width / 2;
        draw_text(root, &panel.axis_title(), (middle, bottom + 38), 12, BELOW)?;
        draw_text(
            root,
            &panel.title,
            (self.left - 40, self.top - 26),
            14,
            (HPos::Left, VPos::Top),
        )?;
        let rotated = text_style(12, BELOW).transform(FontTransform::Rotate270);
        let place = (self.left - 48, self.top + self.height / 2);
        root.draw(&Text::new(measure.to_owned(), place, rotated))
            .map_err(|e| e.to_string())
    }

    fn line(&self, root: &FigureArea<'_>, line: &PlotLine) -> Result<(), String> {
        let points = match &line.content {
            PanelContent::Flat(share) => {
                let y = self.y(*share);
                let ends = [(self.left, y), (self.left + self.width, y)];
                return draw_line(root, line.style, true, &ends);
            }
            PanelContent::Marks(marks) => {
                let mut marks = marks.iter();
                return marks.try_for_each(|mark| self.mark(root, line.style, mark));
            }
            PanelContent::Curve(points) => points,
        };
        let upper = points
            .iter()
            .map(|(level, at)| (self.x(*level), self.y(at.high)));
        let lower = points
            .iter()
            .rev()
            .map(|(level, at)| (self.x(*level), self.y(at.low)));
        let band: Vec<(i32, i32)> = upper.chain(lower).collect();
        root.draw(&Polygon::new(band, line.style.colour().mix(0.14)))
            .map_err(|e| e.to_string())?;
        let middle = points
            .iter()
            .map(|(level, at)| (self.x(*level), self.y(at.value)));
        let middle: Vec<(i32, i32)> = middle.collect();
        draw_line(root, line.style, false, &middle)?;
        middle
            .into_iter()
            .try_for_each(|place| draw_marker(root, line.style, place))
    }
}

pub(super) fn draw_path(
    root: &FigureArea<'_>,
    points: &[(i32, i32)],
    style: ShapeStyle,
) -> Result<(), String> {
    root.draw(&PathElement::new(points.to_vec(), style))
        .map_err(|e| e.to_string())
}

/// Draws a line in its style. A flat line is thinner and always dashed.
fn draw_line(
    root: &FigureArea<'_>,
    style: LineStyle,
    is_flat: bool,
    points: &[(i32, i32)],
) -> Result<(), String> {
    let stroke = style.colour().stroke_width(if is_flat { 1 } else { 2 });
    let dash = match style.dash() {
        (0, _) if is_flat => (6, 4),
        dash => dash,
    };
    if dash.0 == 0 {
        return draw_path(root, points, stroke);
    }
    root.draw(&DashedPathElement::new(
        points.to_vec(),
        dash.0,
        dash.1,
        stroke,
    ))
    .map_err(|e| e.to_string())
}

/// Draws the marker of a style at a place.
fn draw_marker(root: &FigureArea<'_>, style: LineStyle, (x, y): (i32, i32)) -> Result<(), String> {
    let (fill, open) = (style.colour().filled(), style.colour().stroke_width(2));
    let drawn = match style.0 % 6 {
        0 => root.draw(&Circle::new((x, y), 4, fill)),
        1 => root.draw(&Rectangle::new([(x - 4, y - 4), (x + 4, y + 4)], fill)),
        2 => root.draw(&TriangleMarker::new((x, y), 5, fill)),
        3 => {
            let corners = vec![(x, y - 5), (x + 5, y), (x, y + 5), (x - 5, y)];
            root.draw(&Polygon::new(corners, style.colour()))
        }
        4 => root.draw(&Cross::new((x, y), 4, open)),
        _ => root.draw(&Circle::new((x, y), 4, open)),
    };
    drawn.map_err(|e| e.to_string())
}

fn text_style(size: u32, (across, down): (HPos, VPos)) -> TextStyle<'static> {
    let font = ("sans-serif", size).into_font();
    TextStyle::from(font)
        .color(&INK)
        .pos(Pos::new(across, down))
}

pub(super) fn draw_text(
    root: &FigureArea<'_>,
    text: &str,
    place: (i32, i32),
    size: u32,
    anchor: (HPos, VPos),
) -> Result<(), String> {
    root.draw(&Text::new(text.to_owned(), place, text_style(size, anchor)))
        .map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Severity;
    use crate::types::degradation::Kind;

    /// Names of the labelled levels of an axis with L0 and these drops in hundredths of an EV.
    fn labelled(drops: impl IntoIterator<Item = u16>) -> Vec<String> {
        let of = |drop| AxisLevel::new(Kind::Sensor, Severity::hundredths(drop));
        let frame = AxisFrame {
            left: 0,
            top: 0,
            width: PANEL.0 - MARGIN[0] - MARGIN[2],
            height: 1,
            farthest: 0.0,
            levels: std::iter::once(AxisLevel::L0)
                .chain(drops.into_iter().map(of))
                .collect(),
        };
        let farthest = frame
            .levels
            .iter()
            .map(|level| level.value())
            .fold(0.0, f64::max);
        let frame = AxisFrame { farthest, ..frame };
        frame.labelled().iter().map(ToString::to_string).collect()
    }

    #[test]
    fn labels_of_levels_do_not_overlap() {
        let paper = [200, 400, 600, 750, 900];
        assert_eq!(labelled(paper), ["L0", "L1", "L2", "L3", "L4", "L5"]);
        let halves = labelled((1..=20).map(|step| 50 * step));
        assert!(halves.len() > 5 && halves.len() < 12, "{halves:?}");
        assert_eq!(labelled([1, 900]), ["L0", "L5"]);
    }
}
