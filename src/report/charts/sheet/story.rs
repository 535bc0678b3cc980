//! Image that summarizes a run ([`story`]): one item at each level, raw above enhanced, and accuracy curves over all
//! items.

use super::levels::level_label;
use super::{CELL, GAP, LINE, SheetCanvas, letter_width, mean_colour};
use crate::charts::chart::{COLOURS, LineContent, LineStyle, PlotLine};
use darkqa_base::types::{AxisLevel, Rgb};
use darkqa_score::estimate::Estimate;

/// Maximum width of a sheet of six levels in pixels; a sheet of fewer levels is narrower.
const WIDTH: usize = 1600;
/// Height of the curves' plot area in pixels.
const AXES: usize = 240;
const INK: [u8; 3] = [34; 3];
const GRID: [u8; 3] = [221; 3];
const GREEN: [u8; 3] = [0, 125, 60];
const RED: [u8; 3] = [196, 30, 30];
const GREY: [u8; 3] = [110; 3];

/// Mark below an image for the result of a reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoryMark {
    Right,
    Wrong,
    /// The reply is missing or could not be parsed.
    None,
}

impl StoryMark {
    /// Lines of the mark as points from its upper left corner, in pixels, and its colour.
    fn paths(self) -> (&'static [&'static [[f64; 2]]], [u8; 3]) {
        match self {
            Self::Right => (&[&[[2.0, 11.0], [6.0, 15.0], [14.0, 5.0]]], GREEN),
            Self::Wrong => (&[&[[3.0, 5.0], [13.0, 15.0]], &[[13.0, 5.0], [3.0, 15.0]]], RED),
            Self::None => (&[&[[3.0, 10.0], [13.0, 10.0]]], GREY),
        }
    }
}

/// Image of the item in one condition.
#[derive(Debug, Clone)]
pub struct StoryCell {
    pub image: Rgb,
    /// Name of each model, and its result.
    pub marks: Vec<(String, StoryMark)>,
}

/// Images of the item in one variant, raw or enhanced.
#[derive(Debug, Clone)]
pub struct StoryRow {
    pub name: String,
    /// One cell for each level; `None` if the item was not asked at the level.
    pub cells: Vec<Option<StoryCell>>,
}

/// Content of the image.
#[derive(Debug, Clone)]
pub struct Story {
    /// The question and its choices, one on each line.
    pub question: Vec<String>,
    pub levels: Vec<AxisLevel>,
    pub rows: Vec<StoryRow>,
    /// Accuracy curves. A level of a curve is drawn below the column of the level's images.
    pub lines: Vec<PlotLine>,
    /// Text below the curves: number of items, and kind of intervals.
    pub note: String,
}

/// Draws the image. Images of the item are scaled down by averaging pixels.
#[must_use]
pub fn story(story: &Story) -> Rgb {
    let layout = StorySizes::new(story);
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
            Some(_) => level_label(*level),
        };
        sheet.write([top, layout.left(index)], layout.cell[1], &label, INK);
    }
    top += LINE + 2;
    for row in &story.rows {
        sheet.write([top + (layout.cell[0].saturating_sub(LINE)) / 2, GAP], layout.margins[0], &row.name, INK);
        for (index, cell) in row.cells.iter().enumerate() {
            if let Some(cell) = cell {
                draw_cell(&mut sheet, &layout, [top, layout.left(index)], cell);
            }
        }
        top += layout.row;
    }
    draw_curves(&mut sheet, &layout, top + GAP, story);
    let note = format!("accuracy in %, {}", story.note);
    sheet.write([layout.height - LINE - GAP / 2, GAP], layout.width - 2 * GAP, &note, GREY);
    sheet.finish()
}

/// Sizes in pixels.
struct StorySizes {
    /// Space to the left and to the right of the images.
    margins: [usize; 2],
    /// Height and width of an image.
    cell: [usize; 2],
    /// Height of a row of images, with the marks below.
    row: usize,
    /// Height of the whole sheet.
    height: usize,
    /// Width of the whole sheet.
    width: usize,
}

/// Number of characters in the longest name.
fn max_letters<'a>(names: impl Iterator<Item = &'a String>) -> usize {
    names.map(|name| name.chars().count()).max().unwrap_or(0)
}

impl StorySizes {
    fn new(story: &Story) -> Self {
        let left = max_letters(story.rows.iter().map(|row| &row.name)).max(4);
        let right = max_letters(story.lines.iter().map(|line| &line.name));
        let margins = [left, right].map(|letters| letters * letter_width() + 2 * GAP);
        let columns = story.levels.len().max(1);
        let free = WIDTH.saturating_sub(margins[0] + margins[1] + columns * GAP);
        let width = (free / columns).clamp(CELL / 4, CELL);
        let first_cell = story.rows.iter().find_map(|row| row.cells.iter().flatten().next());
        let [height, marks] = first_cell.map_or([width, 0], |cell| {
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

    /// Left edge of a column of images.
    fn left(&self, column: usize) -> usize {
        self.margins[0] + column * (self.cell[1] + GAP)
    }
}

fn draw_cell(sheet: &mut SheetCanvas, layout: &StorySizes, [top, left]: [usize; 2], cell: &StoryCell) {
    sheet.fill([top, left], layout.cell, |row, column| mean_colour(&cell.image, layout.cell, row, column));
    for (index, (model, mark)) in cell.marks.iter().enumerate() {
        let top = top + layout.cell[0] + index * LINE;
        let (paths, colour) = mark.paths();
        for path in paths {
            let path: Vec<[f64; 2]> = path.iter().map(|[x, y]| [left as f64 + x, top as f64 + y]).collect();
            sheet.path(&path, None, 2.5, colour);
        }
        sheet.write([top, left + 20], layout.cell[1].saturating_sub(20), model, INK);
    }
}

/// Draws the curves below the images. Each level is at the middle of its column.
fn draw_curves(sheet: &mut SheetCanvas, layout: &StorySizes, top: usize, story: &Story) {
    let ends = [layout.margins[0], layout.width - layout.margins[1]].map(|x| x as f64);
    let y = |share: f64| (top + LINE / 2) as f64 + (AXES as f64) * (1.0 - share.clamp(0.0, 1.0));
    for step in 0..=5 {
        let y = y(f64::from(step) / 5.0);
        sheet.path(&[[ends[0], y], [ends[1], y]], None, 1.0, GRID);
        let label = format!("{:>3}", step * 20);
        let left = layout.margins[0].saturating_sub(3 * letter_width() + GAP);
        sheet.write([y as usize - LINE / 2, left], layout.margins[0], &label, INK);
    }
    let mut labels = Vec::new();
    for line in &story.lines {
        let colour = line.style.rgb();
        let end_y = match &line.content {
            LineContent::Flat(share) => {
                let y = y(*share);
                sheet.path(&[[ends[0], y], [ends[1], y]], Some([6.0, 4.0]), 1.5, colour);
                y
            }
            LineContent::Curve(points) => {
                let points: Vec<(f64, &Estimate)> = points
                    .iter()
                    .filter_map(|(level, share)| {
                        let column = story.levels.iter().position(|other| other == level)?;
                        let x = (layout.left(column) + layout.cell[1] / 2) as f64;
                        Some((x, share))
                    })
                    .collect();
                let band: Vec<[f64; 3]> = points.iter().map(|(x, share)| [*x, y(share.high), y(share.low)]).collect();
                sheet.band(&band, colour, 0.14);
                let path: Vec<[f64; 2]> = points.iter().map(|(x, share)| [*x, y(share.value)]).collect();
                sheet.path(&path, dashes(line.style), 3.0, colour);
                for point in &path {
                    sheet.line([*point, *point], 9.0, colour);
                }
                path.last().map_or_else(|| y(0.0), |point| point[1])
            }
            // Photographs in the dark have no column.
            _ => continue,
        };
        labels.push((end_y, &line.name, colour));
    }
    write_labels(sheet, layout, labels);
}

/// Lengths of dash and gap in pixels; `None` is a solid line.
const DASHES: [Option<[f64; 2]>; 4] = [None, Some([9.0, 5.0]), Some([2.0, 4.0]), Some([14.0, 4.0])];

fn dashes(LineStyle(number): LineStyle) -> Option<[f64; 2]> {
    DASHES[(number + number / COLOURS.len()) % DASHES.len()]
}

/// Writes the name of each line right of its end. Labels are vertical position, name and colour; they are moved down if
/// they would overlap.
fn write_labels(sheet: &mut SheetCanvas, layout: &StorySizes, mut labels: Vec<(f64, &String, [u8; 3])>) {
    labels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut next_free = 0;
    for (y, name, colour) in labels {
        let top = (y as usize).saturating_sub(LINE / 2).max(next_free);
        next_free = top + LINE;
        let left = layout.width - layout.margins[1] + GAP;
        sheet.write([top, left], layout.margins[1], name, colour);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::Severity;
    use darkqa_base::types::degradations::Kind;

    fn level(severity: Severity) -> AxisLevel {
        AxisLevel::new(Kind::ALL[0], severity)
    }

    /// Story of two rows whose images are grey (code 90), height × width pixels.
    fn story_of_grey_images([height, width]: [usize; 2], levels: &[AxisLevel]) -> Story {
        let rows = [("noise", StoryMark::Wrong), ("+ lift", StoryMark::Right)];
        let rows = rows.map(|(name, mark)| {
            let cell = StoryCell {
                image: Rgb::new(height, width, vec![90; height * width * 3]).unwrap(),
                marks: vec![("observer".to_owned(), mark)],
            };
            StoryRow { name: name.to_owned(), cells: vec![Some(cell); levels.len()] }
        });
        let curve = levels
            .iter()
            .enumerate()
            .map(|(index, level)| {
                let value = 0.9 - index as f64 / 10.0;
                let share = Estimate { value, low: value - 0.1, high: value + 0.1, n: 9 };
                (*level, share)
            })
            .collect();
        Story {
            question: vec!["Is there a bed in the image?".to_owned()],
            levels: levels.to_vec(),
            rows: rows.to_vec(),
            lines: vec![
                PlotLine {
                    name: "observer".to_owned(),
                    style: LineStyle(0),
                    content: LineContent::Curve(curve),
                    model: None,
                    items: None,
                },
                PlotLine {
                    name: "chance".to_owned(),
                    style: LineStyle(1),
                    content: LineContent::Flat(0.3),
                    model: None,
                    items: None,
                },
            ],
            note: "n = 9".to_owned(),
        }
    }

    fn count_pixels(image: &Rgb, colour: [u8; 3]) -> usize {
        image.samples().chunks(3).filter(|pixel| **pixel == colour).count()
    }

    #[test]
    fn images_marks_and_curves_are_drawn() {
        let levels = [AxisLevel::L0, level(Severity::L3), level(Severity::L5)];
        let sheet = story(&story_of_grey_images([60, 80], &levels));
        assert!(count_pixels(&sheet, [90; 3]) > 6 * 60 * 80);
        assert!(count_pixels(&sheet, GREEN) > 30 && count_pixels(&sheet, RED) > 30);
        let curve = count_pixels(&sheet, LineStyle(0).rgb());
        let mut without_curve = story_of_grey_images([60, 80], &levels);
        without_curve.lines.remove(0);
        let without_curve = story(&without_curve);
        assert!(curve > 1000 && count_pixels(&without_curve, LineStyle(0).rgb()) == 0);
    }

    #[test]
    fn every_image_size_can_be_drawn() {
        let all: Vec<AxisLevel> = std::iter::once(AxisLevel::L0).chain(Severity::LADDER.map(level)).collect();
        for size in [[1, 1], [3, 500], [500, 3], [720, 1280]] {
            for levels in [&all[..1], &all] {
                let sheet = story(&story_of_grey_images(size, levels));
                assert!(sheet.width() <= WIDTH + CELL);
            }
        }
    }
}
