//! Drawing of bar charts: [`bars`].

use super::axes::draw_percent_grid;
use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, Point, Sheet};
use super::title::{LEADING, Title};
use crate::report::charts::chart::INK;
use crate::report::charts::chart::bars::{Bar, BarChart, BarPanel};

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
        draw_panel(&mut sheet, look, panel, [left, top]);
        top += HEIGHT * look.font_size + (LINES * LEADING + 1.6) * look.tick_font_size();
    }
    sheet.size = [look.width, top];
    sheet
}

/// Vertical position of a share above the bottom of a panel.
fn share_y(look: &Look, bottom: f64, share: f64) -> f64 {
    bottom - HEIGHT * look.font_size * share.clamp(0.0, 1.0)
}

fn draw_panel(sheet: &mut Sheet, look: &Look, panel: &BarPanel, [left, top]: Point) {
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
