//! Title above a panel: [`Title`].

use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, Point, Sheet};

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
