//! Title above a panel: [`Title`].
//!
//! Axes of a panel of levels: [`Axes`].

use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, GRID, Point, Sheet, TextDirection};
use crate::report::charts::chart::{INK, Panel};
use crate::types::AxisLevel;

/// Distance between the baselines of two lines in em.
pub(super) const LEADING: f64 = 1.15;

/// Lines of a title.
pub(super) struct Title(Vec<String>);

impl Title {
    /// Breaks a text into lines of at most `width` points.
    pub(super) fn new(text: &str, look: &Look, width: f64) -> Self {
        Self(Font::bundled().wrapped(text, look.font_size, width))
    }

    /// Height of the tallest title in points.
    pub(super) fn max_height(titles: &[Self], look: &Look) -> f64 {
        let lines = titles.iter().map(|title| title.0.len()).max().unwrap_or(0);
        lines as f64 * LEADING * look.font_size
    }

    /// Draws the lines from a left edge, the last line on a baseline.
    pub(super) fn draw(&self, sheet: &mut Sheet, look: &Look, [left, baseline]: Point) {
        for (line, text) in self.0.iter().rev().enumerate() {
            let y = baseline - LEADING * line as f64 * look.font_size;
            sheet.label(text, [left, y], look.font_size, Anchor::Start);
        }
    }
}

/// Plot area of a panel in points, with the levels of its horizontal axis.
#[derive(Debug, Clone)]
pub(super) struct Axes {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
    levels: Vec<AxisLevel>,
    /// Value at the right end of the axis, in the unit of the levels.
    end: f64,
    title: String,
}

/// Space between each end of the horizontal axis and the nearest level, as a share of the width.
const INDENT: f64 = 0.035;

impl Axes {
    /// Axes of a panel whose plot area has its upper left corner at a point.
    pub(super) fn new(panel: &Panel, [left, top]: Point, [width, height]: [f64; 2]) -> Self {
        Self { left, top, width, height, levels: panel.levels(), end: panel.axis_end(), title: panel.axis_title() }
    }

    /// Width of the tick labels left of the axis, in points.
    pub(super) fn numbers_width(look: &Look) -> f64 {
        Font::bundled().width("100", look.tick_font_size()) + 0.55 * look.tick_font_size()
    }

    /// Height of the tick labels and the title below the axis, in points.
    pub(super) fn foot_height(look: &Look) -> f64 {
        2.35 * look.tick_font_size() + 1.5 * look.font_size
    }

    /// Horizontal position of a value in the unit of the levels.
    pub(super) fn x(&self, value: f64) -> f64 {
        let share = if self.end > 0.0 { value / self.end } else { 0.5 };
        self.left + self.width * (INDENT + (1.0 - 2.0 * INDENT) * share)
    }

    /// Vertical position of a share from 0 to 1.
    pub(super) fn y(&self, share: f64) -> f64 {
        self.top + self.height * (1.0 - share.clamp(0.0, 1.0))
    }

    /// Draws grid, levels and titles. `measure` is the title of the vertical axis; it is empty if the panel to the left
    /// has the title.
    pub(super) fn draw(&self, sheet: &mut Sheet, look: &Look, measure: &str) {
        let (right, bottom) = (self.left + self.width, self.top + self.height);
        let small = look.tick_font_size();
        draw_percent_grid(sheet, look, [self.left, right], |share| self.y(share));
        sheet.line(&[[self.left, bottom], [right, bottom]], &look.thin_stroke(INK));
        let labelled = self.labelled_levels(look);
        for level in &self.levels {
            let x = self.x(level.value());
            sheet.line(&[[x, bottom], [x, bottom + 0.25 * small]], &look.thin_stroke(INK));
            if labelled.contains(level) {
                let position = [x, bottom + 1.15 * small];
                sheet.label(&level.to_string(), position, small, Anchor::Middle);
                let value = level.value().to_string();
                sheet.label(&value, [x, bottom + 2.2 * small], small, Anchor::Middle);
            }
        }
        let middle = self.left + self.width / 2.0;
        let title = Font::bundled().shortened(&self.title, look.font_size, self.width * 1.15);
        let position = [middle, bottom + 2.35 * small + 0.95 * look.font_size];
        sheet.label(&title, position, look.font_size, Anchor::Middle);
        let position = [self.left - Self::numbers_width(look) - 0.35 * look.font_size, self.top + self.height / 2.0];
        sheet.rotated_label(measure, position, look.font_size, Anchor::Middle, TextDirection::Up);
    }

    /// Levels that get a label, from L0: a label that would touch the one before is left out.
    fn labelled_levels(&self, look: &Look) -> Vec<AxisLevel> {
        let mut labelled: Vec<AxisLevel> = Vec::new();
        for level in &self.levels {
            let start = self.x(level.value()) - half_label_width(*level, look);
            let end = labelled
                .last()
                .map(|last| self.x(last.value()) + half_label_width(*last, look) + 0.2 * look.tick_font_size());
            if end.is_none_or(|end| end < start) {
                labelled.push(*level);
            }
        }
        labelled
    }
}

/// Half of the width of a level's label: its name, or its value below.
fn half_label_width(level: AxisLevel, look: &Look) -> f64 {
    let font = Font::bundled();
    let name = font.width(&level.to_string(), look.tick_font_size());
    name.max(font.width(&level.value().to_string(), look.tick_font_size())) / 2.0
}

/// Draws horizontal grid lines with labels from 0 to 100 percent. `y` returns the vertical position of a share.
pub(super) fn draw_percent_grid(sheet: &mut Sheet, look: &Look, [left, right]: [f64; 2], y: impl Fn(f64) -> f64) {
    let small = look.tick_font_size();
    for step in 0..=5 {
        let y = y(f64::from(step) / 5.0);
        sheet.line(&[[left, y], [right, y]], &look.thin_stroke(GRID));
        let position = [left - 0.4 * small, y + 0.35 * small];
        sheet.label(&(step * 20).to_string(), position, small, Anchor::End);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::charts::paper::FigureColours;
    use crate::types::Severity;
    use crate::types::degradations::Kind;

    /// Names of the labelled levels on an axis of L0 and the given exposure drops, in hundredths of an EV.
    fn labelled(drops: impl IntoIterator<Item = u16>) -> Vec<String> {
        let levels: Vec<AxisLevel> = std::iter::once(AxisLevel::L0)
            .chain(drops.into_iter().map(|drop| AxisLevel::new(Kind::Sensor, Severity::from_hundredths(drop))))
            .collect();
        let axes = Axes {
            left: 0.0,
            top: 0.0,
            width: 200.0,
            height: 1.0,
            end: levels.last().map_or(0.0, |level| level.value()),
            levels,
            title: String::new(),
        };
        let look = Look { width: 252.0, font_size: 8.0, palette: FigureColours::Colour };
        axes.labelled_levels(&look).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn labels_of_levels_do_not_overlap() {
        let paper_levels = [200, 400, 600, 750, 900];
        assert_eq!(labelled(paper_levels), ["L0", "L1", "L2", "L3", "L4", "L5"]);
        let half_stops = labelled((1..=20).map(|step| 50 * step));
        assert!(half_stops.len() > 5 && half_stops.len() < 15, "{half_stops:?}");
        assert_eq!(labelled([1, 900]), ["L0", "L5"]);
    }
}
