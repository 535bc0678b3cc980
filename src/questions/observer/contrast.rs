//! Which masks of an image stand out of its noise: [`Look`].
//!
//! The image is cut into square cells. Where two masks meet in one, the means of their pixels there are compared: close to
//! the border between them, so that light which changes over the room plays no part. Over all cells of a border, the mean
//! difference is held against its own uncertainty. Rose's criterion says that a difference is seen where it is at least five
//! times that (Rose, "The sensitivity performance of the human eye on an absolute scale", J. Opt. Soc. Am. 38:196, 1948;
//! Burgess, "The Rose model, revisited", J. Opt. Soc. Am. A 16:633, 1999). A mask is visible where half of its outline is
//! seen, each border weighing as many cells as it has; the edge of the image is no outline.
//!
//! The uncertainty is the largest of three estimates, all taken from the image itself: how much the differences scatter from
//! cell to cell; how much pixels scatter within the cells, as many of which are worth one where a sensor's mosaic was filled
//! in; and the noise that rows share, from how unlike neighbouring rows of the whole image are.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use crate::questions::colors::{Color, Palette};
use crate::types::Rgb;

/// Rose's criterion: a difference is seen where it is so many times its uncertainty.
pub const ROSE: f64 = 5.0;

/// A cell has a side of this share of the image's shorter side.
const CELLS: usize = 60;

/// Pixels of which a mosaic was filled in from their neighbours are worth one: a quarter of the greens' and eighths of the
/// others' draws are their own.
const SHARED: f64 = 4.0;

/// Differences scatter so little by chance in fewer cells than this that their scatter says nothing.
const FEW: f64 = 5.0;

/// A median absolute deviation times this is a standard deviation, for normal noise.
const DEVIATION: f64 = 1.4826;

/// Linear light of each code in 65,535ths (IEC 61966-2-1).
static LINEAR: LazyLock<[u32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let value = code as f64 / 255.0;
        let linear = if value <= 0.04045 {
            value / 12.92
        } else {
            libm::pow((value + 0.055) / 1.055, 2.4)
        };
        (linear * 65_535.0 + 0.5) as u32
    })
});

/// The linear light of a code, in 65,535ths.
#[must_use]
pub fn linear(code: u8) -> u32 {
    LINEAR[usize::from(code)]
}

/// The mean linear light of an image, from 0 to 1 (luma weights of ITU-R BT.709).
pub(super) fn mean_light(image: &Rgb) -> f64 {
    let (pixels, _) = image.samples().as_chunks::<3>();
    let mut sums = [0_u64; 3];
    for pixel in pixels {
        for (sum, code) in sums.iter_mut().zip(pixel) {
            *sum += u64::from(LINEAR[usize::from(*code)]);
        }
    }
    let [red, green, blue] = sums.map(|sum| sum as f64 / 65_535.0 / pixels.len().max(1) as f64);
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

/// The pixels of one mask in one cell.
#[derive(Debug, Clone, Copy, Default)]
struct Patch {
    mask: u32,
    count: u32,
    sums: [u64; 3],
    squares: [u64; 3],
    linear: [u64; 3],
}

impl Patch {
    fn take(&mut self, pixel: [u8; 3]) {
        self.count += 1;
        for (channel, code) in pixel.into_iter().enumerate() {
            let value = u64::from(code);
            self.sums[channel] += value;
            self.squares[channel] += value * value;
            self.linear[channel] += u64::from(LINEAR[usize::from(code)]);
        }
    }

    fn mean(&self, channel: usize) -> f64 {
        self.sums[channel] as f64 / f64::from(self.count)
    }

    /// How uncertain its mean is, squared, by how its pixels scatter.
    fn uncertainty(&self, channel: usize) -> f64 {
        let (count, mean) = (f64::from(self.count), self.mean(channel));
        let scatter = (self.squares[channel] as f64 / count - mean * mean).max(0.0);
        scatter * SHARED / count
    }
}

/// What is known of the border between two masks.
#[derive(Debug, Clone, Copy, Default)]
struct Border {
    cells: f64,
    differences: [f64; 3],
    squares: [f64; 3],
    within: [f64; 3],
    /// Rows of cells that it runs through, and the last of them, from 1.
    rows: f64,
    last: usize,
}

impl Border {
    fn take(&mut self, row: usize, a: &Patch, b: &Patch) {
        self.cells += 1.0;
        if self.last != row + 1 {
            self.rows += 1.0;
            self.last = row + 1;
        }
        for channel in 0..3 {
            let difference = a.mean(channel) - b.mean(channel);
            self.differences[channel] += difference;
            self.squares[channel] += difference * difference;
            self.within[channel] += a.uncertainty(channel) + b.uncertainty(channel);
        }
    }

    /// The difference over its uncertainty, in the channel where that is largest.
    fn signal(&self, row_noise: f64, side: usize) -> f64 {
        // Each side averages the rows of its cells.
        let rows = 2.0 * row_noise * row_noise / (side as f64 * self.rows);
        let signals = (0..3).map(|channel| {
            let mean = self.differences[channel] / self.cells;
            let scatter = (self.squares[channel] / self.cells - mean * mean).max(0.0);
            let between = if self.cells < FEW {
                0.0
            } else {
                scatter / (self.cells - 1.0)
            };
            let within = self.within[channel] / (self.cells * self.cells);
            let uncertainty = between.max(within).max(rows).sqrt();
            if mean == 0.0 {
                0.0
            } else {
                mean.abs() / uncertainty
            }
        });
        signals.fold(0.0, f64::max)
    }
}

/// What is seen of the masks of an image.
#[derive(Debug)]
pub struct Look {
    borders: BTreeMap<(u32, u32), Border>,
    colors: BTreeMap<u32, [u64; Color::ALL.len()]>,
    row_noise: f64,
    side: usize,
}

impl Look {
    /// Looks at an image through masks of a width and height; colours are named after a gain of linear light.
    pub(super) fn at(
        image: &Rgb,
        masks: &[u32],
        [width, height]: [usize; 2],
        gain: f64,
        palette: &Palette,
    ) -> Self {
        let [wide, high] = [image.width(), image.height()];
        let side = (wide.min(high) / CELLS).max(4);
        let mut look = Self {
            borders: BTreeMap::new(),
            colors: BTreeMap::new(),
            row_noise: row_noise(image),
            side,
        };
        let columns: Vec<usize> = (0..wide)
            .map(|x| (2 * x + 1) * width / (2 * wide))
            .collect();
        let mut cells: Vec<Vec<Patch>> = vec![Vec::new(); wide.div_ceil(side)];
        let (pixels, _) = image.samples().as_chunks::<3>();
        for (y, row) in pixels.chunks_exact(wide).enumerate() {
            let from = (2 * y + 1) * height / (2 * high) * width;
            for (x, pixel) in row.iter().enumerate() {
                let mask = masks[from + columns[x]];
                let cell = &mut cells[x / side];
                let place = cell.iter().position(|patch| patch.mask == mask);
                let place = place.unwrap_or_else(|| {
                    let empty = Patch::default();
                    cell.push(Patch { mask, ..empty });
                    cell.len() - 1
                });
                cell[place].take(*pixel);
            }
            if (y + 1) % side == 0 || y + 1 == high {
                for cell in &mut cells {
                    look.take(y / side, cell, gain, palette);
                    cell.clear();
                }
            }
        }
        look
    }

    /// Takes note of one cell.
    fn take(&mut self, row: usize, cell: &[Patch], gain: f64, palette: &Palette) {
        let least = (self.side * self.side / 16).max(3) as u32;
        for (i, a) in cell.iter().enumerate().filter(|(_, a)| a.count >= least) {
            if a.count >= 2 * least {
                self.name(a, gain, palette);
            }
            for b in cell[i + 1..].iter().filter(|b| b.count >= least) {
                let (a, b) = if a.mask < b.mask { (a, b) } else { (b, a) };
                self.borders
                    .entry((a.mask, b.mask))
                    .or_default()
                    .take(row, a, b);
            }
        }
    }

    /// Names the colour that a patch has on the whole.
    fn name(&mut self, patch: &Patch, gain: f64, palette: &Palette) {
        let code = |sum: u64| {
            let linear = sum as f64 / f64::from(patch.count) / 65_535.0 * gain;
            let value = if linear <= 0.0031308 {
                linear * 12.92
            } else {
                1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055
            };
            (value * 255.0 + 0.5) as u8
        };
        if let Some(color) = palette.color(patch.linear.map(code)) {
            let counts = self.colors.entry(patch.mask).or_default();
            let place = Color::ALL.iter().position(|known| *known == color);
            counts[place.unwrap_or(0)] += u64::from(patch.count);
        }
    }

    /// The masks of whose outline half is seen.
    pub fn visible(&self) -> impl Iterator<Item = usize> {
        let mut outlines: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
        for ((a, b), border) in &self.borders {
            let seen = border.signal(self.row_noise, self.side) >= ROSE;
            for mask in [a, b] {
                let [seen_cells, cells] = outlines.entry(*mask).or_default();
                *cells += border.cells;
                if seen {
                    *seen_cells += border.cells;
                }
            }
        }
        outlines
            .into_iter()
            .filter(|(_, [seen, cells])| 2.0 * seen >= *cells)
            .map(|(mask, _)| mask as usize)
    }

    /// How many pixels of a mask have each colour, in the order of [`Color::ALL`].
    pub(super) fn colors(&self, mask: usize) -> [u64; Color::ALL.len()] {
        let known = u32::try_from(mask)
            .ok()
            .and_then(|mask| self.colors.get(&mask));
        known.copied().unwrap_or_default()
    }
}

/// The deviation of the noise that the pixels of a row share, in codes: from how far each row's mean is from those of its
/// neighbours. The median is not moved by the few rows where things begin and end.
fn row_noise(image: &Rgb) -> f64 {
    let width = image.width() * 3;
    let means: Vec<f64> = image
        .samples()
        .chunks_exact(width)
        .map(|row| row.iter().map(|code| u64::from(*code)).sum::<u64>() as f64 / width as f64)
        .collect();
    let mut bends: Vec<f64> = means
        .windows(3)
        .map(|rows| (rows[1] - f64::midpoint(rows[0], rows[2])).abs())
        .collect();
    if bends.is_empty() {
        return 0.0;
    }
    let middle = bends.len() / 2;
    let (_, median, _) = bends.select_nth_unstable_by(middle, f64::total_cmp);
    // The variance of a row less the mean of two others is one and a half times that of a row.
    *median * DEVIATION / 1.5_f64.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::questions::pick::Picker;
    use crate::types::FrameId;

    const SIZE: [usize; 2] = [240, 180];

    /// Normal draws, near enough: sums of twelve even ones.
    fn normal(seed: u64, count: usize) -> Vec<f64> {
        let frame = FrameId("noise".to_owned());
        let picker = Picker {
            seed,
            dataset: "",
            frame: &frame,
        };
        let mut state = picker.bits("", "") | 1;
        let mut even = || {
            // Marsaglia's xorshift64 (2003).
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..count)
            .map(|_| (0..12).map(|_| even()).sum::<f64>() - 6.0)
            .collect()
    }

    /// A disc on a ground: its mask is 2, the ground's 1.
    fn masks() -> Vec<u32> {
        let [width, height] = SIZE;
        let inside = |i: usize| {
            let (x, y) = ((i % width) as f64 - 120.0, (i / width) as f64 - 90.0);
            x * x + y * y < 40.0 * 40.0
        };
        (0..width * height)
            .map(|i| 1 + u32::from(inside(i)))
            .collect()
    }

    /// The disc, so much brighter than a ground of 60, under noise of pixels and of rows.
    fn image(step: f64, pixel: f64, row: f64, seed: u64) -> Rgb {
        let [width, height] = SIZE;
        let (draws, rows) = (
            normal(seed, width * height * 3),
            normal(seed + 1000, height),
        );
        let masks = masks();
        let samples = draws.iter().enumerate().map(|(i, draw)| {
            let place = i / 3;
            let light = 60.0 + if masks[place] == 2 { step } else { 0.0 };
            (light + draw * pixel + rows[place / width] * row)
                .round()
                .clamp(0.0, 255.0) as u8
        });
        Rgb::new(height, width, samples.collect()).unwrap()
    }

    fn sees(image: &Rgb) -> bool {
        let palette = Palette::built_in().unwrap();
        let look = Look::at(image, &masks(), SIZE, 1.0, &palette);
        look.visible().any(|mask| mask == 2)
    }

    #[test]
    fn contrast_is_held_against_noise() {
        for (step, pixel, row, seen) in [
            (40.0, 0.0, 0.0, true),
            (1.0, 0.0, 0.0, true),
            (0.0, 0.0, 0.0, false),
            (40.0, 20.0, 0.0, true),
            (-20.0, 20.0, 0.0, true),
            (1.0, 30.0, 0.0, false),
            (20.0, 4.0, 3.0, true),
            (2.0, 4.0, 12.0, false),
        ] {
            let found = sees(&image(step, pixel, row, 5));
            assert_eq!(found, seen, "{step} {pixel} {row}");
        }
    }

    #[test]
    fn noise_alone_shows_nothing() {
        for seed in 0..60 {
            for (pixel, row) in [(2.0, 0.0), (15.0, 0.0), (3.0, 6.0), (0.7, 0.0)] {
                assert!(!sees(&image(0.0, pixel, row, seed)), "{seed} {pixel} {row}");
            }
        }
    }

    #[test]
    fn a_gain_shows_no_more() {
        let dim = image(6.0, 12.0, 1.0, 9);
        let mut bright = dim.clone();
        for code in bright.samples_mut() {
            *code = (u32::from(*code) * 2).min(255) as u8;
        }
        let signals = |image: &Rgb| {
            let look = Look::at(image, &masks(), SIZE, 1.0, &Palette::built_in().unwrap());
            look.borders[&(1, 2)].signal(look.row_noise, look.side)
        };
        let (a, b) = (signals(&dim), signals(&bright));
        assert!((a - b).abs() < 0.02 * a, "{a} {b}");
    }

    #[test]
    fn rows_tell_their_noise() {
        for row in [0.0, 3.0, 8.0] {
            let found = row_noise(&image(30.0, 4.0, row, 2));
            assert!((found - row).abs() < 0.15 * row + 0.6, "{row}: {found}");
        }
    }

    #[test]
    fn colours_are_named_after_the_gain() {
        let [width, height] = SIZE;
        let samples = [24_u8, 4, 4].repeat(width * height);
        let dark = Rgb::new(height, width, samples).unwrap();
        let palette = Palette::built_in().unwrap();
        let name = |gain: f64| {
            let counts = Look::at(&dark, &masks(), SIZE, gain, &palette).colors(2);
            let most = (0..Color::ALL.len()).max_by_key(|i| counts[*i]).unwrap();
            Color::ALL[most].name()
        };
        assert_eq!((name(1.0), name(40.0)), ("black", "red"));
        assert!(
            (mean_light(&dark) - 0.0028).abs() < 0.0002,
            "{}",
            mean_light(&dark)
        );
    }
}
