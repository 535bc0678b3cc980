//! Figures that arrange images with labels: [`levels()`], `noise()`, `crops()`, [`story()`] and `contact()`.
//!
//! Figure of the noise terms, one image for each: [`noise()`].
//!
//! Sheet of crops from the middle of images, side by side: [`crops`].
//!
//! Contact sheet: images in rows and columns, with a label above each column ([`contact`]).

mod levels;
mod story;

use std::ops::Range;

use ndarray::Array2;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use darkqa_base::types::Rgb;

pub use levels::{LevelBlock, LevelImage, LevelRow, levels};
pub use story::{Story, StoryCell, StoryMark, StoryRow, story};

/// Version of the drawing code. Raise it when any pixel of a figure of levels or noise changes for the same images.
pub const VERSION: u32 = 1;

/// Height of a line of text in pixels.
const LINE: usize = RasterHeight::Size20.val();

/// Space around images and labels in pixels.
const GAP: usize = 8;

/// Maximum width of an image on a sheet in pixels.
const CELL: usize = 360;

/// Image that starts white, on which images and text are drawn. Positions are row and column, in pixels.
struct SheetCanvas {
    height: usize,
    width: usize,
    samples: Vec<u8>,
}

impl SheetCanvas {
    fn new(height: usize, width: usize) -> Self {
        Self { height, width, samples: vec![255; height * width * 3] }
    }

    /// Sets a pixel; pixels outside the sheet are ignored.
    fn set(&mut self, row: usize, column: usize, colour: [u8; 3]) {
        if row < self.height && column < self.width {
            let index = (row * self.width + column) * 3;
            self.samples[index..index + 3].copy_from_slice(&colour);
        }
    }

    fn pixel(&self, row: usize, column: usize) -> [u8; 3] {
        let index = (row * self.width + column) * 3;
        [0, 1, 2].map(|channel| self.samples[index + channel])
    }

    /// Fills a rectangle. `colour` is called with the row and column within the rectangle.
    fn fill(&mut self, [top, left]: [usize; 2], [height, width]: [usize; 2], colour: impl Fn(usize, usize) -> [u8; 3]) {
        for row in 0..height {
            for column in 0..width {
                self.set(top + row, left + column, colour(row, column));
            }
        }
    }

    /// Writes a line of text, cut off at `width` pixels.
    fn write(&mut self, [top, left]: [usize; 2], width: usize, text: &str, ink: [u8; 3]) {
        let step = letter_width();
        for (index, letter) in text.chars().take(width / step).enumerate() {
            // A character that the font lacks stays blank.
            let Some(glyph) = get_raster(letter, FontWeight::Regular, RasterHeight::Size20) else {
                continue;
            };
            for (y, line) in glyph.raster().iter().enumerate() {
                for (x, weight) in line.iter().enumerate() {
                    let (row, column) = (top + y, left + index * step + x);
                    if *weight > 0 && row < self.height && column < self.width {
                        let below = self.pixel(row, column);
                        let weight = u32::from(*weight);
                        let mixed = [0, 1, 2].map(|channel| {
                            let (ink, below) = (u32::from(ink[channel]), below[channel]);
                            let sum = ink * weight + u32::from(below) * (255 - weight);
                            ((sum + 127) / 255) as u8
                        });
                        self.set(row, column, mixed);
                    }
                }
            }
        }
    }

    fn finish(self) -> Rgb {
        let mut sheet = Rgb::black(self.height, self.width);
        sheet.samples_mut().copy_from_slice(&self.samples);
        sheet
    }
}

/// Breaks a text between words into lines of at most `width` pixels. A single longer word keeps its length.
fn lines(text: &str, width: usize) -> Vec<String> {
    let letters = width / letter_width();
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= letters => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

fn letter_width() -> usize {
    get_raster_width(FontWeight::Regular, RasterHeight::Size20)
}

/// Height and width of an image on a sheet. Wider images are scaled down to a width of [`CELL`].
fn fitted_size(image: &Rgb) -> [usize; 2] {
    fit_to_cell(image.height(), image.width())
}

fn fit_to_cell(height: usize, width: usize) -> [usize; 2] {
    if width <= CELL {
        return [height, width];
    }
    [(height * CELL / width).max(1), CELL]
}

/// Colour of a pixel if an image is scaled down to a height and width: the mean of the pixels that it covers.
fn mean_colour(image: &Rgb, [height, width]: [usize; 2], row: usize, column: usize) -> [u8; 3] {
    let mut sums = [0_u64; 3];
    let mut n = 0;
    for y in covered_pixels(row, height, image.height()) {
        for x in covered_pixels(column, width, image.width()) {
            let index = (y * image.width() + x) * 3;
            for (sum, code) in sums.iter_mut().zip(&image.samples()[index..index + 3]) {
                *sum += u64::from(*code);
            }
            n += 1;
        }
    }
    sums.map(|sum| ((sum + n / 2) / n) as u8)
}

/// Rows or columns of the original that one row or column covers if a side is scaled from `original` to `scaled`
/// pixels; at least one.
fn covered_pixels(index: usize, scaled: usize, original: usize) -> Range<usize> {
    let begin = index * original / scaled;
    begin..((index + 1) * original / scaled).max(begin + 1)
}

/// Noise term on the sensor.
#[derive(Debug, Clone)]
pub struct Signal {
    /// Label of the image.
    pub name: String,
    /// Values in ADU, height × width.
    pub adu: Array2<f32>,
}

/// Draws the middle of each signal at full resolution, with the mean and standard deviation of the whole signal.
///
/// Each signal has its own grey scale: black is three standard deviations below its mean and white three above, written
/// in ADU above the image. `foot` is written below all images.
#[must_use]
pub fn noise(signals: &[Signal], foot: &str) -> Rgb {
    const COLUMNS: usize = 3;
    let (height, width) = signals
        .iter()
        .map(|signal| signal.adu.dim())
        .reduce(|least, size| (least.0.min(size.0), least.1.min(size.1)))
        .unwrap_or((1, 1));
    let (height, width) = (height.min(CELL * 3 / 4), width.min(CELL));
    let step = [GAP + 3 * LINE + height, GAP + CELL];
    let below = signals.len().div_ceil(COLUMNS) * step[0] + GAP;
    let sheet_width = COLUMNS * step[1] + GAP;
    let foot = lines(foot, sheet_width.saturating_sub(2 * GAP));
    let mut sheet = SheetCanvas::new(below + foot.len() * LINE + GAP, sheet_width);
    for (index, signal) in signals.iter().enumerate() {
        let top = GAP + index / COLUMNS * step[0];
        let left = GAP + index % COLUMNS * step[1];
        let [mean, deviation] = moments(&signal.adu);
        sheet.write([top, left], CELL, &signal.name, [0; 3]);
        let numbers = format!("mean {mean:.3}, std {deviation:.3} ADU");
        sheet.write([top + LINE, left], CELL, &numbers, [0; 3]);
        let reach = 3.0 * deviation;
        let ends = format!("black {:.3}, white {:.3} ADU", mean - reach, mean + reach);
        sheet.write([top + 2 * LINE, left], CELL, &ends, [90; 3]);
        let first = [(signal.adu.nrows() - height) / 2, (signal.adu.ncols() - width) / 2];
        let scale = if deviation > 0.0 { 127.5 / reach } else { 0.0 };
        sheet.fill([top + 3 * LINE, left], [height, width], |row, column| {
            let value = f64::from(signal.adu[[first[0] + row, first[1] + column]]);
            [(127.5 + (value - mean) * scale).round().clamp(0.0, 255.0) as u8; 3]
        });
    }
    for (line, text) in foot.iter().enumerate() {
        sheet.write([below + line * LINE, GAP], sheet_width, text, [90; 3]);
    }
    sheet.finish()
}

/// Mean and standard deviation of a signal, in ADU.
fn moments(adu: &Array2<f32>) -> [f64; 2] {
    let n = adu.len().max(1) as f64;
    let mean = adu.iter().map(|x| f64::from(*x)).sum::<f64>() / n;
    let variance = adu.iter().map(|x| (f64::from(*x) - mean).powi(2)).sum::<f64>() / n;
    [mean, variance.sqrt()]
}

/// Row of crops. All its images have the same size.
#[derive(Debug, Clone)]
pub struct CropRow<'a> {
    /// Label of the row.
    pub name: String,
    /// One image for each column.
    pub images: Vec<&'a Rgb>,
    /// Factor by which the images are brightened in linear light.
    pub gain: f64,
}

/// Draws the middle of each image at full resolution, brightened by the gain of its row, below the column names.
#[must_use]
pub fn crops(columns: &[&str], rows: &[CropRow<'_>]) -> Rgb {
    let height = CELL * 2 / 3;
    let step = [LINE + height + GAP, CELL + GAP];
    let mut sheet = SheetCanvas::new(GAP + LINE + rows.len() * step[0], GAP + columns.len().max(1) * step[1]);
    for (index, name) in columns.iter().enumerate() {
        sheet.write([GAP, GAP + index * step[1]], CELL, name, [0; 3]);
    }
    for (index, row) in rows.iter().enumerate() {
        let top = GAP + LINE + index * step[0];
        let label = format!("{}, light × {:.1}", row.name, row.gain);
        sheet.write([top, GAP], sheet.width - GAP, &label, [90; 3]);
        // Codes are gamma-encoded.
        let scale = libm::pow(row.gain.max(0.0), 1.0 / 2.2);
        for (column, image) in row.images.iter().enumerate() {
            let size = [image.height().min(height), image.width().min(CELL)];
            let first = [(image.height() - size[0]) / 2, (image.width() - size[1]) / 2];
            let corner = [top + LINE, GAP + column * step[1]];
            sheet.fill(corner, size, |y, x| {
                let index = ((first[0] + y) * image.width() + first[1] + x) * 3;
                [0, 1, 2].map(|channel| {
                    let code = f64::from(image.samples()[index + channel]);
                    (code * scale).round().min(255.0) as u8
                })
            });
        }
    }
    sheet.finish()
}

/// Minimum width of a column in pixels, so that its label can be read.
const COLUMN: usize = 280;

/// Column of a contact sheet: label, and images from top to bottom.
#[derive(Debug)]
pub struct ContactColumn<'a> {
    pub label: String,
    pub images: Vec<&'a Rgb>,
}

/// Draws a contact sheet. Images wider than a cell are scaled down by averaging pixels.
#[must_use]
pub fn contact(columns: &[ContactColumn<'_>]) -> Rgb {
    let [height, width] = columns
        .iter()
        .flat_map(|column| &column.images)
        .map(|image| fitted_size(image))
        .fold([0, COLUMN], |[height, width], size| [height.max(size[0]), width.max(size[1])]);
    let rows = columns.iter().map(|column| column.images.len()).max();
    let labels: Vec<Vec<String>> = columns.iter().map(|column| lines(&column.label, width)).collect();
    let label_lines = labels.iter().map(Vec::len).max().unwrap_or(0);
    let head = 2 * GAP + label_lines * LINE;
    let mut sheet = SheetCanvas::new(head + rows.unwrap_or(0) * (height + GAP), GAP + columns.len() * (width + GAP));
    for (index, (column, label)) in columns.iter().zip(&labels).enumerate() {
        let left = GAP + index * (width + GAP);
        for (line, text) in label.iter().enumerate() {
            sheet.write([GAP + line * LINE, left], width, text, [0; 3]);
        }
        for (row, image) in column.images.iter().enumerate() {
            let (top, size) = (head + row * (height + GAP), fitted_size(image));
            sheet.fill([top, left], size, |y, x| mean_colour(image, size, y, x));
        }
    }
    sheet.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_cut_at_its_width() {
        let mut canvas = SheetCanvas::new(LINE, 100);
        canvas.write([0, 0], 50, "MMMMMMMMMMMM", [0, 0, 0]);
        let [has_text, has_text_beyond] = [0..50, 50..100]
            .map(|mut columns| columns.any(|column| (0..LINE).any(|row| canvas.pixel(row, column) != [255; 3])));
        assert!(has_text && !has_text_beyond);
    }

    #[test]
    fn scaling_down_averages_pixels() {
        let image = Rgb::new(2, 4, (0..24).collect()).unwrap();
        assert_eq!(mean_colour(&image, [1, 2], 0, 0), [8, 9, 10]);
        assert_eq!(mean_colour(&image, [2, 4], 1, 3), [21, 22, 23]);
    }

    #[test]
    fn images_are_never_wider_than_their_cell() {
        assert_eq!(fit_to_cell(720, 1280), [202, CELL]);
        assert_eq!(fit_to_cell(3, 5), [3, 5]);
        assert_eq!(fit_to_cell(1, 5000), [1, CELL]);
    }

    #[test]
    fn black_and_white_are_three_deviations_from_the_mean() {
        let adu = Array2::from_shape_fn((8, 8), |(row, _)| if row % 2 == 0 { 1.0 } else { 3.0 });
        let [mean, deviation] = moments(&adu);
        assert!((mean - 2.0).abs() < 1e-9 && (deviation - 1.0).abs() < 1e-9);
        let name = "row".to_owned();
        let sheet = noise(&[Signal { name, adu }], "");
        assert!(sheet.samples().contains(&85) && sheet.samples().contains(&170));
    }

    #[test]
    fn flat_and_tiny_signals_are_grey() {
        let signals = [(1, 1), (500, 2), (2, 500), (9, 9)].map(|size| Signal {
            name: "a name that is longer than its place on the sheet is".to_owned(),
            adu: Array2::zeros(size),
        });
        let sheet = noise(&signals, "sony-a7s2, seed 0");
        assert!(sheet.samples().contains(&128));
        assert_eq!(noise(&[], "").width(), 3 * (GAP + CELL) + GAP);
    }

    #[test]
    fn crops_are_brightened() {
        let image = Rgb::new(3, 500, vec![10; 4500]).unwrap();
        let rows = [CropRow { name: "a".to_owned(), images: vec![&image, &image], gain: 4.0 }];
        let sheet = crops(&["real", "made"], &rows);
        let brightened = sheet.samples().chunks(3).filter(|pixel| **pixel == [19; 3]).count();
        assert!(brightened >= 2 * 3 * CELL);
        assert!(crops(&[], &[]).width() > 0);
    }

    fn column<'a>(label: &str, images: Vec<&'a Rgb>) -> ContactColumn<'a> {
        ContactColumn { label: label.to_owned(), images }
    }

    /// Red code of a pixel.
    fn red(sheet: &Rgb, row: usize, column: usize) -> u8 {
        sheet.samples()[(row * sheet.width() + column) * 3]
    }

    #[test]
    fn images_are_in_their_rows_and_columns() {
        let [one, two, three] = [50, 100, 150].map(|code| Rgb::new(10, 20, vec![code; 600]).unwrap());
        let sheet = contact(&[column("a", vec![&one, &two]), column("b", vec![&three])]);
        let top = 2 * GAP + LINE;
        assert_eq!(red(&sheet, top, GAP), 50);
        assert_eq!(red(&sheet, top + 10 + GAP, GAP), 100);
        assert_eq!(red(&sheet, top, 2 * GAP + COLUMN), 150);
        assert_eq!(red(&sheet, top + 10 + GAP, 2 * GAP + COLUMN), 255);
        // A long label takes a second line.
        let label = "a label of many words that one line of a column cannot hold";
        let taller = contact(&[column(label, vec![&one])]);
        assert_eq!(red(&taller, top + LINE, GAP), 50);
    }
}
