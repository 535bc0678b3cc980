//! Noise of a low-light image, measured in smooth blocks: [`SmoothBlocks`] and [`SpreadCurve`].
//!
//! Blocks are smooth if the image in normal light has little structure there. Variation in the same blocks of the
//! low-light image is noise. A noise model must reproduce its spread as a function of the clean code, which is the
//! green code that the exposure drop alone leaves. The spread about a fitted plane is biased by demosaicing, rounding
//! and texture. Comparing a real with a synthetic image cancels this bias, because both pass through the same steps.
//!
//! Mean of few numbers with its interval: [`Mean`].
//!
//! Quantiles of a sample: [`quantile`].

use serde::Serialize;

use crate::statistics::estimate::student;
use darkqa_base::types::Rgb;

/// Side of a block in pixels (chosen).
const SIDE: usize = 8;

/// Number of bins of the clean code, with equally many blocks each (chosen).
pub(super) const BINS: usize = 8;

/// Share of the blocks in a bin that count as smooth (chosen).
const SMOOTH_SHARE: f64 = 0.3;

/// Minimum number of blocks in a bin (chosen).
const MIN_BLOCKS: usize = 20;

/// Minimum number of smooth blocks in a bin (chosen).
const MIN_SMOOTH_BLOCKS: usize = 10;

/// A block is excluded if a green code in normal light is this high or higher: near clipping, noise is cut off
/// (chosen).
const CLIPPING_CODE: u8 = 250;

/// Clean code that a block must exceed: below it, rounding leaves no spread (chosen).
const MIN_CLEAN_CODE: f64 = 1.0;

/// Lower bound of a spread, in codes: rounding destroys smaller ones (chosen).
const MIN_SPREAD: f64 = 0.05;

/// Smooth blocks of 8 × 8 pixels in an image in normal light, in bins of their clean code after the exposure drop.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SmoothBlocks {
    /// Indices of the smooth blocks in each bin, counted row by row over the image; empty for a bin with too few
    /// blocks.
    bins: [Vec<usize>; BINS],
}

/// Spread of the green codes in the smooth blocks of each bin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpreadCurve {
    /// Natural logarithm of the root mean square of the blocks' spreads, in codes; `None` for a bin with too few
    /// blocks.
    pub(super) bins: [Option<f64>; BINS],
}

/// A block of the image in normal light that is a candidate for a smooth block.
struct CandidateBlock {
    index: usize,
    /// Mean green code after the exposure drop.
    clean_code: f64,
    /// Spread in normal light, before the exposure drop.
    spread: f64,
}

impl SmoothBlocks {
    /// Finds the smooth blocks of an image in normal light. Its low-light partner is `drop_ev` EV darker.
    #[must_use]
    pub fn new(normal: &Rgb, drop_ev: f64) -> Self {
        let code_factor = libm::exp2(-drop_ev / 2.2);
        let blocks: Vec<CandidateBlock> = (0..block_count(normal))
            .filter_map(|index| {
                let block = Block::new(normal, index);
                let clean_code = block.mean() * code_factor;
                let is_used = block.brightest() < f64::from(CLIPPING_CODE) && clean_code > MIN_CLEAN_CODE;
                is_used.then(|| CandidateBlock { index, clean_code, spread: block.spread() })
            })
            .collect();
        let mut codes: Vec<f64> = blocks.iter().map(|block| block.clean_code).collect();
        codes.sort_by(f64::total_cmp);
        let edges: Vec<f64> = (1..BINS).filter_map(|edge| quantile(&codes, edge as f64 / BINS as f64)).collect();
        let mut bins: [Vec<&CandidateBlock>; BINS] = Default::default();
        for block in &blocks {
            // A code on the edge of two bins belongs to the upper bin.
            let bin = edges.iter().filter(|edge| **edge <= block.clean_code).count();
            bins[bin].push(block);
        }
        Self { bins: bins.map(|blocks| smoothest(&blocks)) }
    }

    /// Measures the spread of an image in the smooth blocks. The image must have the size of the image in normal light.
    #[must_use]
    pub fn spread(&self, image: &Rgb) -> SpreadCurve {
        SpreadCurve {
            bins: self.bins.each_ref().map(|blocks| {
                let mean_square = blocks.iter().map(|index| Block::new(image, *index).spread().powi(2)).sum::<f64>()
                    / blocks.len() as f64;
                (!blocks.is_empty()).then(|| libm::log(mean_square.sqrt().max(MIN_SPREAD)))
            }),
        }
    }
}

/// Indices of the blocks of a bin with the smallest spreads; empty if the bin has too few blocks.
fn smoothest(blocks: &[&CandidateBlock]) -> Vec<usize> {
    if blocks.len() < MIN_BLOCKS {
        return Vec::new();
    }
    let mut spreads: Vec<f64> = blocks.iter().map(|block| block.spread).collect();
    spreads.sort_by(f64::total_cmp);
    let max_spread = quantile(&spreads, SMOOTH_SHARE).unwrap_or_default();
    let smooth: Vec<usize> =
        blocks.iter().filter(|block| block.spread <= max_spread).map(|block| block.index).collect();
    if smooth.len() < MIN_SMOOTH_BLOCKS {
        return Vec::new();
    }
    smooth
}

/// Number of whole blocks in an image.
fn block_count(image: &Rgb) -> usize {
    (image.height() / SIDE) * (image.width() / SIDE)
}

/// Green codes of a block, row by row.
struct Block([[f64; SIDE]; SIDE]);

impl Block {
    /// Block `index` of an image, counted row by row; `index` is below [`block_count`].
    fn new(image: &Rgb, index: usize) -> Self {
        let blocks_per_row = image.width() / SIDE;
        let [top, left] = [index / blocks_per_row, index % blocks_per_row].map(|block| block * SIDE);
        Self(std::array::from_fn(|row| {
            let line = ((top + row) * image.width() + left) * 3;
            std::array::from_fn(|column| f64::from(image.samples()[line + 3 * column + 1]))
        }))
    }

    fn codes(&self) -> impl Iterator<Item = &f64> {
        self.0.as_flattened().iter()
    }

    fn mean(&self) -> f64 {
        self.codes().sum::<f64>() / (SIDE * SIDE) as f64
    }

    fn brightest(&self) -> f64 {
        self.codes().copied().fold(0.0, f64::max)
    }

    /// Standard deviation about the least-squares plane, in codes. The plane takes three degrees of freedom.
    fn spread(&self) -> f64 {
        // Σ x² over the block, where x is the centred column; Σ y² over centred rows is the same.
        let sum_of_squares = SIDE as f64 * (0..SIDE).map(|i| centred(i) * centred(i)).sum::<f64>();
        let (mut sum_across, mut sum_down) = (0.0, 0.0);
        for (row, codes) in self.0.iter().enumerate() {
            for (column, code) in codes.iter().enumerate() {
                sum_across += code * centred(column);
                sum_down += code * centred(row);
            }
        }
        let mean = self.mean();
        let slope_across = sum_across / sum_of_squares;
        let slope_down = sum_down / sum_of_squares;
        let mut squared_residuals = 0.0;
        for (row, codes) in self.0.iter().enumerate() {
            for (column, code) in codes.iter().enumerate() {
                let residual = code - mean - slope_across * centred(column) - slope_down * centred(row);
                squared_residuals += residual * residual;
            }
        }
        (squared_residuals / (SIDE * SIDE - 3) as f64).sqrt()
    }
}

/// Position in a block relative to its centre, in pixels.
fn centred(i: usize) -> f64 {
    i as f64 - (SIDE - 1) as f64 / 2.0
}

/// Minimum number of values for an interval (chosen). With two values, the half-width is more than 6 times their
/// distance, which can exceed the range of the quantity.
pub const MIN_VALUES: usize = 3;

/// A mean with its 95 % interval by Student's t distribution.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Mean {
    /// Mean; null in JSON if it is infinite.
    pub value: f64,
    /// Bounds of the interval; `None` for fewer than [`MIN_VALUES`] numbers or an infinite mean.
    pub interval: Option<[f64; 2]>,
    /// Number of values.
    pub n: usize,
}

impl Mean {
    /// Computes the mean of numbers, some of which may be infinite; `None` without numbers.
    #[must_use]
    pub fn from_values(numbers: &[f64]) -> Option<Self> {
        let n = numbers.len();
        if n == 0 {
            return None;
        }
        let value = numbers.iter().sum::<f64>() / n as f64;
        let squares: f64 = numbers.iter().map(|x| (x - value) * (x - value)).sum();
        let interval = (n >= MIN_VALUES && value.is_finite()).then(|| {
            let error = (squares / (n - 1) as f64 / n as f64).sqrt();
            let half = student((n - 1) as f64) * error;
            [value - half, value + half]
        });
        Some(Self { value, interval, n })
    }
}

/// Quantile of sorted numbers, with linear interpolation as in numpy's default; `None` without numbers.
#[must_use]
pub(crate) fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let position = share * sorted.len().checked_sub(1)? as f64;
    let below = position.floor();
    let low = *sorted.get(below as usize)?;
    let high = *sorted.get(position.ceil() as usize)?;
    Some(low + (position - below) * (high - low))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grey ramp from left to right plus a chequerboard of `texture(column)` codes.
    fn ramp(texture: impl Fn(usize) -> u8) -> Rgb {
        let (height, width) = (160, 240);
        let samples = (0..height * width).flat_map(|i| {
            let (row, column) = (i / width, i % width);
            let code = (10 + column) as u8;
            let up = (row + column) % 2 == 0;
            [code + if up { texture(column) } else { 0 }; 3]
        });
        Rgb::new(height, width, samples.collect()).unwrap()
    }

    #[test]
    fn spread_ignores_a_plane_and_measures_a_chequerboard() {
        assert!(Block::new(&ramp(|_| 0), 7).spread() < 1e-12);
        // ±2 about the mean: the variance is 4 · 64/61.
        let spread = Block::new(&ramp(|_| 4), 7).spread();
        assert!((spread - f64::sqrt(4.0 * 64.0 / 61.0)).abs() < 0.02, "{spread}");
    }

    #[test]
    fn blocks_with_texture_are_not_smooth() {
        // Texture in every second block column.
        let clean = ramp(|column| if (column / 8) % 2 == 0 { 5 } else { 0 });
        let smooth = SmoothBlocks::new(&clean, 1.0);
        let across = clean.width() / SIDE;
        let kept: Vec<usize> = smooth.bins.concat();
        assert!(kept.len() > 100);
        assert!(kept.iter().all(|index| index % across % 2 == 1));
        let curve = smooth.spread(&clean);
        assert_eq!(curve.bins, [Some(libm::log(MIN_SPREAD)); BINS]);
        let noisy = smooth.spread(&ramp(|_| 4));
        assert!(noisy.bins.iter().all(|ln| (ln.unwrap() - 0.717).abs() < 0.02));
    }

    #[test]
    fn images_without_usable_blocks_have_no_spread() {
        let white = Rgb::new(160, 240, vec![255; 160 * 240 * 3]).unwrap();
        let black = Rgb::black(160, 240);
        for image in [white, black, Rgb::black(7, 7)] {
            let curve = SmoothBlocks::new(&image, 1.0).spread(&image);
            assert_eq!(curve.bins, [None; BINS]);
        }
    }

    #[test]
    fn an_interval_needs_three_numbers() {
        assert_eq!(Mean::from_values(&[]), None);
        for few in [&[3.0][..], &[1.0, 3.0]] {
            assert_eq!(Mean::from_values(few).unwrap().interval, None);
        }
        let mean = Mean::from_values(&[1.0, 2.0, 3.0]).unwrap();
        let [low, high] = mean.interval.unwrap();
        // t of 2 degrees of freedom, times 1/√3.
        let half = 4.302_652_730 / f64::sqrt(3.0);
        assert!((mean.value - 2.0).abs() < 1e-12);
        assert!((high - 2.0 - half).abs() < 1e-6 && (2.0 - low - half).abs() < 1e-6);
        let infinite = Mean::from_values(&[1.0, 2.0, f64::INFINITY]).unwrap();
        assert_eq!(infinite.interval, None);
    }

    #[test]
    fn quantiles_match_numpy() {
        let sorted = [1.0, 2.0, 4.0, 8.0];
        for (share, expected) in [(0.0, 1.0), (0.1, 1.3), (0.5, 3.0), (0.9, 6.8), (1.0, 8.0)] {
            let found = quantile(&sorted, share).unwrap();
            assert!((found - expected).abs() < 1e-12, "{share}: {found}");
        }
        assert_eq!(quantile(&[], 0.5), None);
        assert_eq!(quantile(&[3.0], 0.9), Some(3.0));
    }
}
