//! Drawing of panels of points and lines over two numeric axes: [`points`].

use super::font::Font;
use super::legend::{Legend, LegendEntry, LegendSample};
use super::look::Look;
use super::sheet::{Anchor, GRID, Point, Sheet, TextDirection};
use super::title::Title;
use crate::report::charts::chart::INK;
use crate::report::charts::chart::points::{PointPanel, PointSeries};

/// Height of the plot area as a share of its width.
const RATIO: f64 = 0.75;
/// Margin at each end of an axis, as a share of the range of its values.
const MARGIN: f64 = 0.06;
/// Maximum number of intervals between ticks on an axis.
const MAX_STEPS: f64 = 6.0;

/// Draws a panel, with its legend below.
pub(crate) fn points(panel: &PointPanel, look: &Look) -> Sheet {
    let (font_size, small) = (look.font_size, look.tick_font_size());
    let [horizontal, vertical] = [0, 1].map(|axis| Scale::new(panel.range(axis)));
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
    scales: [Scale; 2],
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
struct Scale {
    low: f64,
    high: f64,
    step: f64,
}

impl Scale {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::charts::chart::LineStyle;
    use crate::report::charts::paper::look::column_look as look;
    use crate::report::charts::paper::sheet::Shape;

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
            let ticks: Vec<String> = Scale::new(range).ticks().map(|(_, text)| text).collect();
            assert_eq!(ticks, texts, "{range:?}");
        }
    }

    #[test]
    fn a_panel_without_points_is_drawn() {
        assert!(points(&panel(Vec::new()), &look()).size[1] > 100.0);
    }
}
