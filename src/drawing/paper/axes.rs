//! The axes of a panel: [`Axes`].

use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, GRID, Place, Sheet, Turn};
use crate::drawing::chart::{INK, Panel};
use crate::types::AxisLevel;

/// A rectangle between axes, in points, with the scale of its levels.
#[derive(Debug, Clone)]
pub(super) struct Axes {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
    levels: Vec<AxisLevel>,
    /// The right end of the axis, in the unit of the levels.
    farthest: f64,
    title: String,
}

/// The room between the ends of the axis and its first and last level, as a share of the width.
const INDENT: f64 = 0.035;

impl Axes {
    /// The axes of a panel, their left upper corner at a place.
    pub(super) fn new(panel: &Panel, [left, top]: Place, [width, height]: [f64; 2]) -> Self {
        Self {
            left,
            top,
            width,
            height,
            levels: panel.levels(),
            farthest: panel.farthest(),
            title: panel.axis_title(),
        }
    }

    /// Room for the numbers left of the axis.
    pub(super) fn numbers_width(look: &Look) -> f64 {
        Font::bundled().width("100", look.small()) + 0.55 * look.small()
    }

    /// Room below the axis, for the levels, their numbers and the title of the axis.
    pub(super) fn foot(look: &Look) -> f64 {
        2.35 * look.small() + 1.5 * look.letters
    }

    /// Horizontal place of a number in the unit of the levels.
    pub(super) fn x(&self, value: f64) -> f64 {
        let share = if self.farthest > 0.0 {
            value / self.farthest
        } else {
            0.5
        };
        self.left + self.width * (INDENT + (1.0 - 2.0 * INDENT) * share)
    }

    /// Vertical place of a share.
    pub(super) fn y(&self, share: f64) -> f64 {
        self.top + self.height * (1.0 - share.clamp(0.0, 1.0))
    }

    /// Draws grid, levels and titles. `measure` is the title of the vertical axis; empty where the panel to the left has it.
    pub(super) fn draw(&self, sheet: &mut Sheet, look: &Look, measure: &str) {
        let (right, bottom) = (self.left + self.width, self.top + self.height);
        let small = look.small();
        shares(sheet, look, [self.left, right], |share| self.y(share));
        sheet.line(&[[self.left, bottom], [right, bottom]], &look.thin(INK));
        let labelled = self.labelled(look);
        for level in &self.levels {
            let x = self.x(level.value());
            sheet.line(&[[x, bottom], [x, bottom + 0.25 * small]], &look.thin(INK));
            if labelled.contains(level) {
                let place = [x, bottom + 1.15 * small];
                sheet.words(&level.to_string(), place, small, Anchor::Middle);
                let value = level.value().to_string();
                sheet.words(&value, [x, bottom + 2.2 * small], small, Anchor::Middle);
            }
        }
        let middle = self.left + self.width / 2.0;
        let title = Font::bundled().shortened(&self.title, look.letters, self.width * 1.15);
        let place = [middle, bottom + 2.35 * small + 0.95 * look.letters];
        sheet.words(&title, place, look.letters, Anchor::Middle);
        let place = [
            self.left - Self::numbers_width(look) - 0.35 * look.letters,
            self.top + self.height / 2.0,
        ];
        sheet.turned_words(measure, place, look.letters, Anchor::Middle, Turn::Up);
    }

    /// The levels whose names have room on the axis, from L0: each that does not touch the one before.
    fn labelled(&self, look: &Look) -> Vec<AxisLevel> {
        let font = Font::bundled();
        let reach = |level: AxisLevel| {
            let name = font.width(&level.to_string(), look.small());
            name.max(font.width(&level.value().to_string(), look.small())) / 2.0
        };
        let mut labelled: Vec<AxisLevel> = Vec::new();
        for level in &self.levels {
            let start = self.x(level.value()) - reach(*level);
            let end = labelled.last();
            let end = end.map(|last| self.x(last.value()) + reach(*last) + 0.2 * look.small());
            if end.is_none_or(|end| end < start) {
                labelled.push(*level);
            }
        }
        labelled
    }
}

/// Draws the grid of shares between the ends of an axis, with its numbers in percent. `y` is the vertical place of a share.
pub(super) fn shares(
    sheet: &mut Sheet,
    look: &Look,
    [left, right]: [f64; 2],
    y: impl Fn(f64) -> f64,
) {
    let small = look.small();
    for step in 0..=5 {
        let y = y(f64::from(step) / 5.0);
        sheet.line(&[[left, y], [right, y]], &look.thin(GRID));
        let place = [left - 0.4 * small, y + 0.35 * small];
        sheet.words(&(step * 20).to_string(), place, small, Anchor::End);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::paper::Palette;
    use crate::types::Severity;
    use crate::types::degradations::Kind;

    /// Names of the labelled levels of an axis with L0 and these drops in hundredths of an EV.
    fn labelled(drops: impl IntoIterator<Item = u16>) -> Vec<String> {
        let of = |drop| AxisLevel::new(Kind::Sensor, Severity::from_hundredths(drop));
        let drops = drops.into_iter().map(of);
        let levels: Vec<AxisLevel> = std::iter::once(AxisLevel::L0).chain(drops).collect();
        let axes = Axes {
            left: 0.0,
            top: 0.0,
            width: 200.0,
            height: 1.0,
            farthest: levels.last().map_or(0.0, |level| level.value()),
            levels,
            title: String::new(),
        };
        let look = Look {
            width: 252.0,
            letters: 8.0,
            palette: Palette::Colour,
        };
        axes.labelled(&look)
            .iter()
            .map(ToString::to_string)
            .collect()
    }

    #[test]
    fn labels_of_levels_do_not_overlap() {
        let paper = [200, 400, 600, 750, 900];
        assert_eq!(labelled(paper), ["L0", "L1", "L2", "L3", "L4", "L5"]);
        let halves = labelled((1..=20).map(|step| 50 * step));
        assert!(halves.len() > 5 && halves.len() < 15, "{halves:?}");
        assert_eq!(labelled([1, 900]), ["L0", "L5"]);
    }
}
