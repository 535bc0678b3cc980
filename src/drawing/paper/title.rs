//! The title above a panel: [`Title`].

use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, Place, Sheet};

/// Distance of two lines of a title, in heights of letters.
pub(super) const LEADING: f64 = 1.15;

/// A title in as many lines as it needs.
pub(super) struct Title(Vec<String>);

impl Title {
    /// Breaks a text into lines of at most `width` points.
    pub(super) fn new(text: &str, look: &Look, width: f64) -> Self {
        Self(Font::bundled().wrapped(text, look.letters, width))
    }

    /// Height of the highest of some titles in points.
    pub(super) fn highest(titles: &[Self], look: &Look) -> f64 {
        let lines = titles.iter().map(|title| title.0.len()).max().unwrap_or(0);
        lines as f64 * LEADING * look.letters
    }

    /// Draws the lines, the last one on a base line.
    pub(super) fn draw(&self, sheet: &mut Sheet, look: &Look, [left, base]: Place) {
        for (line, text) in self.0.iter().rev().enumerate() {
            let y = base - LEADING * line as f64 * look.letters;
            sheet.words(text, [left, y], look.letters, Anchor::Start);
        }
    }
}
