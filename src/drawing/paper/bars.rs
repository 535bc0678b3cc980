//! A chart of bars at the width of a column: [`bars`].

use super::axes::shares;
use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, Place, Sheet};
use super::title::{LEADING, Title};
use crate::drawing::chart::INK;
use crate::drawing::chart::bars::{Bar, BarChart, BarPanel};

/// Height of the panels between their axes, in heights of letters.
const HEIGHT: f64 = 11.0;
/// Width of a bar, in parts of the room that it has.
const BAR: f64 = 0.6;
/// Most lines of a title and of a name below a bar.
const LINES: f64 = 2.0;

/// The chart as a sheet: a panel a row.
pub(crate) fn bars(chart: &BarChart, look: &Look) -> Sheet {
    let mut sheet = Sheet::default();
    let mut top = 0.0;
    for panel in &chart.panels {
        top += (LINES * LEADING + 0.3) * look.letters;
        let left = Font::bundled().width("100", look.small()) + 0.6 * look.letters;
        draw(&mut sheet, look, panel, [left, top]);
        top += HEIGHT * look.letters + (LINES * LEADING + 1.6) * look.small();
    }
    sheet.size = [look.width, top];
    sheet
}

fn draw(sheet: &mut Sheet, look: &Look, panel: &BarPanel, [left, top]: Place) {
    let (right, bottom) = (look.width - 0.4 * look.letters, top + HEIGHT * look.letters);
    let y = |share: f64| bottom - HEIGHT * look.letters * share.clamp(0.0, 1.0);
    shares(sheet, look, [left, right], y);
    let title = Title::new(&panel.title, look, right - left);
    title.draw(sheet, look, [left, top - 0.5 * look.letters]);
    let step = (right - left) / panel.bars.len().max(1) as f64;
    for (index, bar) in panel.bars.iter().enumerate() {
        let middle = left + step * (index as f64 + 0.5);
        draw_bar(sheet, look, bar, ([middle, bottom], step, &y));
    }
    if let Some(share) = panel.line {
        sheet.line(&[[left, y(share)], [right, y(share)]], &look.dots());
    }
    sheet.line(&[[left, bottom], [right, bottom]], &look.thin(INK));
}

fn draw_bar(
    sheet: &mut Sheet,
    look: &Look,
    bar: &Bar,
    ([middle, bottom], step, y): (Place, f64, &impl Fn(f64) -> f64),
) {
    let (half, high) = (step.min(6.0 * look.letters) * BAR / 2.0, y(bar.share.value));
    let corners = [
        [middle - half, bottom],
        [middle - half, high],
        [middle + half, high],
        [middle + half, bottom],
    ];
    sheet.area(corners.to_vec(), look.colour(bar.style), 0.55);
    let ends = [bar.share.low, bar.share.high].map(|share| [middle, y(share)]);
    sheet.line(&ends, &look.pen(bar.style).stroke);
    let small = look.small();
    let share = format!("{:.1}", 100.0 * bar.share.value);
    sheet.words(
        &share,
        [middle, bottom + 1.1 * small],
        small,
        Anchor::Middle,
    );
    let name = Font::bundled().shortened(&bar.name, small, 0.95 * step);
    sheet.words(
        &name,
        [middle, bottom + 2.25 * small],
        small,
        Anchor::Middle,
    );
}
