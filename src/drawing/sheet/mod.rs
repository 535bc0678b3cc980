//! Figures made of images with labels: [`levels()`], [`noise()`], [`crops()`], [`story()`] and [`contact()`].

mod contact;
mod crops;
mod levels;
mod noise;
mod story;
mod strokes;

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

pub(crate) use contact::{ContactColumn, contact};
pub(crate) use crops::{CropRow, crops};
pub(crate) use levels::{LevelBlock, LevelImage, LevelRow, levels};
pub(crate) use noise::{Signal, noise};
pub(crate) use story::{Story, StoryCell, StoryMark, StoryRow, story};

use crate::types::Rgb;

/// Version of the drawing, raised whenever a pixel of a figure of levels or of noise changes for the same images.
pub(crate) const VERSION: u32 = 1;

/// Height of a line of text in pixels.
const LINE: usize = RasterHeight::Size20.val();
/// Space around images and labels in pixels.
const GAP: usize = 8;
/// Maximum width of an image on a sheet in pixels.
const CELL: usize = 360;

/// A white image on which images and text are drawn.
struct SheetCanvas {
    height: usize,
    width: usize,
    samples: Vec<u8>,
}

impl SheetCanvas {
    fn new(height: usize, width: usize) -> Self {
        Self {
            height,
            width,
            samples: vec![255; height * width * 3],
        }
    }

    /// Sets a pixel; pixels outside the sheet are ignored.
    fn set(&mut self, row: usize, column: usize, colour: [u8; 3]) {
        if row < self.height && column < self.width {
            let at = (row * self.width + column) * 3;
            self.samples[at..at + 3].copy_from_slice(&colour);
        }
    }

    fn pixel(&self, row: usize, column: usize) -> [u8; 3] {
        let at = (row * self.width + column) * 3;
        [self.samples[at], self.samples[at + 1], self.samples[at + 2]]
    }

    /// Fills a rectangle at `[top, left]` with the colours of `colour`, by row and column.
    fn fill(
        &mut self,
        [top, left]: [usize; 2],
        [height, width]: [usize; 2],
        colour: impl Fn(usize, usize) -> [u8; 3],
    ) {
        for row in 0..height {
            for column in 0..width {
                self.set(top + row, left + column, colour(row, column));
            }
        }
    }

    /// Writes a line of text, cut to `width` pixels.
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
                        let mix = |i: usize| {
                            let (w, a, b) = (u32::from(*weight), ink[i], below[i]);
                            ((u32::from(a) * w + u32::from(b) * (255 - w) + 127) / 255) as u8
                        };
                        self.set(row, column, [mix(0), mix(1), mix(2)]);
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

/// A text in lines of a width in pixels, cut between words; none for an empty text.
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

/// Size of an image in a cell: height, width. Wider images are scaled down to a width of [`CELL`].
fn fitted(height: usize, width: usize) -> [usize; 2] {
    if width <= CELL {
        return [height, width];
    }
    [(height * CELL / width).max(1), CELL]
}

/// Mean colour of the pixels that one pixel of a smaller image covers.
fn mean(image: &Rgb, [height, width]: [usize; 2], row: usize, column: usize) -> [u8; 3] {
    let span = |at: usize, of: usize, from: usize| {
        let begin = at * from / of;
        begin..((at + 1) * from / of).max(begin + 1)
    };
    let mut sums = [0_u64; 3];
    let mut n = 0;
    for y in span(row, height, image.height()) {
        for x in span(column, width, image.width()) {
            let at = (y * image.width() + x) * 3;
            for (sum, code) in sums.iter_mut().zip(&image.samples()[at..at + 3]) {
                *sum += u64::from(*code);
            }
            n += 1;
        }
    }
    sums.map(|sum| ((sum + n / 2) / n) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_cut_at_its_width() {
        let mut canvas = SheetCanvas::new(LINE, 100);
        canvas.write([0, 0], 50, "MMMMMMMMMMMM", [0, 0, 0]);
        let inked = |from: usize| {
            (0..LINE).any(|row| (from..100).any(|column| canvas.pixel(row, column) != [255; 3]))
        };
        assert!(inked(0) && !inked(50));
    }

    #[test]
    fn a_smaller_image_holds_the_means() {
        let image = Rgb::new(2, 4, (0..24).collect()).unwrap();
        assert_eq!(mean(&image, [1, 2], 0, 0), [8, 9, 10]);
        assert_eq!(mean(&image, [2, 4], 1, 3), [21, 22, 23]);
    }

    #[test]
    fn images_are_never_wider_than_their_cell() {
        assert_eq!(fitted(720, 1280), [202, CELL]);
        assert_eq!(fitted(3, 5), [3, 5]);
        assert_eq!(fitted(1, 5000), [1, CELL]);
    }
}
