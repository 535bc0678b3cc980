//! Figure of example images, each variant by level, as in the DarkQA paper: [`levels()`].
//!
//! Anti-aliased lines and bands on a sheet. Points are `[x, y]` in pixels, from the upper left corner.

use std::collections::BTreeSet;
use std::ops::Range;

use super::{CELL, GAP, LINE, SheetCanvas, fitted_size, letter_width, lines, mean_colour};
use darkqa_base::types::degradations::Axis;
use darkqa_base::types::{AxisLevel, Rgb};

/// Images of a frame at the levels of one axis.
#[derive(Debug, Clone)]
pub struct LevelBlock {
    /// Levels from left to right, without L0.
    pub levels: Vec<AxisLevel>,
    pub rows: Vec<LevelRow>,
}

/// Images of one kind of degradation with one noise profile.
#[derive(Debug, Clone)]
pub struct LevelRow {
    pub name: String,
    /// One image for each level of the block.
    pub images: Vec<LevelImage>,
}

/// Image at a level.
#[derive(Debug, Clone)]
pub struct LevelImage {
    pub image: Rgb,
    /// Difference in brightness to the clean frame, in EV; it selects the gain of the inset.
    pub dark_ev: f64,
}

/// Minimum number of characters for which the column of names has space; the paper's names fit.
const MIN_NAME_LETTERS: usize = 6;

/// Draws the frame and its levels, with one row for each kind of degradation, like Fig. 3 of the DarkQA paper. `foot`
/// is written below.
///
/// Images are scaled down by averaging pixels. As in the paper, the lower right corner of L3, L4 and L5 has an inset:
/// the middle of the image (half of each side, a quarter of the area), brightened by a factor of 10, 20 or 50. Pixels
/// of insets are picked, not averaged, so that the noise keeps its strength. The paper writes "pixel intensities
/// amplified". Multiplying the codes would make a bright room white, so we brighten linear light, and state that below
/// the images.
#[must_use]
pub fn levels(clean: &Rgb, blocks: &[LevelBlock], foot: &str) -> Rgb {
    let size = fitted_size(clean);
    let [height, width] = size;
    let letters = blocks.iter().flat_map(|block| &block.rows).map(|row| row.name.chars().count()).max();
    // A gap on both sides of a long name.
    let longest = letters.unwrap_or_default() * letter_width() + 2 * GAP;
    let margin = longest.max(MIN_NAME_LETTERS * letter_width() + GAP);
    // A label needs its width even if the image is small.
    let cell = width.max(CELL / 2);
    let columns = blocks.iter().map(|block| block.levels.len()).max();
    let row_height = GAP + height.max(LINE);
    let blocks_height: usize = blocks.iter().map(|block| GAP + LINE + block.rows.len() * row_height).sum();
    let sheet_width = margin + (columns.unwrap_or_default() + 1) * (cell + GAP);
    let foot: Vec<String> = [foot.to_owned(), insets_note(blocks)]
        .iter()
        .flat_map(|text| lines(text, sheet_width.saturating_sub(2 * GAP)))
        .collect();
    let below = blocks_height + GAP;
    let foot_height = match foot.len() {
        0 => 0,
        number => number * LINE + GAP,
    };
    let mut sheet = SheetCanvas::new(below + foot_height, sheet_width);
    let left = |column: usize| margin + column * (cell + GAP);
    let mut top = GAP;
    for block in blocks {
        sheet.write([top, left(0)], cell, "L0", [0; 3]);
        for (index, level) in block.levels.iter().enumerate() {
            sheet.write([top, left(index + 1)], cell, &level_label(*level), [0; 3]);
        }
        top += LINE + GAP;
        for row in &block.rows {
            let middle = top + height.saturating_sub(LINE) / 2;
            sheet.write([middle, GAP], margin, &row.name, [0; 3]);
            sheet.fill([top, left(0)], size, |y, x| mean_colour(clean, size, y, x));
            for (index, LevelImage { image, dark_ev }) in row.images.iter().enumerate() {
                let corner = [top, left(index + 1)];
                sheet.fill(corner, size, |y, x| mean_colour(image, size, y, x));
                if let Some(gain) = inset_gain(*dark_ev) {
                    draw_inset(&mut sheet, corner, size, image, gain);
                }
            }
            top += row_height;
        }
    }
    for (line, text) in foot.iter().enumerate() {
        sheet.write([below + line * LINE, GAP], sheet_width, text, [90; 3]);
    }
    sheet.finish()
}

/// Note on the gains of the insets; empty without insets.
fn insets_note(blocks: &[LevelBlock]) -> String {
    let gains: BTreeSet<u16> = blocks
        .iter()
        .flat_map(|block| &block.rows)
        .flat_map(|row| &row.images)
        .filter_map(|image| inset_gain(image.dark_ev))
        .collect();
    if gains.is_empty() {
        return String::new();
    }
    let gains: Vec<String> = gains.iter().map(|factor| format!("×{factor}")).collect();
    format!("Insets: the middle of the image, linear light {}", gains.join(", "))
}

/// Label of a level's column, as in `L3 -6 EV` or `T33.33 ms`.
pub(super) fn level_label(level: AxisLevel) -> String {
    let axis = level.axis().unwrap_or(Axis::LIGHT);
    if axis == Axis::LIGHT {
        format!("{level} -{} {}", level.value(), axis.unit)
    } else {
        format!("{level} {}", axis.unit)
    }
}

/// Factor by which an inset is brightened in linear light; `None` below 5 EV, where the image itself is visible.
fn inset_gain(dark_ev: f64) -> Option<u16> {
    match dark_ev {
        ..5.0 => None,
        5.0..7.0 => Some(10),
        7.0..8.5 => Some(20),
        _ => Some(50),
    }
}

/// Draws the brightened middle of an image in the lower right corner of a cell, with a white edge and its gain.
fn draw_inset(sheet: &mut SheetCanvas, [top, left]: [usize; 2], size: [usize; 2], image: &Rgb, gain: u16) {
    let [height, width] = size.map(|side| side / 2);
    if height < 4 || width < 4 {
        return;
    }
    let (top, left) = (top + size[0] - height, left + size[1] - width);
    sheet.fill([top - 1, left - 1], [height + 1, width + 1], |_, _| [255; 3]);
    let brightened = brightened_codes(gain);
    sheet.fill([top, left], [height, width], |row, column| {
        let y = inset_source(row, height, image.height());
        let x = inset_source(column, width, image.width());
        let index = (y * image.width() + x) * 3;
        [0, 1, 2].map(|channel| brightened[usize::from(image.samples()[index + channel])])
    });
    let label = format!("×{gain}");
    let label_width = label.chars().count() * letter_width();
    if height > LINE && width > label_width {
        sheet.fill([top, left], [LINE, label_width + 2], |_, _| [0; 3]);
        sheet.write([top, left + 1], label_width, &label, [255; 3]);
    }
}

/// Row or column of an image that an inset's row or column is taken from. `inset_side` and `image_side` are lengths in
/// pixels; the inset has the middle half of each side.
fn inset_source(index: usize, inset_side: usize, image_side: usize) -> usize {
    image_side / 4 + index * (image_side / 2) / inset_side
}

/// Lookup table of brightened codes: a gain in linear light multiplies a gamma-encoded code by gain^(1/2.2).
fn brightened_codes(gain: u16) -> [u8; 256] {
    let scale = libm::pow(f64::from(gain), 1.0 / 2.2);
    std::array::from_fn(|code| (code as f64 * scale).round().min(255.0) as u8)
}

impl SheetCanvas {
    /// Blends a colour into a pixel with an opacity from 0 to 1; pixels outside the sheet are ignored.
    fn blend(&mut self, row: usize, column: usize, colour: [u8; 3], opacity: f64) {
        if row >= self.height || column >= self.width {
            return;
        }
        let below = self.pixel(row, column);
        let blended = [0, 1, 2].map(|channel| {
            let (above, below) = (f64::from(colour[channel]), f64::from(below[channel]));
            (below + (above - below) * opacity).round() as u8
        });
        self.set(row, column, blended);
    }

    /// Draws a straight line. The opacity of a pixel falls with the distance of its centre from the line, which smooths
    /// the edges.
    pub(super) fn line(&mut self, ends: [[f64; 2]; 2], width: f64, colour: [u8; 3]) {
        let [from, to] = ends;
        let reach = width / 2.0 + 1.0;
        let along = [to[0] - from[0], to[1] - from[1]];
        let squared_length = (along[0] * along[0] + along[1] * along[1]).max(1e-9);
        for row in pixel_range(from[1], to[1], reach) {
            for column in pixel_range(from[0], to[0], reach) {
                let [x, y] = [column as f64 + 0.5, row as f64 + 0.5];
                let part = ((x - from[0]) * along[0] + (y - from[1]) * along[1]) / squared_length;
                let part = part.clamp(0.0, 1.0);
                let nearest = [from[0] + part * along[0], from[1] + part * along[1]];
                let distance = (x - nearest[0]).hypot(y - nearest[1]);
                self.blend(row, column, colour, (width / 2.0 + 0.5 - distance).clamp(0.0, 1.0));
            }
        }
    }

    /// Draws a line through points. `dash` is the length of dashes and gaps in pixels; `None` draws a solid line.
    pub(super) fn path(&mut self, points: &[[f64; 2]], dash: Option<[f64; 2]>, width: f64, colour: [u8; 3]) {
        let Some([drawn, gap]) = dash else {
            for ends in points.windows(2) {
                self.line([ends[0], ends[1]], width, colour);
            }
            return;
        };
        let mut path_length = 0.0;
        for ends in points.windows(2) {
            let along = [ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]];
            let length = along[0].hypot(along[1]);
            let at = |distance: f64| {
                let part = (distance / length.max(1e-9)).clamp(0.0, 1.0);
                [ends[0][0] + part * along[0], ends[0][1] + part * along[1]]
            };
            // Dashes continue around the corners of the path.
            let mut start = -(path_length % (drawn + gap));
            while start < length {
                if start + drawn > 0.0 {
                    self.line([at(start), at(start + drawn)], width, colour);
                }
                start += drawn + gap;
            }
            path_length += length;
        }
    }

    /// Tints the area between two lines. Points are `[x, upper y, lower y]` from left to right.
    pub(super) fn band(&mut self, points: &[[f64; 3]], colour: [u8; 3], opacity: f64) {
        for ends in points.windows(2) {
            let [from, to] = [ends[0], ends[1]];
            for column in from[0].round() as usize..to[0].round() as usize {
                let part = (column as f64 + 0.5 - from[0]) / (to[0] - from[0]).max(1e-9);
                let [upper, lower] = [1, 2].map(|i| (from[i] + part * (to[i] - from[i])).round() as usize);
                for row in upper..lower {
                    self.blend(row, column, colour, opacity);
                }
            }
        }
    }
}

/// Rows or columns that are at most `reach` pixels from the range between two coordinates.
fn pixel_range(a: f64, b: f64, reach: f64) -> Range<usize> {
    let (low, high) = (a.min(b), a.max(b));
    (low - reach).max(0.0) as usize..(high + reach).max(0.0) as usize + 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::Severity;
    use darkqa_base::types::degradations::Kind;

    fn grey(height: usize, width: usize, code: u8) -> Rgb {
        Rgb::new(height, width, vec![code; height * width * 3]).unwrap()
    }

    /// Sheet with two rows of grey images, codes 3 and 4, of a clean frame with code 100.
    fn sheet(height: usize, width: usize, severities: &[Severity]) -> Rgb {
        let rows = [3, 4].map(|code: u8| LevelRow {
            name: code.to_string(),
            images: severities
                .iter()
                .map(|severity| LevelImage { image: grey(height, width, code), dark_ev: severity.value() })
                .collect(),
        });
        let block = LevelBlock {
            levels: severities.iter().map(|severity| AxisLevel::new(Kind::Exposure, *severity)).collect(),
            rows: rows.to_vec(),
        };
        levels(&grey(height, width, 100), &[block], "paper: K 0.77")
    }

    /// Number of grey pixels of a code.
    fn count(samples: &[u8], code: u8) -> usize {
        samples.chunks(3).filter(|pixel| **pixel == [code; 3]).count()
    }

    #[test]
    fn insets_are_brightened_by_level() {
        let sheet = sheet(100, 300, &[Severity::L1, Severity::L5]);
        let samples = sheet.samples();
        // The clean frame is drawn twice; the inset covers a quarter of an image.
        assert!(count(samples, 100) >= 2 * 100 * 300);
        assert!(count(samples, 3) > 100 * 300 && count(samples, 3) < 2 * 100 * 300);
        assert!(count(samples, 18) > 4000 && count(samples, 24) > 4000);
    }

    fn block(kind: Kind, code: u8) -> LevelBlock {
        LevelBlock {
            levels: vec![AxisLevel::new(kind, kind.ladder()[2])],
            rows: vec![LevelRow {
                name: kind.word().to_owned(),
                images: vec![LevelImage { image: grey(50, 80, code), dark_ev: 0.0 }],
            }],
        }
    }

    #[test]
    fn blocks_are_below_each_other() {
        let both = levels(&grey(50, 80, 100), &[block(Kind::Auto, 7), block(Kind::Motion, 9)], "");
        let one = levels(&grey(50, 80, 100), &[block(Kind::Auto, 7)], "");
        assert_eq!(both.height() - GAP, 2 * (one.height() - GAP));
        let [auto_top, motion_top] =
            [7, 9].map(|code| both.samples().chunks(3 * both.width()).position(|row| count(row, code) == 80).unwrap());
        assert!(auto_top + 50 < motion_top);
    }

    #[test]
    fn labels_name_level_and_severity() {
        assert_eq!(level_label(AxisLevel::new(Kind::Motion, Severity::TIMES[2])), "T33.33 ms");
        assert_eq!(level_label(AxisLevel::new(Kind::Auto, Severity::L3)), "L3 -6 EV");
    }

    #[test]
    fn a_long_name_does_not_touch_the_image() {
        let block = LevelBlock {
            levels: vec![AxisLevel::new(Kind::Sensor, Severity::L5)],
            rows: vec![LevelRow {
                name: "noise@physical".to_owned(),
                images: vec![LevelImage { image: grey(60, 80, 3), dark_ev: 0.0 }],
            }],
        };
        let sheet = levels(&grey(60, 80, 100), &[block], "");
        let mut frame_rows = 0;
        for row in sheet.samples().chunks(3 * sheet.width()) {
            let frame_left = row.windows(3 * 80).step_by(3).position(|run| run.iter().all(|sample| *sample == 100));
            let Some(left) = frame_left else { continue };
            let gap = &row[3 * (left - GAP)..3 * left];
            assert!(gap.iter().all(|sample| *sample == 255));
            frame_rows += 1;
        }
        assert_eq!(frame_rows, 60);
    }

    #[test]
    fn every_size_has_a_sheet() {
        for (height, width) in [(1, 1), (3, 500), (500, 3), (7, 7), (720, 1280)] {
            for levels in [&[][..], &[Severity::L4], &Severity::LADDER] {
                let sheet = sheet(height, width, levels);
                assert!(sheet.width() <= 2400, "{}", sheet.width());
            }
        }
    }

    fn count_drawn_pixels(canvas: &SheetCanvas) -> usize {
        canvas.samples.chunks(3).filter(|pixel| **pixel != [255; 3]).count()
    }

    #[test]
    fn a_line_covers_its_length_and_width() {
        let mut canvas = SheetCanvas::new(20, 100);
        canvas.line([[10.0, 10.0], [90.0, 10.0]], 2.0, [0; 3]);
        assert_eq!(canvas.pixel(9, 50), [0; 3]);
        assert_eq!(canvas.pixel(10, 50), [0; 3]);
        assert_eq!(canvas.pixel(7, 50), [255; 3]);
        assert_eq!(canvas.pixel(10, 95), [255; 3]);
    }

    #[test]
    fn dashes_leave_gaps() {
        let points = [[0.0, 10.0], [50.0, 10.0], [100.0, 10.0]];
        let [solid, dashed] = [None, Some([6.0, 6.0])].map(|dash| {
            let mut canvas = SheetCanvas::new(20, 100);
            canvas.path(&points, dash, 2.0, [0; 3]);
            count_drawn_pixels(&canvas)
        });
        assert!(dashed > solid / 3 && dashed < solid * 4 / 5, "{dashed} of {solid}");
    }

    #[test]
    fn nothing_is_drawn_outside_the_sheet() {
        let mut canvas = SheetCanvas::new(8, 8);
        canvas.line([[-50.0, -50.0], [50.0, 50.0]], 3.0, [0; 3]);
        canvas.band(&[[0.0, 2.0, 90.0], [90.0, 2.0, 90.0]], [9; 3], 0.5);
        assert!(count_drawn_pixels(&canvas) > 0);
    }
}
