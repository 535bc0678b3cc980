//! Visibility of the masks of an image in its noise: [`MaskContrasts`].
//!
//! The image is cut into square cells. In a cell that contains two masks, the mean values of their pixels are compared. Both
//! lie close to their common border, so light that changes over the room has no effect. Each difference is squared and
//! divided by its variance, and the sum is taken over all cells of a border: squares, because the sign of a contrast can
//! change along the border with patterns and light. Noise alone gives 1 per cell on average; the excess is contrast.
//!
//! By Rose's criterion, a signal is seen if it is at least five times its uncertainty (Rose, "The sensitivity performance of
//! the human eye on an absolute scale", J. Opt. Soc. Am. 38:196, 1948; Burgess, "The Rose model, revisited", J. Opt. Soc.
//! Am. A 16:633, 1999). Here a border is seen in two cases: the excess is five times the standard deviation of the sum, or
//! the sum of the signed differences is five times its own, which finds contrast of one sign in more noise. A mask is
//! visible if half of its outline is seen, where each border counts by its number of cells. The edge of the image is not
//! part of the outline.
//!
//! The uncertainty is that of noise, not of patterns. It is estimated from the image in three parts:
//!
//! - Pixel noise: the differences between the halves of cells within one mask, over cells of similar brightness. Only the
//!   smoother half of these cells is used (towards the lower envelope; Liu, Freeman, Szeliski and Kang, "Noise estimation
//!   from a single image", CVPR 2006).
//! - Row noise: the differences between neighbouring rows of the whole image.
//! - Rounding to whole codes.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use crate::questions::colors::{Color, Palette};
use crate::types::Rgb;

/// Rose's criterion: a difference is seen if it is at least this many times its uncertainty.
pub(crate) const ROSE: f64 = 5.0;

/// Number of cells along the shorter side of the image.
const CELLS: usize = 60;

/// Mean of the smaller half of chi-squared values with two degrees of freedom, relative to the mean of all: 1 − ln 2. Each
/// variance of a cell is such a value, because it comes from two normal differences.
const SMALLER_HALF: f64 = 1.0 - std::f64::consts::LN_2;

/// Minimum number of cells within one mask to estimate the noise at their brightness (chosen).
const MIN_CELLS: usize = 12;

/// Variance of rounding to whole codes, in codes squared.
const ROUNDING: f64 = 1.0 / 12.0;

/// Ratio of the standard deviation to the median absolute deviation of normal noise.
const DEVIATION: f64 = 1.4826;

/// Linear light of each sRGB code, from 0 to 65,535 (IEC 61966-2-1).
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

/// The linear light of an sRGB code, from 0 to 65,535.
#[must_use]
pub(crate) fn linear(code: u8) -> u32 {
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
struct MaskPatch {
    mask: u32,
    count: u32,
    sums: [u64; 3],
    linear: [u64; 3],
}

impl MaskPatch {
    fn add(&mut self, pixel: [u8; 3]) {
        self.count += 1;
        for (channel, code) in pixel.into_iter().enumerate() {
            let value = u64::from(code);
            self.sums[channel] += value;
            self.linear[channel] += u64::from(LINEAR[usize::from(code)]);
        }
    }

    fn mean(&self, channel: usize) -> f64 {
        self.sums[channel] as f64 / f64::from(self.count)
    }
}

/// The difference between two masks in one cell.
#[derive(Debug, Clone, Copy)]
struct MaskBorder {
    row: usize,
    /// Mean of both masks, in codes per channel; the noise depends on it.
    light: [f64; 3],
    /// Difference of the means, in codes per channel.
    difference: [f64; 3],
    /// Sum of 1 / pixels over both masks; times the pixel variance it is the variance of the difference.
    share: f64,
}

/// Noise of the pixels of one channel: a variance in codes squared for each step of brightness.
#[derive(Debug, Clone, Default)]
struct PixelNoise(BTreeMap<u32, f64>);

impl PixelNoise {
    /// The step of a code. A step is half an octave, because noise depends on light.
    fn step(light: f64) -> u32 {
        (2.0 * libm::log2(light + 1.0)) as u32
    }

    /// Estimates the noise from brightness and variance of cells; only the smoother half of each step is used.
    fn of(cells: &[(f64, f64)]) -> Self {
        let mut steps: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
        for (light, variance) in cells {
            steps.entry(Self::step(*light)).or_default().push(*variance);
        }
        let enough = steps
            .into_iter()
            .filter(|(_, list)| list.len() >= MIN_CELLS);
        Self(
            enough
                .map(|(step, mut list)| {
                    list.sort_by(f64::total_cmp);
                    list.truncate(list.len() / 2);
                    let mean = list.iter().sum::<f64>() / list.len() as f64;
                    (step, mean / SMALLER_HALF)
                })
                .collect(),
        )
    }

    /// The variance at a brightness, or at the nearest brightness with an estimate; 0 if there is none.
    fn at(&self, light: f64) -> f64 {
        let step = Self::step(light);
        let nearest = self.0.iter().min_by_key(|(known, _)| known.abs_diff(step));
        nearest.map_or(0.0, |(_, variance)| *variance)
    }
}

/// Contrasts between the masks of an image, their colours and the noise.
#[derive(Debug)]
pub(crate) struct MaskContrasts {
    /// Cells of the border between each pair of masks.
    borders: BTreeMap<(u32, u32), Vec<MaskBorder>>,
    shades: BTreeMap<u32, Shades>,
    /// Brightness and variance of the cells within one mask, by channel.
    smooth: [Vec<(f64, f64)>; 3],
    /// Noise by channel, estimated from `smooth`.
    noise: [PixelNoise; 3],
    /// Standard deviation of the noise that the pixels of a row share, in codes.
    row_noise: f64,
    /// Side of a cell in pixels.
    side: usize,
}

/// Sums over the pixels of a cell, by mask and by quarter.
#[derive(Debug, Clone, Default)]
struct GridCell {
    patches: Vec<MaskPatch>,
    quarters: [MaskPatch; 4],
}

impl GridCell {
    fn add(&mut self, mask: u32, quarter: usize, pixel: [u8; 3]) {
        let index = self.patches.iter().position(|patch| patch.mask == mask);
        let index = index.unwrap_or_else(|| {
            self.patches.push(MaskPatch {
                mask,
                ..MaskPatch::default()
            });
            self.patches.len() - 1
        });
        self.patches[index].add(pixel);
        self.quarters[quarter].add(pixel);
    }
}

impl MaskContrasts {
    /// Measures an image through masks of a given width and height. Colours are named after a gain of linear light.
    pub(super) fn measure(
        image: &Rgb,
        masks: &[u32],
        [width, height]: [usize; 2],
        gain: f64,
        palette: &Palette,
    ) -> Self {
        let [image_width, image_height] = [image.width(), image.height()];
        // Even, so that a cell has four equal quarters.
        let side = (image_width.min(image_height) / CELLS)
            .max(4)
            .next_multiple_of(2);
        let mut contrasts = Self {
            borders: BTreeMap::new(),
            shades: BTreeMap::new(),
            smooth: Default::default(),
            noise: Default::default(),
            row_noise: row_noise(image),
            side,
        };
        let columns: Vec<usize> = (0..image_width)
            .map(|x| (2 * x + 1) * width / (2 * image_width))
            .collect();
        let mut cells: Vec<GridCell> = vec![GridCell::default(); image_width.div_ceil(side)];
        let (pixels, _) = image.samples().as_chunks::<3>();
        for (y, row) in pixels.chunks_exact(image_width).enumerate() {
            let from = (2 * y + 1) * height / (2 * image_height) * width;
            let lower = 2 * usize::from(y % side >= side / 2);
            for (x, pixel) in row.iter().enumerate() {
                let quarter = lower + usize::from(x % side >= side / 2);
                cells[x / side].add(masks[from + columns[x]], quarter, *pixel);
            }
            if (y + 1) % side == 0 || y + 1 == image_height {
                for cell in &mut cells {
                    contrasts.add(y / side, cell, gain, palette);
                    *cell = GridCell::default();
                }
            }
        }
        contrasts.noise = [0, 1, 2].map(|channel| PixelNoise::of(&contrasts.smooth[channel]));
        contrasts
    }

    /// Adds one cell of a row of cells.
    fn add(&mut self, row: usize, cell: &GridCell, gain: f64, palette: &Palette) {
        let whole = (self.side * self.side) as u32;
        if let [patch] = &cell.patches[..]
            && patch.count == whole
        {
            self.add_smooth(patch, &cell.quarters);
        }
        let min_pixels = (whole / 16).max(3);
        for (i, a) in cell.patches.iter().enumerate() {
            if a.count >= 2 * min_pixels {
                self.shades.entry(a.mask).or_default().add(a, gain, palette);
            }
            let others = cell.patches[i + 1..].iter();
            for b in others.filter(|b| a.count.min(b.count) >= min_pixels) {
                let (a, b) = if a.mask < b.mask { (a, b) } else { (b, a) };
                let border = MaskBorder {
                    row,
                    light: [0, 1, 2].map(|i| f64::midpoint(a.mean(i), b.mean(i))),
                    difference: [0, 1, 2].map(|i| a.mean(i) - b.mean(i)),
                    share: 1.0 / f64::from(a.count) + 1.0 / f64::from(b.count),
                };
                self.borders
                    .entry((a.mask, b.mask))
                    .or_default()
                    .push(border);
            }
        }
    }

    /// Adds the variance of a cell within one mask. It comes from the differences between the left and right halves and
    /// between the upper and lower halves: the comparison made at borders, where there is no border.
    fn add_smooth(&mut self, patch: &MaskPatch, quarters: &[MaskPatch; 4]) {
        let pixels = f64::from(patch.count) / 4.0;
        for channel in 0..3 {
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| quarters[i].mean(channel));
            let (across, down) = ((a + c - b - d) / 2.0, (a + b - c - d) / 2.0);
            let variance = f64::midpoint(across * across, down * down);
            self.smooth[channel].push((patch.mean(channel), variance * pixels));
        }
    }

    /// The contrast along a border above the level of noise, in standard deviations of the noise. The channel with the largest
    /// value counts.
    fn signal(&self, border: &[MaskBorder]) -> f64 {
        let mut rows: Vec<usize> = border.iter().map(|cell| cell.row).collect();
        rows.dedup();
        let (cells, rows) = (border.len() as f64, rows.len() as f64);
        // Variance by row noise: each mask averages half of the rows of a cell.
        let shared = 4.0 * self.row_noise * self.row_noise / self.side as f64;
        let signals = (0..3).map(|channel| {
            let (mut sum, mut signed, mut weights, mut correlation) = (0.0, 0.0, 0.0, 0.0);
            for cell in border {
                let own = self.noise[channel].at(cell.light[channel]).max(ROUNDING);
                let variance = own * cell.share + shared;
                sum += cell.difference[channel] * cell.difference[channel] / variance;
                signed += cell.difference[channel] / variance;
                weights += 1.0 / variance;
                correlation += shared / variance / cells;
            }
            // Cells of one row share its noise, so their differences are correlated and the sums vary more.
            let inflation = (cells / rows - 1.0) * correlation;
            let squares = (sum - cells) / (2.0 * cells * (1.0 + inflation * correlation)).sqrt();
            squares.max(signed.abs() / (weights * (1.0 + inflation)).sqrt())
        });
        signals.fold(f64::MIN, f64::max)
    }

    /// The masks with at least half of their outline seen.
    pub(crate) fn visible(&self) -> impl Iterator<Item = usize> {
        let mut outlines: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
        for ((a, b), border) in &self.borders {
            let seen = self.signal(border) >= ROSE;
            for mask in [a, b] {
                let [seen_cells, cells] = outlines.entry(*mask).or_default();
                *cells += border.len() as f64;
                if seen {
                    *seen_cells += border.len() as f64;
                }
            }
        }
        outlines
            .into_iter()
            .filter(|(_, [seen, cells])| 2.0 * seen >= *cells)
            .map(|(mask, _)| mask as usize)
    }

    /// The colours of a mask, the best first; see [`Shades::colors`].
    pub(super) fn colors(&self, mask: usize, palette: &Palette) -> Vec<Color> {
        let shades = u32::try_from(mask)
            .ok()
            .and_then(|mask| self.shades.get(&mask));
        shades.map_or_else(Vec::new, |shades| shades.colors(palette))
    }
}

/// The colours of a mask, one per cell, after the gain.
#[derive(Debug, Clone, Default)]
struct Shades {
    cells: Vec<[u8; 3]>,
    /// Number of pixels of each colour.
    counts: [u64; Color::ALL.len()],
}

impl Shades {
    fn add(&mut self, patch: &MaskPatch, gain: f64, palette: &Palette) {
        let code = |sum: u64| {
            let linear = sum as f64 / f64::from(patch.count) / 65_535.0 * gain;
            let value = if linear <= 0.0031308 {
                linear * 12.92
            } else {
                1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055
            };
            (value * 255.0 + 0.5) as u8
        };
        let codes = patch.linear.map(code);
        self.cells.push(codes);
        let name = palette.color(codes);
        if let Some(index) = Color::ALL.iter().position(|color| Some(*color) == name) {
            self.counts[index] += u64::from(patch.count);
        }
    }

    /// First the colour of the median over the cells: noise changes it least, and the rulebook checks the same. Then the colours
    /// of the cells, the most common first.
    fn colors(&self, palette: &Palette) -> Vec<Color> {
        let median = |channel: usize| {
            let mut codes: Vec<u8> = self.cells.iter().map(|cell| cell[channel]).collect();
            let middle = codes.len() / 2;
            *codes.select_nth_unstable(middle).1
        };
        if self.cells.is_empty() {
            return Vec::new();
        }
        let first = palette.color([0, 1, 2].map(median));
        let counted = Color::ALL.into_iter().zip(self.counts);
        let mut others: Vec<(Color, u64)> = counted.filter(|(_, count)| *count > 0).collect();
        others.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        first
            .into_iter()
            .chain(others.into_iter().map(|(color, _)| color))
            .collect()
    }
}

/// The standard deviation of the noise that the pixels of a row share, in codes. It comes from the differences between the mean
/// of each row and those of its neighbours. The median ignores the few rows where objects begin and end.
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
    // A row minus the mean of two others has 1.5 times the variance of a row.
    *median * DEVIATION / 1.5_f64.sqrt()
}

#[cfg(test)]
mod tests;
