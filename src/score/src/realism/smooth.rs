//! Blocks of an image that are smooth without noise: [`SmoothBlocks`], and the spread of an image in them: [`SpreadCurve`].
//!
//! The variation within such a block of the low-light image is noise, and a noise model must reproduce its spread as a function of the
//! clean code. The spread about a plane is biased by demosaicing, rounding and texture; a comparison is not, because the real and the
//! synthetic image pass through the same steps.

use super::quantile::quantile;
use darkqa_ground::types::Rgb;

/// Side of a block in pixels (chosen).
const SIDE: usize = 8;
/// Number of bins of the clean code, equally filled (chosen).
pub(super) const BINS: usize = 8;
/// Share of the blocks of a bin that counts as smooth (chosen).
const SMOOTH: f64 = 0.3;
/// The number of blocks that a bin needs before, and after, the smooth ones are chosen (chosen).
const LEAST: [usize; 2] = [20, 10];
/// A block of the image in normal light with this code or more is near clipping, where noise is cut off (chosen).
const BRIGHT: u8 = 250;
/// Darkest clean code of a block after the exposure drop: below it, rounding leaves no spread (chosen).
const DARKEST: f64 = 1.0;
/// Least spread in codes; rounding destroys smaller ones (chosen).
const LEAST_SPREAD: f64 = 0.05;

/// Blocks of 8 × 8 pixels that are smooth in the image in normal light, by their clean code after the exposure drop.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SmoothBlocks {
    /// Indices of the smooth blocks of each bin, row by row over the image; empty for a bin with too few blocks.
    bins: [Vec<usize>; BINS],
}

/// Spread of the green codes in the smooth blocks, bin by bin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpreadCurve {
    /// ln of the root mean square of the spreads in codes; `None` for a bin with too few blocks.
    pub(super) bins: [Option<f64>; BINS],
}

/// Properties of a block in normal light that decide whether it is used.
struct BlockLight {
    index: usize,
    /// Mean code after the exposure drop.
    code: f64,
    spread: f64,
}

impl SmoothBlocks {
    /// Smooth blocks of an image in normal light whose partner is `drop_ev` EV darker.
    #[must_use]
    pub fn new(normal: &Rgb, drop_ev: f64) -> Self {
        let dropped = libm::exp2(-drop_ev / 2.2);
        let blocks: Vec<BlockLight> = (0..count(normal))
            .filter_map(|index| {
                let block = Block::new(normal, index);
                let code = block.mean() * dropped;
                let is_used = block.brightest() < f64::from(BRIGHT) && code > DARKEST;
                is_used.then(|| BlockLight {
                    index,
                    code,
                    spread: block.spread(),
                })
            })
            .collect();
        let mut codes: Vec<f64> = blocks.iter().map(|block| block.code).collect();
        codes.sort_by(f64::total_cmp);
        let edges: Vec<f64> = (1..BINS)
            .filter_map(|edge| quantile(&codes, edge as f64 / BINS as f64))
            .collect();
        let mut bins: [Vec<&BlockLight>; BINS] = Default::default();
        for block in &blocks {
            // A code on an edge belongs to the bin above it.
            let bin = edges.iter().filter(|edge| **edge <= block.code).count();
            bins[bin].push(block);
        }
        Self {
            bins: bins.map(|blocks| smoothest(&blocks)),
        }
    }

    /// Spread of an image in these blocks. It has the size of the image that they were chosen in.
    #[must_use]
    pub fn spread(&self, image: &Rgb) -> SpreadCurve {
        SpreadCurve {
            bins: self.bins.each_ref().map(|blocks| {
                let mean = blocks
                    .iter()
                    .map(|index| Block::new(image, *index).spread().powi(2))
                    .sum::<f64>()
                    / blocks.len() as f64;
                (!blocks.is_empty()).then(|| libm::log(mean.sqrt().max(LEAST_SPREAD)))
            }),
        }
    }
}

/// Indices of the blocks with the least spread; none if there are too few.
fn smoothest(blocks: &[&BlockLight]) -> Vec<usize> {
    let [least, least_smooth] = LEAST;
    if blocks.len() < least {
        return Vec::new();
    }
    let mut spreads: Vec<f64> = blocks.iter().map(|block| block.spread).collect();
    spreads.sort_by(f64::total_cmp);
    let most = quantile(&spreads, SMOOTH).unwrap_or_default();
    let smooth: Vec<usize> = blocks
        .iter()
        .filter(|block| block.spread <= most)
        .map(|block| block.index)
        .collect();
    if smooth.len() < least_smooth {
        return Vec::new();
    }
    smooth
}

/// Number of whole blocks of an image.
fn count(image: &Rgb) -> usize {
    (image.height() / SIDE) * (image.width() / SIDE)
}

/// Green codes of a block.
struct Block([[f64; SIDE]; SIDE]);

impl Block {
    /// The block of an index below [`count`].
    fn new(image: &Rgb, index: usize) -> Self {
        let across = image.width() / SIDE;
        let [top, left] = [index / across, index % across].map(|block| block * SIDE);
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

    /// Standard deviation about the plane of least squares, in codes; the plane takes three degrees of freedom.
    fn spread(&self) -> f64 {
        let at = |i: usize| i as f64 - (SIDE - 1) as f64 / 2.0;
        // Σ t² over the block, t being the place in a row or in a column.
        let places = SIDE as f64 * (0..SIDE).map(|i| at(i) * at(i)).sum::<f64>();
        let (mut across, mut down) = (0.0, 0.0);
        for (row, codes) in self.0.iter().enumerate() {
            for (column, code) in codes.iter().enumerate() {
                across += code * at(column);
                down += code * at(row);
            }
        }
        let (mean, across, down) = (self.mean(), across / places, down / places);
        let mut squares = 0.0;
        for (row, codes) in self.0.iter().enumerate() {
            for (column, code) in codes.iter().enumerate() {
                let off = code - mean - across * at(column) - down * at(row);
                squares += off * off;
            }
        }
        (squares / (SIDE * SIDE - 3) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grey ramp from left to right, with a chequered deviation of `texture(column)` codes.
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
    fn a_plane_has_no_spread_and_a_chequer_has_its_own() {
        assert!(Block::new(&ramp(|_| 0), 7).spread() < 1e-12);
        // ±2 about the mean: 4 · 64/61.
        let spread = Block::new(&ramp(|_| 4), 7).spread();
        assert!(
            (spread - f64::sqrt(4.0 * 64.0 / 61.0)).abs() < 0.02,
            "{spread}"
        );
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
        assert_eq!(curve.bins, [Some(libm::log(LEAST_SPREAD)); BINS]);
        let noisy = smooth.spread(&ramp(|_| 4));
        assert!(
            noisy
                .bins
                .iter()
                .all(|ln| (ln.unwrap() - 0.717).abs() < 0.02)
        );
    }

    #[test]
    fn dark_bright_and_few_blocks_are_left_out() {
        let white = Rgb::new(160, 240, vec![255; 160 * 240 * 3]).unwrap();
        let black = Rgb::black(160, 240);
        for image in [white, black, Rgb::black(7, 7)] {
            let curve = SmoothBlocks::new(&image, 1.0).spread(&image);
            assert_eq!(curve.bins, [None; BINS]);
        }
    }
}
