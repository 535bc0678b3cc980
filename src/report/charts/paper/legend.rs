//! Legend below the panels of a figure: [`Legend`].

use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, Point, Sheet, Stroke};
use crate::charts::chart::{Chart, LineContent, LineStyle, PlotLine};

/// Kind of sample before a name in a legend.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LegendSample {
    /// A line with a marker.
    Curve,
    /// A thin line with a hollow marker.
    Marks,
    /// A line without a marker.
    Flat,
}

/// LegendEntry of a legend: a name with its sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct LegendEntry<'a> {
    pub name: &'a str,
    pub style: LineStyle,
    pub sample: LegendSample,
}

impl<'a> From<&'a PlotLine> for LegendEntry<'a> {
    fn from(line: &'a PlotLine) -> Self {
        Self {
            name: &line.name,
            style: line.style,
            sample: match line.content {
                LineContent::Marks(_) => LegendSample::Marks,
                LineContent::Flat(_) => LegendSample::Flat,
                _ => LegendSample::Curve,
            },
        }
    }
}

impl LegendEntry<'_> {
    /// Kind of the line, as the page's script names it.
    pub(super) fn kind(&self) -> &'static str {
        match self.sample {
            LegendSample::Flat if self.style == LineStyle::REFERENCE => "chance",
            LegendSample::Flat => "flat",
            LegendSample::Curve => "curve",
            LegendSample::Marks => "marks",
        }
    }

    /// True for the horizontal line of a model without images.
    fn is_without_images(&self) -> bool {
        self.sample == LegendSample::Flat && self.style != LineStyle::REFERENCE
    }
}

/// Entries with distinct names, and their positions.
pub(super) struct Legend<'a> {
    entries: Vec<(LegendEntry<'a>, Point)>,
    /// Height in points.
    pub height: f64,
}

/// Length of a sample in em.
const SAMPLE: f64 = 2.6;
/// Space between a sample and its name in em.
const AFTER_SAMPLE: f64 = 0.45;
/// Space between two entries in em.
const BETWEEN: f64 = 1.1;
/// Height of a row in em.
const ROW: f64 = 1.4;
/// Space left of the first entry of a row in em.
const START: f64 = 0.3;

impl<'a> Legend<'a> {
    /// Legend of the named lines of a chart. Panels with names need none.
    pub(super) fn for_chart(chart: &'a Chart, look: &Look) -> Self {
        let panels = chart.panels.iter().filter(|panel| !panel.has_names());
        let lines = panels.flat_map(|panel| &panel.lines).filter(|line| !line.is_empty() && !line.name.is_empty());
        Self::new(lines.map(LegendEntry::from), look)
    }

    /// Arranges the entries in rows of the figure's width. Only the first entry of each name is kept.
    fn new(entries: impl Iterator<Item = LegendEntry<'a>>, look: &Look) -> Self {
        let font = Font::bundled();
        let (font_size, row) = (look.font_size, ROW * look.font_size);
        let mut arranged: Vec<(LegendEntry<'a>, Point)> = Vec::new();
        let start = START * font_size;
        let (mut x, mut y) = (start, 0.0);
        for entry in entries {
            if arranged.iter().any(|(known, _)| known.name == entry.name) {
                continue;
            }
            let length = (SAMPLE + AFTER_SAMPLE) * font_size + font.width(entry.name, font_size);
            if x > start && x + length > look.width {
                (x, y) = (start, y + row);
            }
            arranged.push((entry, [x, y]));
            x += length + BETWEEN * font_size;
        }
        let height = if arranged.is_empty() { 0.0 } else { y + row };
        Self { entries: arranged, height }
    }

    /// Draws the entries, the first row starting at `top`.
    pub(super) fn draw(&self, sheet: &mut Sheet, look: &Look, top: f64) {
        let font_size = look.font_size;
        for (entry, [x, y]) in &self.entries {
            let y = top + y + 0.6 * font_size;
            self.draw_sample(sheet, look, *entry, [*x, y]);
            let start = (SAMPLE + AFTER_SAMPLE) * font_size;
            let room = look.width - x - start;
            let name = Font::bundled().shortened(entry.name, font_size, room);
            let position = [x + start, y + 0.35 * font_size];
            sheet.label(&name, position, font_size, Anchor::Start);
        }
    }

    /// Draws the sample of an entry, its left end at a position.
    fn draw_sample(&self, sheet: &mut Sheet, look: &Look, entry: LegendEntry<'_>, [x, y]: Point) {
        let ends = [[x, y], [x + SAMPLE * look.font_size, y]];
        let middle = [x + SAMPLE * look.font_size / 2.0, y];
        match entry.sample {
            LegendSample::Curve => {
                let pen = look.pen(entry.style);
                sheet.line(&ends, &pen.stroke);
                look.draw_marker(sheet, &pen, middle);
            }
            LegendSample::Marks => {
                sheet.line(&ends, &look.thin_stroke(look.colour(entry.style)));
                look.draw_hollow_marker(sheet, entry.style, middle);
            }
            LegendSample::Flat => sheet.line(&ends, &self.flat_stroke(entry, look)),
        }
    }

    /// Each entry, with its sample on a sheet of its own.
    pub(super) fn samples(&self, look: &Look) -> impl Iterator<Item = (LegendEntry<'a>, Sheet)> {
        let size = [SAMPLE * look.font_size, look.font_size];
        self.entries.iter().map(move |(entry, _)| {
            let mut sheet = Sheet { size, ..Sheet::default() };
            self.draw_sample(&mut sheet, look, *entry, [0.0, size[1] / 2.0]);
            (*entry, sheet)
        })
    }

    /// Stroke of a horizontal line. The lines of models without images differ in their dashes, by their order in the
    /// legend.
    pub(super) fn flat_stroke(&self, entry: LegendEntry<'_>, look: &Look) -> Stroke {
        if !entry.is_without_images() {
            return look.dotted_stroke();
        }
        let index = self
            .entries
            .iter()
            .map(|(known, _)| known)
            .filter(|known| known.is_without_images())
            .position(|known| known.name == entry.name);
        look.without_images_stroke(index.unwrap_or(0))
    }
}
