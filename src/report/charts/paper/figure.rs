//! Figures of reports as SVG, at the width of a page ([`figure`], [`point_figure`], [`count_figure`]), and the drawing
//! of their panels: [`bars`], [`counts`], [`points`], [`reliability`] and [`thresholds`], arranged by
//! [`arrange_in_rows`].

use super::font::Font;
use super::legend::{Legend, LegendEntry, LegendSample};
use super::sheet::{Anchor, GRID, Point, Shape, Stroke, TextDirection};
use super::title::{LEADING, Title, draw_percent_grid};
use super::{FigureColours, Look, Sheet, sheet, svg};
use crate::error::{Error, Result};
use crate::report::charts::chart::{
    Bar, BarChart, BarPanel, CountPanel, Figure, FigureChart, INK, LineStyle, PointPanel, PointSeries,
    ReliabilityChart, ReliabilityPanel, ThresholdChart,
};

/// Width in points of a figure with several panels side by side: an A4 page between margins of 15 mm.
const WIDE: f64 = 510.0;

/// Width in points of a figure with one panel in a row (chosen).
const NARROW: f64 = 340.0;

/// Width in points of a panel of points and lines (chosen).
const PANEL: f64 = 300.0;

/// Font size in points.
const FONT_SIZE: f64 = 8.5;

/// Draws a figure of a report. The note of the chart is appended to the caption.
///
/// # Errors
/// If the data cannot be serialized.
pub(crate) fn figure(name: &'static str, caption: &str, chart: &FigureChart) -> Result<Figure> {
    let width = match chart {
        FigureChart::Lines(chart) if chart.columns.min(chart.panels.len()) == 1 => NARROW,
        FigureChart::Reliability(chart) if chart.panels.len() == 1 => NARROW,
        _ => WIDE,
    };
    Ok(Figure {
        name,
        caption: format!("{caption} ({}.)", chart.note()),
        svg: to_svg(sheet(chart, &look(width)))?,
        data: chart.script_data()?,
    })
}

/// Draws panels of points and lines side by side, as SVG.
///
/// # Errors
/// None in practice: only an embedded image can fail, and the panels have none.
pub(crate) fn point_figure(panels: &[PointPanel]) -> Result<String> {
    let columns = panels.len().max(1);
    let look = look(PANEL * columns as f64);
    let panels = panels.iter().map(|panel| points(panel, &column_look(columns, &look)));
    to_svg(arrange_in_rows(panels, columns, &look))
}

/// Draws panels of counts in two columns, as SVG.
///
/// # Errors
/// None in practice: only an embedded image can fail, and the panels have none.
pub(crate) fn count_figure(panels: &[CountPanel]) -> Result<String> {
    to_svg(counts(panels, &look(WIDE)))
}

fn look(width: f64) -> Look {
    Look { width, font_size: FONT_SIZE, palette: FigureColours::Colour }
}

/// SVG of a sheet without images, on a white background.
fn to_svg(sheet: Sheet) -> Result<String> {
    svg(&sheet.on_paper(), &|_| Err(Error::data("figure", "has no pictures")))
}

/// Height of the plot area in em.
const HEIGHT: f64 = 11.0;

/// Width of a bar as a share of the distance between bars.
const BAR: f64 = 0.6;

/// Number of text lines for which space is left above and below a panel.
const LINES: f64 = 2.0;

/// Draws a bar chart with one panel in a row.
pub(crate) fn bars(chart: &BarChart, look: &Look) -> Sheet {
    let mut sheet = Sheet::default();
    let mut top = 0.0;
    for panel in &chart.panels {
        top += (LINES * LEADING + 0.3) * look.font_size;
        let left = Font::bundled().width("100", look.tick_font_size()) + 0.6 * look.font_size;
        draw_bar_panel(&mut sheet, look, panel, [left, top]);
        top += HEIGHT * look.font_size + (LINES * LEADING + 1.6) * look.tick_font_size();
    }
    sheet.size = [look.width, top];
    sheet
}

/// Vertical position of a share above the bottom of a panel.
fn share_y(look: &Look, bottom: f64, share: f64) -> f64 {
    bottom - HEIGHT * look.font_size * share.clamp(0.0, 1.0)
}

fn draw_bar_panel(sheet: &mut Sheet, look: &Look, panel: &BarPanel, [left, top]: Point) {
    let (right, bottom) = (look.width - 0.4 * look.font_size, top + HEIGHT * look.font_size);
    draw_percent_grid(sheet, look, [left, right], |share| share_y(look, bottom, share));
    let title = Title::new(&panel.title, look, right - left);
    title.draw(sheet, look, [left, top - 0.5 * look.font_size]);
    let step = (right - left) / panel.bars.len().max(1) as f64;
    for (index, bar) in panel.bars.iter().enumerate() {
        let middle = left + step * (index as f64 + 0.5);
        draw_bar(sheet, look, bar, [middle, bottom], step);
    }
    if let Some(chance) = panel.chance {
        let y = share_y(look, bottom, chance);
        sheet.line(&[[left, y], [right, y]], &look.dotted_stroke());
    }
    sheet.line(&[[left, bottom], [right, bottom]], &look.thin_stroke(INK));
}

/// Draws a bar with its interval, number and name. `step` is the distance between bars in points.
fn draw_bar(sheet: &mut Sheet, look: &Look, bar: &Bar, [middle, bottom]: Point, step: f64) {
    let half_width = step.min(6.0 * look.font_size) * BAR / 2.0;
    let top = share_y(look, bottom, bar.share.value);
    let corners = [
        [middle - half_width, bottom],
        [middle - half_width, top],
        [middle + half_width, top],
        [middle + half_width, bottom],
    ];
    sheet.area(corners.to_vec(), look.colour(bar.style), 0.55);
    let ends = [bar.share.low, bar.share.high].map(|share| [middle, share_y(look, bottom, share)]);
    sheet.line(&ends, &look.pen(bar.style).stroke);
    let small = look.tick_font_size();
    let share = format!("{:.1}", 100.0 * bar.share.value);
    sheet.label(&share, [middle, bottom + 1.1 * small], small, Anchor::Middle);
    let name = Font::bundled().shortened(&bar.name, small, 0.95 * step);
    sheet.label(&name, [middle, bottom + 2.25 * small], small, Anchor::Middle);
}

/// Height of a row in em.
const COUNT_ROW: f64 = 1.5;

/// Space between the two columns of panels, and below each panel, in em.
const COUNT_GAP: f64 = 1.5;

/// Maximum width of the names as a share of the panel's width.
const COUNT_NAMES: f64 = 0.4;

/// Draws the panels in two columns. Each panel goes into the column that is shorter so far.
pub(crate) fn counts(panels: &[CountPanel], look: &Look) -> Sheet {
    let gap = COUNT_GAP * look.font_size;
    let width = (look.width - gap) / 2.0;
    let mut sheet = Sheet::default();
    let mut heights = [0.0_f64; 2];
    for panel in panels {
        let column = usize::from(heights[1] < heights[0]);
        let part = draw_count_panel(panel, &Look { width, ..*look });
        let corner = [column as f64 * (width + gap), heights[column]];
        heights[column] += part.size[1] + gap;
        sheet.insert(part, corner);
    }
    sheet.size = [look.width, heights[0].max(heights[1])];
    sheet
}

fn draw_count_panel(panel: &CountPanel, look: &Look) -> Sheet {
    let (font, small, row) = (Font::bundled(), look.tick_font_size(), COUNT_ROW * look.font_size);
    let total: u64 = panel.bars.iter().map(|(_, count)| count).sum();
    let highest = panel.bars.iter().map(|(_, count)| *count).max();
    let names =
        panel.bars.iter().map(|(name, _)| font.width(name, small)).fold(0.0, f64::max).min(COUNT_NAMES * look.width);
    let left = names + 0.6 * small;
    let widest_label = count_label(highest.unwrap_or(0), total);
    let labels = font.width(&widest_label, small) + 0.6 * small;
    let longest = look.width - left - labels;
    let mut sheet = Sheet::default();
    sheet.label(&panel.title, [0.0, look.font_size], look.font_size, Anchor::Start);
    let mut top = row;
    for (name, count) in &panel.bars {
        let base = top + row / 2.0 + 0.35 * small;
        let name = font.shortened(name, small, names);
        sheet.label(&name, [names, base], small, Anchor::End);
        let end = left + longest * *count as f64 / highest.unwrap_or(1) as f64;
        let (above, below) = (top + 0.15 * row, top + 0.85 * row);
        let corners = vec![[left, above], [end, above], [end, below], [left, below]];
        sheet.area(corners, look.colour(LineStyle(0)), 0.55);
        sheet.label(&count_label(*count, total), [end + 0.4 * small, base], small, Anchor::Start);
        top += row;
    }
    if panel.bars.is_empty() {
        sheet.label("none", [0.0, top + row / 2.0], small, Anchor::Start);
        top += row;
    }
    sheet.size = [look.width, top];
    sheet
}

/// Count with its share of the total, as in `3 (75.0 %)`.
fn count_label(count: u64, total: u64) -> String {
    let share = 100.0 * count as f64 / total.max(1) as f64;
    format!("{count} ({share:.1} %)")
}

/// Height of the plot area as a share of its width.
const RATIO: f64 = 0.75;

/// Margin at each end of an axis, as a share of the range of its values.
const MARGIN: f64 = 0.06;

/// Maximum number of intervals between ticks on an axis.
const MAX_STEPS: f64 = 6.0;

/// Draws a panel, with its legend below.
pub(crate) fn points(panel: &PointPanel, look: &Look) -> Sheet {
    let (font_size, small) = (look.font_size, look.tick_font_size());
    let [horizontal, vertical] = [0, 1].map(|axis| AxisScale::new(panel.range(axis)));
    let font = Font::bundled();
    let numbers = vertical.ticks().map(|(_, text)| font.width(&text, small)).fold(0.0, f64::max);
    let left = numbers + 0.55 * small + 1.35 * font_size;
    let width = look.width - left - 0.6 * font_size;
    let title = Title::new(&panel.title, look, width);
    let top = Title::max_height(std::slice::from_ref(&title), look) + 0.65 * font_size;
    let area = Area { corner: [left, top], size: [width, RATIO * width], scales: [horizontal, vertical] };
    let mut sheet = Sheet::default();
    title.draw(&mut sheet, look, [left, top - 0.6 * font_size]);
    area.draw_axes(&mut sheet, look);
    let bottom = top + area.size[1];
    let [x_title, y_title] = panel.axes;
    let position = [left + width / 2.0, bottom + 1.3 * small + 0.95 * font_size];
    sheet.label(x_title, position, font_size, Anchor::Middle);
    let position = [left - numbers - 0.55 * small - 0.35 * font_size, f64::midpoint(top, bottom)];
    sheet.rotated_label(y_title, position, font_size, Anchor::Middle, TextDirection::Up);
    for series in &panel.series {
        area.draw_series(&mut sheet, look, series);
    }
    let entries = panel.series.iter().map(|series| LegendEntry {
        name: &series.name,
        style: series.style,
        sample: LegendSample::Curve,
    });
    let legend = Legend::new(entries, look);
    let end = bottom + 1.5 * small + 2.0 * font_size;
    legend.draw(&mut sheet, look, end);
    sheet.size = [look.width, end + legend.height];
    sheet
}

/// Plot area in points.
struct Area {
    /// Upper left corner.
    corner: Point,
    /// Width and height.
    size: [f64; 2],
    /// Scales of the horizontal and the vertical axis.
    scales: [AxisScale; 2],
}

impl Area {
    /// Position of a pair of values on the sheet.
    fn position(&self, [x, y]: [f64; 2]) -> Point {
        let [horizontal, vertical] = &self.scales;
        [self.corner[0] + self.size[0] * horizontal.share(x), self.corner[1] + self.size[1] * (1.0 - vertical.share(y))]
    }

    fn draw_axes(&self, sheet: &mut Sheet, look: &Look) {
        let small = look.tick_font_size();
        let [horizontal, vertical] = &self.scales;
        let [left, bottom] = self.position([horizontal.low, vertical.low]);
        let right = left + self.size[0];
        for (value, text) in vertical.ticks() {
            let [_, y] = self.position([horizontal.low, value]);
            sheet.line(&[[left, y], [right, y]], &look.thin_stroke(GRID));
            let position = [left - 0.4 * small, y + 0.35 * small];
            sheet.label(&text, position, small, Anchor::End);
        }
        for (value, text) in horizontal.ticks() {
            let [x, _] = self.position([value, vertical.low]);
            sheet.line(&[[x, bottom], [x, bottom + 0.25 * small]], &look.thin_stroke(INK));
            sheet.label(&text, [x, bottom + 1.15 * small], small, Anchor::Middle);
        }
        let axes = [[left, self.corner[1]], [left, bottom], [right, bottom]];
        sheet.line(&axes, &look.thin_stroke(INK));
    }

    fn draw_series(&self, sheet: &mut Sheet, look: &Look, series: &PointSeries) {
        let pen = look.pen(series.style);
        for line in &series.lines {
            let points: Vec<Point> = line.iter().map(|point| self.position(*point)).collect();
            sheet.line(&points, &pen.stroke);
        }
        for point in &series.points {
            look.draw_marker(sheet, &pen, self.position(*point));
        }
    }
}

/// Range of an axis, and distance between its ticks.
struct AxisScale {
    low: f64,
    high: f64,
    step: f64,
}

impl AxisScale {
    /// Scale of a range with margins; from 0 to 1 with margins if there is no range. The ticks are at multiples of 1, 2
    /// or 5 times a power of ten.
    fn new(range: Option<[f64; 2]>) -> Self {
        let [low, high] = range.unwrap_or([0.0, 1.0]);
        let margin = if high > low { MARGIN * (high - low) } else { 1.0 };
        let (low, high) = (low - margin, high + margin);
        let min_step = (high - low) / MAX_STEPS;
        let power = libm::pow(10.0, libm::log10(min_step).floor());
        let step = [1.0, 2.0, 5.0].map(|factor| factor * power).into_iter().find(|step| *step >= min_step);
        Self { low, high, step: step.unwrap_or(10.0 * power) }
    }

    /// Position of a value between the ends of the axis, from 0 to 1.
    fn share(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }

    /// Value and label of each tick.
    fn ticks(&self) -> impl Iterator<Item = (f64, String)> {
        let decimals = (-libm::log10(self.step * 1.001).floor()).max(0.0) as usize;
        let first = (self.low / self.step).ceil() as i64;
        let last = (self.high / self.step).floor() as i64;
        (first..=last).map(move |index| {
            let value = index as f64 * self.step;
            (value, format!("{value:.decimals$}").replace('-', "−"))
        })
    }
}

/// Space between two sheets in em.
const GAP: f64 = 2.0;

/// Style of a sheet that fills one of several columns.
pub(super) fn column_look(columns: usize, look: &Look) -> Look {
    let between = GAP * look.font_size * (columns - 1) as f64;
    let width = (look.width - between) / columns as f64;
    Look { width, ..*look }
}

/// Arranges sheets of the width of a column (see [`column_look`]) in rows.
pub(super) fn arrange_in_rows(parts: impl IntoIterator<Item = Sheet>, columns: usize, look: &Look) -> Sheet {
    let gap = GAP * look.font_size;
    let step = (look.width + gap) / columns as f64;
    let mut sheet = Sheet::default();
    let (mut top, mut parts) = (0.0, parts.into_iter());
    loop {
        let row: Vec<Sheet> = parts.by_ref().take(columns).collect();
        if row.is_empty() {
            break;
        }
        top += if top > 0.0 { gap / 2.0 } else { 0.0 };
        let tallest = row.iter().map(|part| part.size[1]).fold(0.0, f64::max);
        for (column, part) in row.into_iter().enumerate() {
            sheet.insert(part, [step * column as f64, top]);
        }
        top += tallest;
    }
    sheet.size = [look.width, top];
    sheet
}

/// Minimum width of a panel with its labels in em.
const MIN_PANEL_WIDTH: f64 = 14.0;

/// Maximum number of panels in a row.
const MAX_COLUMNS: usize = 3;

/// Draws a reliability chart as rows of square panels, with the legend below them.
pub(super) fn reliability(chart: &ReliabilityChart, look: &Look) -> Sheet {
    let fitting = (look.width / (MIN_PANEL_WIDTH * look.font_size)) as usize;
    let columns = MAX_COLUMNS.min(fitting).min(chart.panels.len()).max(1);
    let left = Font::bundled().width("100", look.tick_font_size()) + 1.9 * look.font_size;
    let column_width = look.width / columns as f64;
    let side = (column_width - left - 0.6 * look.font_size).min(22.0 * look.font_size);
    let mut sheet = Sheet::default();
    let mut top = 0.0;
    for row in chart.panels.chunks(columns) {
        let titles: Vec<Title> = row.iter().map(|panel| Title::new(&panel.title, look, side)).collect();
        top += Title::max_height(&titles, look) + 0.65 * look.font_size;
        for (index, (panel, title)) in row.iter().zip(&titles).enumerate() {
            let corner = [index as f64 * column_width + left, top];
            title.draw(&mut sheet, look, [corner[0], top - 0.6 * look.font_size]);
            draw_reliability_panel(&mut sheet, look, panel, Square { corner, side });
        }
        top += side + 1.5 * look.tick_font_size() + 2.0 * look.font_size;
    }
    let legend = legend(chart, look);
    legend.draw(&mut sheet, look, top);
    sheet.size = [look.width, top + legend.height];
    sheet
}

/// Plotting area of a panel: confidence to the right, accuracy upwards, both from 0 to 1.
#[derive(Debug, Clone, Copy)]
struct Square {
    corner: Point,
    side: f64,
}

impl Square {
    /// Position of a point on the sheet. Values outside 0 to 1 are clamped.
    fn position(self, confidence: f64, accuracy: f64) -> Point {
        let [left, top] = self.corner;
        let [right, up] = [confidence, accuracy].map(|share| self.side * share.clamp(0.0, 1.0));
        [left + right, top + self.side - up]
    }
}

fn draw_reliability_panel(sheet: &mut Sheet, look: &Look, panel: &ReliabilityPanel, square: Square) {
    draw_axes(sheet, look, square);
    sheet.line(&[square.position(0.0, 0.0), square.position(1.0, 1.0)], &look.dotted_stroke());
    for line in &panel.lines {
        let pen = look.pen(line.style);
        for (confidence, accuracy) in &line.bins {
            let interval = [accuracy.low, accuracy.high].map(|share| square.position(*confidence, share));
            sheet.line(&interval, &look.thin_stroke(pen.stroke.colour));
        }
        let points: Vec<Point> =
            line.bins.iter().map(|(confidence, accuracy)| square.position(*confidence, accuracy.value)).collect();
        sheet.line(&points, &pen.stroke);
        for position in points {
            look.draw_marker(sheet, &pen, position);
        }
    }
}

fn draw_axes(sheet: &mut Sheet, look: &Look, square: Square) {
    let small = look.tick_font_size();
    let x_axis = [square.position(0.0, 0.0), square.position(1.0, 0.0)];
    draw_percent_grid(sheet, look, x_axis.map(|[x, _]| x), |share| square.position(0.0, share)[1]);
    for tick in 0..=5 {
        let [x, bottom] = square.position(f64::from(tick) / 5.0, 0.0);
        sheet.line(&[[x, bottom], [x, bottom + 0.25 * small]], &look.thin_stroke(INK));
        let position = [x, bottom + 1.15 * small];
        sheet.label(&(tick * 20).to_string(), position, small, Anchor::Middle);
    }
    sheet.line(&x_axis, &look.thin_stroke(INK));
    let [middle, bottom] = square.position(0.5, 0.0);
    let x_label = [middle, bottom + 1.3 * small + 0.95 * look.font_size];
    sheet.label("confidence in %", x_label, look.font_size, Anchor::Middle);
    let [left, middle] = square.position(0.0, 0.5);
    let numbers = Font::bundled().width("100", small) + 0.9 * look.font_size;
    let y_label = [left - numbers, middle];
    sheet.rotated_label("accuracy in %", y_label, look.font_size, Anchor::Middle, TextDirection::Up);
}

/// Legend of the lines in all panels.
fn legend<'a>(chart: &'a ReliabilityChart, look: &Look) -> Legend<'a> {
    let entries = chart.panels.iter().flat_map(|panel| &panel.lines).map(|line| LegendEntry {
        name: &line.name,
        style: line.style,
        sample: LegendSample::Curve,
    });
    Legend::new(entries, look)
}

/// Height of a row in em.
const ROW: f64 = 1.5;

/// Maximum width of the names as a share of the figure's width.
const NAMES: f64 = 0.42;

/// Width in points of the widest text.
fn max_width<'a>(texts: impl Iterator<Item = &'a String>, size: f64) -> f64 {
    let font = Font::bundled();
    texts.map(|text| font.width(text, size)).fold(0.0, f64::max)
}

/// Draws a threshold chart: names on the left, intervals over an axis, and numbers on the right.
pub(crate) fn thresholds(chart: &ThresholdChart, look: &Look) -> Sheet {
    let (font, small) = (Font::bundled(), look.tick_font_size());
    let names = max_width(chart.rows.iter().map(|row| &row.name), small).min(NAMES * look.width);
    let numbers = max_width(chart.rows.iter().map(|row| &row.text), small);
    let left = names + 0.8 * small;
    let right = look.width - numbers - 1.6 * small;
    let scale = &chart.scale;
    let x = |value: f64| left + (right - left) * value.clamp(0.0, scale.end) / scale.end;
    let row_height = ROW * look.font_size;
    let bottom = 0.3 * look.font_size + row_height * chart.rows.len() as f64;
    let mut sheet = Sheet::default();
    for tick in (0..=scale.end as i32).step_by(scale.step as usize) {
        let at = x(f64::from(tick));
        sheet.line(&[[at, 0.0], [at, bottom]], &look.thin_stroke(GRID));
        sheet.label(&tick.to_string(), [at, bottom + 1.1 * small], small, Anchor::Middle);
    }
    let colour = look.colour(LineStyle(0));
    for (index, row) in chart.rows.iter().enumerate() {
        let y = 0.3 * look.font_size + row_height * (index as f64 + 0.5);
        let name = font.shortened(&row.name, small, names);
        sheet.label(&name, [left - 0.8 * small, y + 0.35 * small], small, Anchor::End);
        let ends = [[x(row.threshold.low), y], [x(row.threshold.high), y]];
        sheet.line(&ends, &Stroke::solid(colour, 1.1 * look.line_scale()));
        if row.threshold.high.is_infinite() {
            // An arrow marks an interval that goes beyond the axis.
            let (end, tip) = (x(scale.end), 2.2 * look.line_scale());
            sheet.area(vec![[end + 1.6 * tip, y], [end, y - tip], [end, y + tip]], colour, 1.0);
        }
        if row.threshold.value.is_finite() {
            sheet.shapes.push(Shape::Disc {
                centre: [x(row.threshold.value), y],
                radius: 2.0 * look.line_scale(),
                fill: Some(colour),
                edge: None,
            });
        }
        sheet.label(&row.text, [right + 1.2 * small, y + 0.35 * small], small, Anchor::Start);
    }
    let title = format!("{} in {}", scale.title, scale.unit);
    let position = [f64::midpoint(left, right), bottom + 1.2 * small + look.font_size];
    sheet.label(&title, position, look.font_size, Anchor::Middle);
    sheet.size = [look.width, bottom + 1.6 * small + look.font_size];
    sheet
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::charts::chart::{LineStyle, ReliabilityLine};
    use crate::report::charts::paper::FigureColours;
    use crate::report::charts::paper::look::column_look as look;
    use crate::report::charts::paper::sheet::Shape;
    use darkqa_score::estimate::Estimate;

    #[test]
    fn bar_lengths_are_proportional_to_counts() {
        let look = Look { width: 510.0, font_size: 8.5, palette: FigureColours::Colour };
        let many = (0..40_u64).map(|number| (format!("class {number:02}"), number + 1));
        let panels = [
            CountPanel::from_counts("two", [("a".to_owned(), 3), ("b".to_owned(), 1)].into_iter()),
            CountPanel::from_counts("many", many),
            CountPanel::from_counts("empty", [("c".to_owned(), 0)].into_iter()),
        ];
        let sheet = counts(&panels, &look);
        let lengths: Vec<f64> = sheet
            .shapes
            .iter()
            .filter_map(|shape| match shape {
                Shape::Area { corners, .. } => Some(corners[1][0] - corners[0][0]),
                _ => None,
            })
            .collect();
        assert_eq!(lengths.len(), 2 + 24);
        assert!((lengths[0] / lengths[1] - 3.0).abs() < 1e-9, "{lengths:?}");
        for text in ["3 (75.0 %)", "17 others", "none"] {
            let is_written =
                sheet.shapes.iter().any(|shape| matches!(shape, Shape::Label(label) if label.text == text));
            assert!(is_written, "{text}");
        }
        for shape in &sheet.shapes {
            let Shape::Label(label) = shape else { continue };
            let end = label.start[0] + Font::bundled().width(&label.text, label.size);
            assert!(label.start[0] >= 0.0 && end <= look.width, "{label:?}");
        }
    }

    fn panel(series: Vec<PointSeries>) -> PointPanel {
        PointPanel { title: "a panel".to_owned(), axes: ["ln K", "ln σ"], series }
    }

    #[test]
    fn points_are_drawn_at_their_axis_positions() {
        let line = vec![[6.0, -2.0], [8.0, 1.0], [10.0, 4.0]];
        let sheet = points(
            &panel(vec![PointSeries {
                name: "a".to_owned(),
                style: LineStyle(0),
                points: vec![[8.0, 1.0]],
                lines: vec![line],
            }]),
            &look(),
        );
        let drawn: Vec<&Vec<Point>> = sheet
            .shapes
            .iter()
            .filter_map(|shape| match shape {
                Shape::Line { points, stroke } if points.len() == 3 && stroke.colour != INK => Some(points),
                _ => None,
            })
            .collect();
        assert_eq!(drawn.len(), 1);
        let [first, second, third] = [drawn[0][0], drawn[0][1], drawn[0][2]];
        assert!((first[0] - sheet.label_position("6")[0]).abs() < 1e-9);
        assert!((third[0] - sheet.label_position("10")[0]).abs() < 1e-9);
        let baseline = 0.35 * look().tick_font_size();
        assert!((first[1] - (sheet.label_position("−2")[1] - baseline)).abs() < 1e-9);
        assert!((third[1] - (sheet.label_position("4")[1] - baseline)).abs() < 1e-9);
        let has_marker = sheet.shapes.iter().any(|shape| {
            matches!(shape, Shape::Disc { centre, .. } if (centre[0] - second[0]).abs() < 1e-9
                && (centre[1] - second[1]).abs() < 1e-9)
        });
        assert!(has_marker);
    }

    #[test]
    fn ticks_are_few_and_round() {
        for (range, texts) in [
            (None, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"].as_slice()),
            (Some([3.0, 3.0]), &["2.0", "2.5", "3.0", "3.5", "4.0"]),
            (Some([-7.0, 0.0]), &["−6", "−4", "−2", "0"]),
            (Some([0.001, 0.002]), &["0.0010", "0.0012", "0.0014", "0.0016", "0.0018", "0.0020"]),
        ] {
            let ticks: Vec<String> = AxisScale::new(range).ticks().map(|(_, text)| text).collect();
            assert_eq!(ticks, texts, "{range:?}");
        }
    }

    #[test]
    fn a_panel_without_points_is_drawn() {
        assert!(points(&panel(Vec::new()), &look()).size[1] > 100.0);
    }

    fn share(value: f64) -> Estimate {
        Estimate { value, low: value - 0.2, high: value + 0.1, n: 40 }
    }

    #[test]
    fn curves_and_intervals_share_one_scale() {
        let lines = ["L0", "L5"]
            .into_iter()
            .enumerate()
            .map(|(style, name)| ReliabilityLine {
                name: name.to_owned(),
                style: LineStyle(style),
                bins: vec![(0.25, share(0.5)), (0.75, share(0.6)), (1.0, share(0.8))],
            })
            .collect();
        let chart = ReliabilityChart {
            panels: vec![ReliabilityPanel { title: "a model".to_owned(), lines }],
            note: String::new(),
        };
        let look = Look { width: 252.0, font_size: 8.0, palette: FigureColours::Colour };
        let sheet = reliability(&chart, &look);
        let curves: Vec<&Vec<Point>> = sheet
            .shapes
            .iter()
            .filter_map(|shape| match shape {
                Shape::Line { points, .. } if points.len() == 3 => Some(points),
                _ => None,
            })
            .collect();
        // One curve per level. Both axes have the same scale in points per unit.
        assert_eq!(curves.len(), 2);
        let [first, second, last] = [curves[0][0], curves[0][1], curves[0][2]];
        let scale = (second[0] - first[0]) / 0.5;
        assert!(((last[0] - second[0]) / 0.25 - scale).abs() < 1e-9);
        assert!(((first[1] - second[1]) / 0.1 - scale).abs() < 1e-9);
        assert!(((second[1] - last[1]) / 0.2 - scale).abs() < 1e-9);
        let interval = sheet.shapes.iter().find_map(|shape| match shape {
            Shape::Line { points, .. }
                if points.len() == 2 && points.iter().all(|position| (position[0] - first[0]).abs() < 1e-9) =>
            {
                Some(points.clone())
            }
            _ => None,
        });
        let interval = interval.expect("the first bin has an interval");
        assert!(((interval[0][1] - interval[1][1]) / 0.3 - scale).abs() < 1e-9);
        for name in ["L0", "L5", "a model"] {
            let count =
                sheet.shapes.iter().filter(|shape| matches!(shape, Shape::Label(label) if label.text == name)).count();
            assert_eq!(count, 1, "{name}");
        }
    }
}
