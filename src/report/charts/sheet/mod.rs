//! Figures that arrange images with labels: [`levels()`], [`noise()`], [`crops()`], [`story()`] and [`contact()`].

mod contact;
mod crops;
mod levels;
mod noise;
mod story;
mod strokes;

use std::ops::Range;

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

pub(crate) use contact::{ContactColumn, contact};
pub(crate) use crops::{CropRow, crops};
pub(crate) use levels::{LevelBlock, LevelImage, LevelRow, levels};
pub(crate) use noise::{Signal, noise};
pub(crate) use story::{Story, StoryCell, StoryMark, StoryRow, story};

use crate::types::Rgb;

/// Version of the drawing code. Raise it when any pixel of a figure of levels or noise changes for the same images.
pub(crate) const VERSION: u32 = 1;

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
}
