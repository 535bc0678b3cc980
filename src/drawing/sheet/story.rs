//! The picture that tells a run's story: one item over the levels, raw above enhanced, and the curves of all items: [`story`].

use super::levels::label;
use super::{CELL, GAP, LINE, SheetCanvas, letter_width, mean};
use crate::drawing::chart::{COLOURS, LineStyle, PanelContent, PlotLine};
use crate::types::{AxisLevel, Rgb};

/// Width of a sheet of six levels, in pixels; fewer levels need less.
const WIDTH: usize = 1600;
/// Height of the axes of the curves in pixels.
const AXES: usize = 240;
const INK: [u8; 3] = [34; 3];
const GRID: [u8; 3] = [221; 3];
const GREEN: [u8; 3] = [0, 125, 60];
const RED: [u8; 3] = [196, 30, 30];
const GREY: [u8; 3] = [110; 3];

/// Result of a reply, as a mark below an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StoryMark {
    Right,
    Wrong,
    /// The reply could not be read, or there is none.
    None,
}

/// An image of the item, with the mark of each model.
#[derive(Debug, Clone)]
pub(crate) struct StoryCell {
    pub image: Rgb,
    pub marks: Vec<(String, StoryMark)>,
}

/// Images of the item over the levels; `None` where it was not asked.
#[derive(Debug, Clone)]
pub(crate) struct StoryRow {
    pub name: String,
    pub cells: Vec<Option<StoryCell>>,
}

/// All that the picture shows.
#[derive(Debug, Clone)]
pub(crate) struct Story {
    /// The question and its choices.
    pub question: Vec<String>,
    pub levels: Vec<AxisLevel>,
    pub rows: Vec<StoryRow>,
    /// Curves of accuracy, whose horizontal axis is the columns of the images.
    pub lines: Vec<PlotLine>,
    pub note: String,
}

/// Draws the picture. Images are scaled down by means of pixels.
#[must_use]
pub(crate) fn story(story: &Story) -> Rgb {
    let layout = Layout::new(story);
    let mut sheet = SheetCanvas::new(layout.height, layout.width);
    let mut top = GAP;
    for line in &story.question {
        sheet.write([top, GAP], layout.width - 2 * GAP, line, INK);
        top += LINE;
    }
    top += GAP;
    for (index, level) in story.levels.iter().enumerate() {
        let label = match level.severity() {
            None => format!("{level} untouched"),
            Some(_) => label(*level),
        };
        sheet.write([top, layout.left(index)], layout.cell[1], &label, INK);
    }
    top += LINE + 2;
    for row in &story.rows {
        sheet.write(
            [top + (layout.cell[0].saturating_sub(LINE)) / 2, GAP],
            layout.margins[0],
            &row.name,
            INK,
        );
        for (index, cell) in row.cells.iter().enumerate() {
            if let Some(cell) = cell {
                draw_cell(&mut sheet, &layout, [top, layout.left(index)], cell);
            }
        }
        top += layout.row;
    }
    draw_curves(&mut sheet, &layout, top + GAP, story);
    let note = format!("accuracy in %, {}", story.note);
    sheet.write(
        [layout.height - LINE - GAP / 2, GAP],
        layout.width - 2 * GAP,
        &note,
        GREY,
    );
    sheet.finish()
}

/// Sizes of the picture in pixels.
struct Layout {
    /// Space to the left and to the right of the images.
    margins: [usize; 2],
    /// Height and width of an image.
    cell: [usize; 2],
    /// Height of a row of images, with the marks below.
    row: usize,
    height: usize,
    width: usize,
}

impl Layout {
    fn new(story: &Story) -> Self {
        let letters = |names: &mut dyn Iterator<Item = &String>| {
            names.map(|name| name.chars().count()).max().unwrap_or(0)
        };
        let left = letters(&mut story.rows.iter().map(|row| &row.name)).max(4);
        let right = letters(&mut story.lines.iter().map(|line| &line.name));
        let margins = [left, right].map(|letters| letters * letter_width() + 2 * GAP);
        let columns = story.levels.len().max(1);
        let free = WIDTH.saturating_sub(margins[0] + margins[1] + columns * GAP);
        let width = (free / columns).clamp(CELL / 4, CELL);
        let mut cells = story.rows.iter().flat_map(|row| row.cells.iter().flatten());
        let [height, marks] = cells.next().map_or([width, 0], |cell| {
            let height = cell.image.height() * width / cell.image.width().max(1);
            [height.max(1), cell.marks.len()]
        });
        let row = height + marks * LINE + GAP;
        let heads = GAP + story.question.len() * LINE + GAP + LINE + 2;
        Self {
            margins,
            cell: [height, width],
            row,
            height: heads + story.rows.len() * row + GAP + AXES + 2 * LINE + GAP,
            width: margins[0] + columns * (width + GAP) + margins[1],
        }
    }

    fn left(&self, column: usize) -> usize {
        self.margins[0] + column * (self.cell[1] + GAP)
    }
}

fn draw_cell(sheet: &mut SheetCanvas, layout: &Layout, [top, left]: [usize; 2], cell: &StoryCell) {
    sheet.fill([top, left], layout.cell, |row, column| {
        mean(&cell.image, layout.cell, row, column)
    });
    for (index, (model, mark)) in cell.marks.iter().enumerate() {
        let top = top + layout.cell[0] + index * LINE;
        let [x, y] = [left as f64, top as f64];
        let at = |places: &[[f64; 2]]| -> Vec<[f64; 2]> {
            places
                .iter()
                .map(|place| [x + place[0], y + place[1]])
                .collect()
        };
        match mark {
            StoryMark::Right => {
                sheet.path(
                    &at(&[[2.0, 11.0], [6.0, 15.0], [14.0, 5.0]]),
                    None,
                    2.5,
                    GREEN,
                );
            }
            StoryMark::Wrong => {
                sheet.path(&at(&[[3.0, 5.0], [13.0, 15.0]]), None, 2.5, RED);
                sheet.path(&at(&[[13.0, 5.0], [3.0, 15.0]]), None, 2.5, RED);
            }
            StoryMark::None => sheet.path(&at(&[[3.0, 10.0], [13.0, 10.0]]), None, 2.5, GREY),
        }
        sheet.write(
            [top, left + 20],
            layout.cell[1].saturating_sub(20),
            model,
            INK,
        );
    }
}

/// Draws the curves. Each level is at the middle of its column.
fn draw_curves(sheet: &mut SheetCanvas, layout: &Layout, top: usize, story: &Story) {
    let ends = [layout.margins[0], layout.width - layout.margins[1]].map(|x| x as f64);
    let y = |share: f64| (top + LINE / 2) as f64 + (AXES as f64) * (1.0 - share.clamp(0.0, 1.0));
    let x = |level: AxisLevel| {
        let index = story.levels.iter().position(|other| *other == level)?;
        Some((layout.left(index) + layout.cell[1] / 2) as f64)
    };
    for step in 0..=5 {
        let y = y(f64::from(step) / 5.0);
        sheet.path(&[[ends[0], y], [ends[1], y]], None, 1.0, GRID);
        let label = format!("{:>3}", step * 20);
        let left = layout.margins[0].saturating_sub(3 * letter_width() + GAP);
        sheet.write(
            [y as usize - LINE / 2, left],
            layout.margins[0],
            &label,
            INK,
        );
    }
    let mut labels = Vec::new();
    for line in &story.lines {
        let colour = line.style.rgb();
        let last = match &line.content {
            PanelContent::Flat(share) => {
                let y = y(*share);
                sheet.path(&[[ends[0], y], [ends[1], y]], Some([6.0, 4.0]), 1.5, colour);
                y
            }
            // The story is of levels alone.
            PanelContent::Marks(_) => continue,
            PanelContent::Curve(points) => {
                let points = points
                    .iter()
                    .filter_map(|(level, at)| Some((x(*level)?, at)));
                let band = points.clone().map(|(x, at)| [x, y(at.high), y(at.low)]);
                sheet.band(&band.collect::<Vec<_>>(), colour, 0.14);
                let path: Vec<[f64; 2]> = points.map(|(x, at)| [x, y(at.value)]).collect();
                sheet.path(&path, dashes(line.style), 3.0, colour);
                for place in &path {
                    sheet.line([*place, *place], 9.0, colour);
                }
                path.last().map_or_else(|| y(0.0), |place| place[1])
            }
        };
        labels.push((last, &line.name, colour));
    }
    write_labels(sheet, layout, labels);
}

/// Lengths of dash and gap in pixels; the first style is a solid line.
const DASHES: [Option<[f64; 2]>; 4] = [None, Some([9.0, 5.0]), Some([2.0, 4.0]), Some([14.0, 4.0])];

fn dashes(LineStyle(number): LineStyle) -> Option<[f64; 2]> {
    DASHES[(number + number / COLOURS.len()) % DASHES.len()]
}

/// Writes the name of each line at its right end, from top to bottom, without overlap.
fn write_labels(
    sheet: &mut SheetCanvas,
    layout: &Layout,
    mut labels: Vec<(f64, &String, [u8; 3])>,
) {
    labels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut free = 0;
    for (y, name, colour) in labels {
        let top = (y as usize).saturating_sub(LINE / 2).max(free);
        free = top + LINE;
        let left = layout.width - layout.margins[1] + GAP;
        sheet.write([top, left], layout.margins[1], name, colour);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Severity;
    use crate::types::degradations::Kind;
    use darkqa_score::estimate::Estimate;

    fn level(severity: Severity) -> AxisLevel {
        AxisLevel::new(Kind::ALL[0], severity)
    }

    fn made_story(size: [usize; 2], levels: &[AxisLevel]) -> Story {
        let cell = |mark| StoryCell {
            image: Rgb::new(size[0], size[1], vec![90; size[0] * size[1] * 3]).unwrap(),
            marks: vec![("observer".to_owned(), mark)],
        };
        let row = |name: &str, mark| StoryRow {
            name: name.to_owned(),
            cells: levels.iter().map(|_| Some(cell(mark))).collect(),
        };
        let at = |value| Estimate {
            value,
            low: value - 0.1,
            high: value + 0.1,
            n: 9,
        };
        let curve = levels
            .iter()
            .enumerate()
            .map(|(i, level)| (*level, at(0.9 - i as f64 / 10.0)));
        Story {
            question: vec!["Is there a bed in the image?".to_owned()],
            levels: levels.to_vec(),
            rows: vec![
                row("noise", StoryMark::Wrong),
                row("+ lift", StoryMark::Right),
            ],
            lines: vec![
                PlotLine {
                    name: "observer".to_owned(),
                    style: LineStyle(0),
                    content: PanelContent::Curve(curve.collect()),
                    model: None,
                    items: None,
                },
                PlotLine {
                    name: "chance".to_owned(),
                    style: LineStyle(1),
                    content: PanelContent::Flat(0.3),
                    model: None,
                    items: None,
                },
            ],
            note: "n = 9".to_owned(),
        }
    }

    fn has(image: &Rgb, colour: [u8; 3]) -> usize {
        image
            .samples()
            .chunks(3)
            .filter(|pixel| **pixel == colour)
            .count()
    }

    #[test]
    fn images_marks_and_curves_are_drawn() {
        let levels = [AxisLevel::L0, level(Severity::L3), level(Severity::L5)];
        let sheet = story(&made_story([60, 80], &levels));
        assert!(has(&sheet, [90; 3]) > 6 * 60 * 80);
        assert!(has(&sheet, GREEN) > 30 && has(&sheet, RED) > 30);
        let curve = has(&sheet, LineStyle(0).rgb());
        let mut without = made_story([60, 80], &levels);
        without.lines.remove(0);
        assert!(curve > 1000 && has(&story(&without), LineStyle(0).rgb()) == 0);
    }

    #[test]
    fn every_size_has_a_picture() {
        let all: Vec<AxisLevel> = std::iter::once(AxisLevel::L0)
            .chain(Severity::LADDER.map(level))
            .collect();
        for size in [[1, 1], [3, 500], [500, 3], [720, 1280]] {
            for levels in [&all[..1], &all] {
                assert!(story(&made_story(size, levels)).width() <= WIDTH + CELL);
            }
        }
    }
}
