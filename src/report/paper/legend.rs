//! The legend below the panels: [`Legend`].

use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, Place, Sheet};
use crate::report::chart::{Chart, LineStyle, PanelContent, PlotLine};

/// The first line of each name, with the place of its entry.
pub(super) struct Legend<'a> {
    entries: Vec<(&'a PlotLine, Place)>,
    /// Height in points.
    pub height: f64,
}

/// Length of the sample of a line, and distances, in heights of letters.
const SAMPLE: f64 = 2.6;
const AFTER_SAMPLE: f64 = 0.45;
const BETWEEN: f64 = 1.1;
const ROW: f64 = 1.4;
/// Room left of the first entry of a row.
const START: f64 = 0.3;

impl<'a> Legend<'a> {
    /// The entries of a chart in rows of the width of the figure.
    pub(super) fn new(chart: &'a Chart, look: &Look) -> Self {
        let font = Font::bundled();
        let (letters, row) = (look.letters, ROW * look.letters);
        let mut entries: Vec<(&PlotLine, Place)> = Vec::new();
        let start = START * letters;
        let (mut x, mut y) = (start, 0.0);
        for line in chart.panels.iter().flat_map(|panel| &panel.lines) {
            if entries.iter().any(|(entry, _)| entry.name == line.name) || line.is_empty() {
                continue;
            }
            let length = (SAMPLE + AFTER_SAMPLE) * letters + font.width(&line.name, letters);
            if x > start && x + length > look.width {
                (x, y) = (start, y + row);
            }
            entries.push((line, [x, y]));
            x += length + BETWEEN * letters;
        }
        let height = if entries.is_empty() { 0.0 } else { y + row };
        Self { entries, height }
    }

    /// The place of a model without images among those of the figure.
    pub(super) fn place_without_images(&self, name: &str) -> usize {
        let flat = self.entries.iter().map(|(line, _)| line);
        let mut flat = flat.filter(|line| is_without_images(line));
        flat.position(|line| line.name == name).unwrap_or(0)
    }

    /// Draws the entries, the first row beginning at a height.
    pub(super) fn draw(&self, sheet: &mut Sheet, look: &Look, top: f64) {
        let letters = look.letters;
        for (line, [x, y]) in &self.entries {
            let y = top + y + 0.6 * letters;
            let ends = [[*x, y], [x + SAMPLE * letters, y]];
            let middle = [x + SAMPLE * letters / 2.0, y];
            match &line.content {
                PanelContent::Curve(_) => {
                    let pen = look.pen(line.style);
                    sheet.line(&ends, &pen.stroke);
                    look.mark(sheet, &pen, middle);
                }
                PanelContent::Marks(_) => {
                    sheet.line(&ends, &look.thin(look.colour(line.style)));
                    look.hollow(sheet, line.style, middle);
                }
                PanelContent::Flat(_) => sheet.line(&ends, &self.flat(line, look)),
            }
            let start = (SAMPLE + AFTER_SAMPLE) * letters;
            let room = look.width - x - start;
            let name = Font::bundled().shortened(&line.name, letters, room);
            sheet.words(
                &name,
                [x + start, y + 0.35 * letters],
                letters,
                Anchor::Start,
            );
        }
    }

    /// The stroke of a flat line.
    pub(super) fn flat(&self, line: &PlotLine, look: &Look) -> super::sheet::Stroke {
        if is_without_images(line) {
            look.without_images(self.place_without_images(&line.name))
        } else {
            look.dots()
        }
    }
}

fn is_without_images(line: &PlotLine) -> bool {
    matches!(line.content, PanelContent::Flat(_)) && line.style != LineStyle::REFERENCE
}
