//! The legend below the panels: [`Legend`].

use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, Place, Sheet, Stroke};
use crate::drawing::chart::{Chart, LineStyle, PanelContent, PlotLine};

/// The mark before a name in a legend.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sample {
    /// A line with its mark.
    Curve,
    /// A thin line with a hollow mark.
    Marks,
    /// A line alone.
    Flat,
}

/// A name with its sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry<'a> {
    pub name: &'a str,
    pub style: LineStyle,
    pub sample: Sample,
}

impl<'a> From<&'a PlotLine> for Entry<'a> {
    fn from(line: &'a PlotLine) -> Self {
        Self {
            name: &line.name,
            style: line.style,
            sample: match line.content {
                PanelContent::Curve(_) => Sample::Curve,
                PanelContent::Marks(_) => Sample::Marks,
                PanelContent::Flat(_) => Sample::Flat,
            },
        }
    }
}

impl Entry<'_> {
    fn is_without_images(&self) -> bool {
        self.sample == Sample::Flat && self.style != LineStyle::REFERENCE
    }
}

/// The first entry of each name, with its place.
pub(super) struct Legend<'a> {
    entries: Vec<(Entry<'a>, Place)>,
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
    /// The legend of a chart of lines.
    pub(super) fn for_chart(chart: &'a Chart, look: &Look) -> Self {
        let lines = chart.panels.iter().flat_map(|panel| &panel.lines);
        Self::new(lines.filter(|line| !line.is_empty()).map(Entry::from), look)
    }

    /// The entries in rows of the width of the figure.
    pub(super) fn new(lines: impl Iterator<Item = Entry<'a>>, look: &Look) -> Self {
        let font = Font::bundled();
        let (letters, row) = (look.letters, ROW * look.letters);
        let mut entries: Vec<(Entry<'a>, Place)> = Vec::new();
        let start = START * letters;
        let (mut x, mut y) = (start, 0.0);
        for line in lines {
            if entries.iter().any(|(entry, _)| entry.name == line.name) {
                continue;
            }
            let length = (SAMPLE + AFTER_SAMPLE) * letters + font.width(line.name, letters);
            if x > start && x + length > look.width {
                (x, y) = (start, y + row);
            }
            entries.push((line, [x, y]));
            x += length + BETWEEN * letters;
        }
        let height = if entries.is_empty() { 0.0 } else { y + row };
        Self { entries, height }
    }

    /// Draws the entries, the first row beginning at a height.
    pub(super) fn draw(&self, sheet: &mut Sheet, look: &Look, top: f64) {
        let letters = look.letters;
        for (entry, [x, y]) in &self.entries {
            let y = top + y + 0.6 * letters;
            let ends = [[*x, y], [x + SAMPLE * letters, y]];
            let middle = [x + SAMPLE * letters / 2.0, y];
            match entry.sample {
                Sample::Curve => {
                    let pen = look.pen(entry.style);
                    sheet.line(&ends, &pen.stroke);
                    look.mark(sheet, &pen, middle);
                }
                Sample::Marks => {
                    sheet.line(&ends, &look.thin(look.colour(entry.style)));
                    look.hollow(sheet, entry.style, middle);
                }
                Sample::Flat => sheet.line(&ends, &self.flat(*entry, look)),
            }
            let start = (SAMPLE + AFTER_SAMPLE) * letters;
            let room = look.width - x - start;
            let name = Font::bundled().shortened(entry.name, letters, room);
            let place = [x + start, y + 0.35 * letters];
            sheet.words(&name, place, letters, Anchor::Start);
        }
    }

    /// The stroke of a flat line. Models without images differ by their place among those of the figure.
    pub(super) fn flat(&self, entry: Entry<'_>, look: &Look) -> Stroke {
        if !entry.is_without_images() {
            return look.dots();
        }
        let mut flat = self
            .entries
            .iter()
            .map(|(known, _)| known)
            .filter(|known| known.is_without_images());
        look.without_images(flat.position(|known| known.name == entry.name).unwrap_or(0))
    }
}
