//! Untouched codes of each tile of a frame, [`Tiles`], and received codes at the same pixels, [`TileSums`].
//!
//! A tile is a cell of the coarsest scale. The channels are estimated from the sums over the pixels of each tile,
//! channel and untouched code, both for the whole frame and for any part of it.
//!
//! Resampling of an image to the size of its masks: [`area_mean`].

use std::borrow::Cow;
use std::ops::Range;

use darkqa_base::types::Rgb;

/// Number of codes of a channel.
pub(super) const CODES: usize = 256;

/// Minimum standard deviation of the untouched codes of a tile with contrast, in codes (chosen).
const MIN_CONTRAST: f64 = 4.0;

/// Sums over the pixels with the same untouched code, in one channel; `T` is an integer while pixels are added.
#[derive(Debug, Clone, Copy, Default)]
struct CodeSums<T> {
    /// Sum of the received codes.
    received: T,
    /// Sum of their squares.
    squares: T,
}

/// Tiles of a frame, row by row, with the number of pixels of each untouched code.
#[derive(Debug)]
pub(super) struct Tiles {
    /// Width of the frame, in pixels.
    width: usize,
    /// Side of a tile, in pixels.
    side: usize,
    /// Number of tiles in a row.
    pub(super) columns: usize,
    /// Start of each tile and channel in `codes`, and the end of the last.
    starts: Vec<usize>,
    /// Untouched codes that occur, in increasing order within a tile and channel.
    codes: Vec<u8>,
    /// Number of pixels of each of `codes`.
    counts: Vec<u32>,
    /// True for each tile whose untouched codes have contrast.
    contrasted: Vec<bool>,
}

/// Sums over the received codes, in the order of the codes of [`Tiles`].
#[derive(Debug)]
pub(super) struct TileSums(Vec<CodeSums<f64>>);

/// Pixels of one tile with the same untouched code in one channel.
#[derive(Debug, Clone, Copy)]
pub(super) struct SameCode {
    pub(super) code: usize,
    /// Number of pixels.
    pub(super) count: f64,
    /// Sum of the received codes.
    pub(super) received: f64,
    /// Sum of their squares.
    pub(super) squares: f64,
}

impl Tiles {
    /// Cuts an untouched image into tiles of `side` × `side` pixels; tiles at the right and lower edges may be smaller.
    pub(super) fn new(untouched: &Rgb, side: usize) -> Self {
        let width = untouched.width();
        let columns = width.div_ceil(side);
        let mut tiles = Self {
            width,
            side,
            columns,
            starts: vec![0],
            codes: Vec::new(),
            counts: Vec::new(),
            contrasted: Vec::new(),
        };
        let mut row_of_tiles = vec![[[0_u32; CODES]; 3]; columns];
        for rows in untouched.samples().chunks((side * width * 3).max(1)) {
            for row in rows.chunks(width * 3) {
                for (histogram, pixels) in row_of_tiles.iter_mut().zip(row.chunks(side * 3)) {
                    for pixel in pixels.as_chunks::<3>().0 {
                        for (counts, code) in histogram.iter_mut().zip(pixel) {
                            counts[usize::from(*code)] += 1;
                        }
                    }
                }
            }
            for histogram in &mut row_of_tiles {
                let variance: f64 = histogram.iter().map(variance).sum();
                let has_contrast = variance >= 3.0 * MIN_CONTRAST * MIN_CONTRAST;
                tiles.contrasted.push(has_contrast);
                for counts in histogram {
                    for (code, count) in (0..=u8::MAX).zip(&mut *counts) {
                        if *count > 0 {
                            tiles.codes.push(code);
                            tiles.counts.push(*count);
                        }
                        *count = 0;
                    }
                    tiles.starts.push(tiles.codes.len());
                }
            }
        }
        tiles
    }

    /// Number of tiles.
    pub(super) fn len(&self) -> usize {
        self.contrasted.len()
    }

    /// True if the untouched codes of a tile have contrast.
    pub(super) fn has_contrast(&self, tile: usize) -> bool {
        self.contrasted[tile]
    }

    /// Column and row of a tile.
    pub(super) fn column_and_row(&self, tile: usize) -> [f64; 2] {
        [(tile % self.columns) as f64, (tile / self.columns) as f64]
    }

    /// Sums the received codes of an image of the same size.
    pub(super) fn sums(&self, untouched: &[u8], received: &[u8]) -> TileSums {
        let mut sums = Vec::with_capacity(self.codes.len());
        let mut row_of_tiles = vec![[[CodeSums::<u64>::default(); CODES]; 3]; self.columns];
        let (row, band) = (self.width * 3, (self.side * self.width * 3).max(1));
        let bands = untouched.chunks(band).zip(received.chunks(band));
        for (first, (untouched, received)) in (0..).step_by(self.columns.max(1)).zip(bands) {
            for (untouched, received) in untouched.chunks(row).zip(received.chunks(row)) {
                let pieces = untouched.chunks(self.side * 3).zip(received.chunks(self.side * 3));
                for (sums, (untouched, received)) in row_of_tiles.iter_mut().zip(pieces) {
                    add(sums, untouched, received);
                }
            }
            for (tile, table) in row_of_tiles.iter_mut().enumerate() {
                for (channel, table) in table.iter_mut().enumerate() {
                    let codes = &self.codes[self.range(first + tile, channel)];
                    sums.extend(codes.iter().map(|code| {
                        let sums = std::mem::take(&mut table[usize::from(*code)]);
                        CodeSums { received: sums.received as f64, squares: sums.squares as f64 }
                    }));
                }
            }
        }
        TileSums(sums)
    }

    /// Pixels of a channel of a tile, by their untouched code.
    pub(super) fn by_code<'a>(
        &'a self,
        sums: &'a TileSums,
        tile: usize,
        channel: usize,
    ) -> impl Iterator<Item = SameCode> {
        let range = self.range(tile, channel);
        self.codes[range.clone()].iter().zip(&self.counts[range.clone()]).zip(&sums.0[range]).map(
            |((code, count), sums)| SameCode {
                code: usize::from(*code),
                count: f64::from(*count),
                received: sums.received,
                squares: sums.squares,
            },
        )
    }

    fn range(&self, tile: usize, channel: usize) -> Range<usize> {
        self.starts[3 * tile + channel]..self.starts[3 * tile + channel + 1]
    }
}

/// Variance of the codes in a histogram; 0 for an empty one.
fn variance(counts: &[u32; CODES]) -> f64 {
    let [n, sum, squares] = counts.iter().zip(0_u32..).fold([0.0; 3], |[n, sum, squares], (count, code)| {
        let (count, code) = (f64::from(*count), f64::from(code));
        [n + count, sum + count * code, squares + count * code * code]
    });
    let n: f64 = f64::max(n, 1.0);
    squares / n - sum / n * (sum / n)
}

/// Adds the pixels of a part of a row to the sums of a tile.
fn add(sums: &mut [[CodeSums<u64>; CODES]; 3], untouched: &[u8], received: &[u8]) {
    let (untouched, _) = untouched.as_chunks::<3>();
    let (received, _) = received.as_chunks::<3>();
    for (untouched, received) in untouched.iter().zip(received) {
        for ((sums, code), received) in sums.iter_mut().zip(untouched).zip(received) {
            let received = u64::from(*received);
            let sum = &mut sums[usize::from(*code)];
            sum.received += received;
            sum.squares += received * received;
        }
    }
}

/// Resamples an image to a width and height. Each pixel is the mean of the area that it covers, rounded half up.
#[must_use]
pub fn area_mean(image: &Rgb, [width, height]: [usize; 2]) -> Cow<'_, Rgb> {
    if [image.width(), image.height()] == [width, height] {
        return Cow::Borrowed(image);
    }
    let (columns, rows) = (spans(image.width(), width), spans(image.height(), height));
    let whole = (image.width() * image.height()) as u64;
    let mut samples = Vec::with_capacity(width * height * 3);
    for row in &rows {
        for column in &columns {
            let mut sums = [0_u64; 3];
            for (y, weight_y) in row {
                for (x, weight_x) in column {
                    let pixel = &image.samples()[(y * image.width() + x) * 3..][..3];
                    for (sum, code) in sums.iter_mut().zip(pixel) {
                        *sum += weight_x * weight_y * u64::from(*code);
                    }
                }
            }
            samples.extend(sums.map(|sum| ((sum + whole / 2) / whole) as u8));
        }
    }
    Rgb::new(height, width, samples).map_or_else(|_| Cow::Owned(Rgb::black(height, width)), Cow::Owned)
}

/// For each of `to` equal parts of `from` pixels, returns the covered pixels with their overlaps, in units of 1 / `to`
/// pixel.
fn spans(from: usize, to: usize) -> Vec<Vec<(usize, u64)>> {
    (0..to)
        .map(|part: usize| {
            let (start, end) = (part * from, (part + 1) * from);
            let pixels = start / to..end.div_ceil(to);
            pixels
                .map(|pixel| {
                    let overlap = end.min((pixel + 1) * to) - start.max(pixel * to);
                    (pixel, overlap as u64)
                })
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixel_is_the_mean_of_its_area() {
        for (codes, width, size, expected) in [
            (vec![0, 30, 60], 3, [2, 1], vec![10, 50]),
            (vec![0, 30, 60], 3, [6, 1], vec![0, 0, 30, 30, 60, 60]),
            (vec![0, 10, 20, 31], 2, [1, 1], vec![15]),
            (vec![0, 10, 20, 30], 2, [2, 3], vec![0, 10, 10, 20, 20, 30]),
        ] {
            let samples = codes.iter().flat_map(|code| [*code; 3]).collect();
            let image = Rgb::new(codes.len() / width, width, samples).unwrap();
            let resized = area_mean(&image, size);
            let codes: Vec<u8> = resized.samples().iter().step_by(3).copied().collect();
            assert_eq!(codes, expected);
        }
    }
}
