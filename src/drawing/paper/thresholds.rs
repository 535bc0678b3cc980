//! A chart of thresholds at the width of a column: [`thresholds`].

use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, GRID, Mark, Sheet, Stroke};
use crate::drawing::chart::LineStyle;
use crate::drawing::chart::thresholds::ThresholdChart;

/// Height of a row, in heights of letters.
const ROW: f64 = 1.5;
/// Most of the width that the names take.
const NAMES: f64 = 0.42;

/// The chart as a sheet: names, an axis, and the numbers.
pub(crate) fn thresholds(chart: &ThresholdChart, look: &Look) -> Sheet {
    let (font, small) = (Font::bundled(), look.small());
    let widest = |texts: Vec<&String>| {
        texts
            .into_iter()
            .map(|text| font.width(text, small))
            .fold(0.0, f64::max)
    };
    let names = widest(chart.rows.iter().map(|row| &row.name).collect()).min(NAMES * look.width);
    let numbers = widest(chart.rows.iter().map(|row| &row.words).collect());
    let left = names + 0.8 * small;
    let right = look.width - numbers - 1.6 * small;
    let scale = &chart.scale;
    let x = |value: f64| left + (right - left) * value.clamp(0.0, scale.end) / scale.end;
    let row = ROW * look.letters;
    let bottom = 0.3 * look.letters + row * chart.rows.len() as f64;
    let mut sheet = Sheet::default();
    for tick in (0..=scale.end as i32).step_by(scale.step as usize) {
        let at = x(f64::from(tick));
        sheet.line(&[[at, 0.0], [at, bottom]], &look.thin(GRID));
        sheet.words(
            &tick.to_string(),
            [at, bottom + 1.1 * small],
            small,
            Anchor::Middle,
        );
    }
    let colour = look.colour(LineStyle(0));
    for (index, of) in chart.rows.iter().enumerate() {
        let y = 0.3 * look.letters + row * (index as f64 + 0.5);
        let name = font.shortened(&of.name, small, names);
        sheet.words(
            &name,
            [left - 0.8 * small, y + 0.35 * small],
            small,
            Anchor::End,
        );
        let ends = [[x(of.threshold.low), y], [x(of.threshold.high), y]];
        sheet.line(&ends, &Stroke::solid(colour, 1.1 * look.weight()));
        if of.threshold.high.is_infinite() {
            let (end, tip) = (x(scale.end), 2.2 * look.weight());
            sheet.area(
                vec![[end + 1.6 * tip, y], [end, y - tip], [end, y + tip]],
                colour,
                1.0,
            );
        }
        if of.threshold.value.is_finite() {
            sheet.marks.push(Mark::Disc {
                centre: [x(of.threshold.value), y],
                radius: 2.0 * look.weight(),
                fill: Some(colour),
                edge: None,
            });
        }
        sheet.words(
            &of.words,
            [right + 1.2 * small, y + 0.35 * small],
            small,
            Anchor::Start,
        );
    }
    let title = format!("{} in {}", scale.title, scale.unit);
    let place = [
        f64::midpoint(left, right),
        bottom + 1.2 * small + look.letters,
    ];
    sheet.words(&title, place, look.letters, Anchor::Middle);
    sheet.size = [look.width, bottom + 1.6 * small + look.letters];
    sheet
}
