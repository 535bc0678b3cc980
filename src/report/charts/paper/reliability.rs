//! Drawing of reliability diagrams: [`reliability`].

use super::axes::draw_percent_grid;
use super::font::Font;
use super::legend::{Legend, LegendEntry, LegendSample};
use super::look::Look;
use super::sheet::{Anchor, Point, Sheet, TextDirection};
use super::title::Title;
use crate::report::charts::chart::INK;
use crate::report::charts::chart::reliability::{ReliabilityChart, ReliabilityPanel};

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
            draw_panel(&mut sheet, look, panel, Square { corner, side });
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

fn draw_panel(sheet: &mut Sheet, look: &Look, panel: &ReliabilityPanel, square: Square) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::charts::chart::LineStyle;
    use crate::report::charts::chart::reliability::ReliabilityLine;
    use crate::report::charts::paper::Palette;
    use crate::report::charts::paper::sheet::Shape;
    use darkqa_score::estimate::Estimate;

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
        let look = Look { width: 252.0, font_size: 8.0, palette: Palette::Colour };
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
