//! Which masks of an image stand out of its noise: [`MaskContrasts`].
//!
//! The image is cut into square cells. Where two masks meet in one, the means of their pixels there are compared: close to
//! the border between them, so that light which changes over the room plays no part. The squares of these differences, each
//! over its own uncertainty, are added up over all cells of a border, for the sign of a contrast changes along it as patterns
//! and light do. Noise alone makes one of each on average; what is more than that is contrast. Rose's criterion says that a
//! signal is seen where it is at least five times its uncertainty (Rose, "The sensitivity performance of the human eye on an
//! absolute scale", J. Opt. Soc. Am. 38:196, 1948; Burgess, "The Rose model, revisited", J. Opt. Soc. Am. A 16:633, 1999);
//! here, that the excess is five times the deviation of the sum, or that the differences, added up with their signs, are five
//! times theirs: contrast of one sign is seen through more noise. A mask is visible where half of its outline is seen, each
//! border weighing as many cells as it has; the edge of the image is no outline.
//!
//! The uncertainty is that of noise, not of patterns, and comes from the image itself: how unlike the halves of cells within one
//! mask are, of cells about as bright, in the smoother half of them (towards the lower envelope; Liu, Freeman, Szeliski and Kang,
//! "Noise estimation from a single image", CVPR 2006); the noise that rows share, from how unlike neighbouring rows of the
//! whole image are; and the rounding to whole codes.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use crate::questions::colors::{Color, Palette};
use crate::types::Rgb;

/// Rose's criterion: a difference is seen where it is so many times its uncertainty.
pub(crate) const ROSE: f64 = 5.0;

/// A cell has a side of this share of the image's shorter side.
const CELLS: usize = 60;

/// The mean of the smaller half of variances of two normal draws each, over the mean of all: of chi-squared with two degrees of
/// freedom, 1 − ln 2.
const SMALLER_HALF: f64 = 1.0 - std::f64::consts::LN_2;

/// So many smooth cells at least tell the noise of their brightness.
const ENOUGH: usize = 12;

/// The variance of rounding to whole codes.
const ROUNDING: f64 = 1.0 / 12.0;

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
    fn take(&mut self, pixel: [u8; 3]) {
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

/// Two masks in one cell.
#[derive(Debug, Clone, Copy)]
struct MaskBorder {
    row: usize,
    /// The mean of both, which tells how much noise there is.
    light: [f64; 3],
    difference: [f64; 3],
    /// One over the pixels of each, added.
    share: f64,
}

/// How much noise pixels have by how bright they are, for one channel: a variance for each step of brightness.
#[derive(Debug, Clone, Default)]
struct PixelNoise(BTreeMap<u32, f64>);

impl PixelNoise {
    /// The step of a code: half an octave, for noise goes with light.
    fn step(light: f64) -> u32 {
        (2.0 * libm::log2(light + 1.0)) as u32
    }

    /// The variances of the smoother half of the cells, by brightness.
    fn of(cells: &[(f64, f64)]) -> Self {
        let mut steps: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
        for (light, variance) in cells {
            steps.entry(Self::step(*light)).or_default().push(*variance);
        }
        let enough = steps.into_iter().filter(|(_, list)| list.len() >= ENOUGH);
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

    /// The variance at a brightness; where too little is as bright, that of what is nearest to it.
    fn at(&self, light: f64) -> f64 {
        let step = Self::step(light);
        let nearest = self.0.iter().min_by_key(|(known, _)| known.abs_diff(step));
        nearest.map_or(0.0, |(_, variance)| *variance)
    }
}

/// What is seen of the masks of an image.
#[derive(Debug)]
pub(crate) struct MaskContrasts {
    borders: BTreeMap<(u32, u32), Vec<MaskBorder>>,
    shades: BTreeMap<u32, Shades>,
    /// Brightness and variance of the cells within one mask, by channel; then what they tell.
    smooth: [Vec<(f64, f64)>; 3],
    noise: [PixelNoise; 3],
    row_noise: f64,
    side: usize,
}

/// The pixels of a cell: by mask, and by quarter.
#[derive(Debug, Clone, Default)]
struct GridCell {
    patches: Vec<MaskPatch>,
    quarters: [MaskPatch; 4],
}

impl GridCell {
    fn take(&mut self, mask: u32, quarter: usize, pixel: [u8; 3]) {
        let place = self.patches.iter().position(|patch| patch.mask == mask);
        let place = place.unwrap_or_else(|| {
            self.patches.push(MaskPatch {
                mask,
                ..MaskPatch::default()
            });
            self.patches.len() - 1
        });
        self.patches[place].take(pixel);
        self.quarters[quarter].take(pixel);
    }
}

impl MaskContrasts {
    /// Looks at an image through masks of a width and height; colours are named after a gain of linear light.
    pub(super) fn at(
        image: &Rgb,
        masks: &[u32],
        [width, height]: [usize; 2],
        gain: f64,
        palette: &Palette,
    ) -> Self {
        let [wide, high] = [image.width(), image.height()];
        // Even, so that a cell has four quarters.
        let side = (wide.min(high) / CELLS).max(4).next_multiple_of(2);
        let mut look = Self {
            borders: BTreeMap::new(),
            shades: BTreeMap::new(),
            smooth: Default::default(),
            noise: Default::default(),
            row_noise: row_noise(image),
            side,
        };
        let columns: Vec<usize> = (0..wide)
            .map(|x| (2 * x + 1) * width / (2 * wide))
            .collect();
        let mut cells: Vec<GridCell> = vec![GridCell::default(); wide.div_ceil(side)];
        let (pixels, _) = image.samples().as_chunks::<3>();
        for (y, row) in pixels.chunks_exact(wide).enumerate() {
            let from = (2 * y + 1) * height / (2 * high) * width;
            let lower = 2 * usize::from(y % side >= side / 2);
            for (x, pixel) in row.iter().enumerate() {
                let quarter = lower + usize::from(x % side >= side / 2);
                cells[x / side].take(masks[from + columns[x]], quarter, *pixel);
            }
            if (y + 1) % side == 0 || y + 1 == high {
                for cell in &mut cells {
                    look.take(y / side, cell, gain, palette);
                    *cell = GridCell::default();
                }
            }
        }
        look.noise = [0, 1, 2].map(|channel| PixelNoise::of(&look.smooth[channel]));
        look
    }

    /// Takes note of one cell.
    fn take(&mut self, row: usize, cell: &GridCell, gain: f64, palette: &Palette) {
        let whole = (self.side * self.side) as u32;
        if let [patch] = &cell.patches[..]
            && patch.count == whole
        {
            self.smoothness(patch, &cell.quarters);
        }
        let least = (whole / 16).max(3);
        for (i, a) in cell.patches.iter().enumerate() {
            if a.count >= 2 * least {
                self.shades
                    .entry(a.mask)
                    .or_default()
                    .take(a, gain, palette);
            }
            let others = cell.patches[i + 1..].iter();
            for b in others.filter(|b| a.count.min(b.count) >= least) {
                let (a, b) = if a.mask < b.mask { (a, b) } else { (b, a) };
                let meeting = MaskBorder {
                    row,
                    light: [0, 1, 2].map(|i| f64::midpoint(a.mean(i), b.mean(i))),
                    difference: [0, 1, 2].map(|i| a.mean(i) - b.mean(i)),
                    share: 1.0 / f64::from(a.count) + 1.0 / f64::from(b.count),
                };
                self.borders
                    .entry((a.mask, b.mask))
                    .or_default()
                    .push(meeting);
            }
        }
    }

    /// Takes note of how unlike the halves of a cell within one mask are, across and down: what is compared at borders, where
    /// there is none; as a variance of pixels.
    fn smoothness(&mut self, patch: &MaskPatch, quarters: &[MaskPatch; 4]) {
        let pixels = f64::from(patch.count) / 4.0;
        for channel in 0..3 {
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| quarters[i].mean(channel));
            let (across, down) = ((a + c - b - d) / 2.0, (a + b - c - d) / 2.0);
            let variance = f64::midpoint(across * across, down * down);
            self.smooth[channel].push((patch.mean(channel), variance * pixels));
        }
    }

    /// How far the contrast along a border is above what noise makes, over the deviation of that; in the channel where it is
    /// largest.
    fn signal(&self, border: &[MaskBorder]) -> f64 {
        let mut rows: Vec<usize> = border.iter().map(|meeting| meeting.row).collect();
        rows.dedup();
        let (cells, rows) = (border.len() as f64, rows.len() as f64);
        // Each side averages half of the rows of a cell.
        let shared = 4.0 * self.row_noise * self.row_noise / self.side as f64;
        let signals = (0..3).map(|channel| {
            let (mut sum, mut signed, mut weights, mut alike) = (0.0, 0.0, 0.0, 0.0);
            for meeting in border {
                let own = self.noise[channel].at(meeting.light[channel]).max(ROUNDING);
                let variance = own * meeting.share + shared;
                sum += meeting.difference[channel] * meeting.difference[channel] / variance;
                signed += meeting.difference[channel] / variance;
                weights += 1.0 / variance;
                alike += shared / variance / cells;
            }
            // Draws that are alike scatter together: by rows, as far as the noise is that of rows.
            let together = (cells / rows - 1.0) * alike;
            let squares = (sum - cells) / (2.0 * cells * (1.0 + together * alike)).sqrt();
            squares.max(signed.abs() / (weights * (1.0 + together)).sqrt())
        });
        signals.fold(f64::MIN, f64::max)
    }

    /// The masks of whose outline half is seen.
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

    /// What colours a mask has, the first the most.
    pub(super) fn colors(&self, mask: usize, palette: &Palette) -> Vec<Color> {
        let shades = u32::try_from(mask)
            .ok()
            .and_then(|mask| self.shades.get(&mask));
        shades.map_or_else(Vec::new, |shades| shades.colors(palette))
    }
}

/// The colours of a mask, cell by cell, after the gain.
#[derive(Debug, Clone, Default)]
struct Shades {
    cells: Vec<[u8; 3]>,
    /// How many pixels have each colour.
    counts: [u64; Color::ALL.len()],
}

impl Shades {
    fn take(&mut self, patch: &MaskPatch, gain: f64, palette: &Palette) {
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
        let named = palette.color(codes);
        if let Some(place) = Color::ALL.iter().position(|known| Some(*known) == named) {
            self.counts[place] += u64::from(patch.count);
        }
    }

    /// The colour of the median of its cells, which noise moves least and which is the rulebook's own check; then those of its
    /// cells, the commonest first.
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
mod tests;
