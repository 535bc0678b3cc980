//! Drawing of threshold charts: [`thresholds`].

use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, GRID, Shape, Sheet, Stroke};
use crate::report::charts::chart::LineStyle;
use crate::report::charts::chart::thresholds::ThresholdChart;

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
