//! Untouched colour of an object, inferred from the received pixels and the light of its surroundings:
//! [`ColorPosterior`].

use super::cells::{Cells, PatchSums};
use super::local::{ChannelFit, ImageFit, MIN_GAIN, NormalEquations, ROUNDING};
use super::tiles::Tiles;
use crate::colors::{Color, Palette};

/// Maximum standard deviation of an inferred code for naming a colour, in codes (chosen).
const MAX_DEVIATION: f64 = 48.0;

/// Standard deviation of the Gaussian weights of the surroundings of an object, relative to the longer side of the
/// frame (chosen).
const KERNEL_WIDTH: f64 = 0.125;

/// Ratio of the standard deviation of normal numbers to their median absolute deviation.
const DEVIATION_PER_MAD: f64 = 1.4826;

/// Ratio of the standard error of the median of normal numbers to that of their mean, √(π/2).
const MEDIAN_ERROR: f64 = 1.25;

/// Number of blocks of a channel in the table of colour names, of eight codes each.
const BLOCKS: usize = 32;

/// Posterior of the untouched code of one channel.
#[derive(Debug, Clone, PartialEq)]
struct Posterior {
    mean: f64,
    deviation: f64,
    /// Probability of each block of codes.
    blocks: [f64; BLOCKS],
}

/// Posterior of the untouched colour of an object, for each channel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ColorPosterior([Posterior; 3]);

/// Light on the objects of a frame, estimated from their surroundings. The pixels of the object itself are ignored:
/// otherwise, the estimated light would give each object the expected colour.
pub(super) struct LightEstimate<'a> {
    cells: &'a Cells,
    tiles: &'a Tiles,
    sums: &'a [PatchSums],
    fit: &'a ImageFit,
    /// Patches in tiles that are not disturbed; empty if the light is the same everywhere.
    patches: Vec<TilePatch>,
}

/// Pixels of one mask in one tile.
struct TilePatch {
    mask: u32,
    /// Column and row of the tile.
    tile: [f64; 2],
    pixels: f64,
    /// Mean received code of each channel.
    received: [f64; 3],
    /// Mean predicted code of each channel, in light of gain 1.
    predicted: [f64; 3],
}

/// Light that varies linearly around a center, for each channel. Positions are columns and rows of tiles.
struct LightField {
    center: [f64; 2],
    channels: [[f64; 3]; 3],
}

impl LightField {
    /// Gain of the light in each channel.
    fn gains_at(&self, tile: [f64; 2]) -> [f64; 3] {
        let terms = linear_terms(tile, self.center);
        self.channels.map(|channel| {
            let gain: f64 = channel.iter().zip(terms).map(|(c, term)| c * term).sum();
            gain.max(MIN_GAIN)
        })
    }
}

fn linear_terms(tile: [f64; 2], center: [f64; 2]) -> [f64; 3] {
    [1.0, tile[0] - center[0], tile[1] - center[1]]
}

impl<'a> LightEstimate<'a> {
    pub(super) fn new(cells: &'a Cells, tiles: &'a Tiles, sums: &'a [PatchSums], fit: &'a ImageFit) -> Self {
        let mut light = Self { cells, tiles, sums, fit, patches: Vec::new() };
        if fit.is_local {
            light.patches = light.undisturbed_patches();
        }
        light
    }

    fn undisturbed_patches(&self) -> Vec<TilePatch> {
        let [.., coarsest] = &self.cells.scales;
        let mut sums = vec![PatchSums::default(); coarsest.patches.len()];
        for (part, whole) in self.sums.iter().zip(&coarsest.part_of) {
            sums[*whole as usize].add(part);
        }
        coarsest
            .patches
            .iter()
            .zip(&sums)
            .filter(|(patch, _)| !self.fit.tiles[patch.cell].is_disturbed)
            .map(|(patch, sums)| {
                let pixels = f64::from(patch.count);
                let means = [0, 1, 2].map(|channel| sums.means(channel, pixels));
                TilePatch {
                    mask: patch.mask,
                    tile: self.tiles.column_and_row(patch.cell),
                    pixels,
                    received: means.map(|[received, ..]| received),
                    predicted: means.map(|[_, predicted, _]| predicted),
                }
            })
            .collect()
    }

    /// Infers the colour of a mask; `None` unless it covers at least an eighth of one of the smallest cells.
    pub(super) fn color(&self, mask: u32) -> Option<ColorPosterior> {
        let min_pixels = (self.cells.side * self.cells.side / 8).max(3) as u32;
        let [finest, _, coarsest] = &self.cells.scales;
        // Tile, number of pixels and sums of each patch of the mask.
        let patches: Vec<(usize, f64, &PatchSums)> = finest
            .patches
            .iter()
            .zip(self.sums)
            .zip(&coarsest.part_of)
            .filter(|((patch, _), _)| patch.mask == mask && patch.count >= min_pixels)
            .map(|((patch, sums), part_of)| {
                let tile = coarsest.patches[*part_of as usize].cell;
                (tile, f64::from(patch.count), sums)
            })
            .collect();
        let is_disturbed = |tile: usize| self.fit.tiles[tile].is_disturbed;
        let all_disturbed = patches.iter().all(|(tile, ..)| is_disturbed(*tile));
        let patches: Vec<_> = patches.into_iter().filter(|(tile, ..)| all_disturbed || !is_disturbed(*tile)).collect();
        let positions: Vec<[f64; 2]> = patches.iter().map(|(tile, ..)| self.tiles.column_and_row(*tile)).collect();
        if positions.is_empty() {
            return None;
        }
        let field = self.field_around(mask, &positions);
        let gains: Vec<[f64; 3]> = positions.iter().map(|tile| field.gains_at(*tile)).collect();
        Some(ColorPosterior([0, 1, 2].map(|channel| {
            let means = patches
                .iter()
                .zip(&gains)
                .map(|((_, pixels, sums), gains)| sums.received[channel] as f64 / pixels / gains[channel]);
            let gain = gains.iter().map(|gains| gains[channel]).sum::<f64>() / gains.len() as f64;
            Posterior::new(&self.fit.channels[channel], means.collect(), gain)
        })))
    }

    /// Fits the light around the mean of these positions to the patches of all other masks, by local linear regression
    /// (Cleveland, J. Am. Stat. Assoc. 74:829, 1979).
    fn field_around(&self, mask: u32, positions: &[[f64; 2]]) -> LightField {
        let center = [0, 1].map(|axis| {
            let sum: f64 = positions.iter().map(|position| position[axis]).sum();
            sum / positions.len() as f64
        });
        let rows = self.tiles.len().div_ceil(self.tiles.columns);
        let width = rows.max(self.tiles.columns) as f64 * KERNEL_WIDTH;
        let mut equations = [0, 1, 2].map(|_| NormalEquations::<3>::default());
        for patch in self.patches.iter().filter(|patch| patch.mask != mask) {
            let terms = linear_terms(patch.tile, center);
            let distance = (terms[1] * terms[1] + terms[2] * terms[2]) / (width * width);
            let weight = patch.pixels * libm::exp(-0.5 * distance);
            for (channel, equations) in equations.iter_mut().enumerate() {
                let (received, predicted) = (patch.received[channel], patch.predicted[channel]);
                equations.add(&terms, weight * predicted * predicted, weight * predicted * received);
            }
        }
        LightField { center, channels: equations.map(NormalEquations::solve) }
    }
}

impl ColorPosterior {
    /// Most probable of the offered colours. `None` if a channel is too uncertain, or if no offered colour is possible.
    pub(super) fn name(&self, palette: &Palette, offered: &[Color]) -> Option<Color> {
        if self.0.iter().any(|channel| channel.deviation > MAX_DEVIATION) {
            return None;
        }
        let codes = [0, 1, 2].map(|channel| self.0[channel].mean.round() as u8);
        palette.color(codes).filter(|color| offered.contains(color)).or_else(|| self.most_probable(palette, offered))
    }

    /// Offered colour with the highest posterior probability; the first if several are equal.
    fn most_probable(&self, palette: &Palette, offered: &[Color]) -> Option<Color> {
        let mut masses = vec![0.0; offered.len()];
        let [red, green, blue] = &self.0;
        for (r, red) in red.blocks.iter().enumerate() {
            for (g, green) in green.blocks.iter().enumerate() {
                for (b, blue) in blue.blocks.iter().enumerate() {
                    let color = palette.color([r, g, b].map(|block| (block * (256 / BLOCKS)) as u8));
                    if let Some(index) = offered.iter().position(|other| Some(*other) == color) {
                        masses[index] += red * green * blue;
                    }
                }
            }
        }
        let mut best: Option<(f64, Color)> = None;
        for (mass, color) in masses.into_iter().zip(offered) {
            if mass > best.map_or(0.0, |(most, _)| most) {
                best = Some((mass, *color));
            }
        }
        best.map(|(_, color)| color)
    }
}

impl Posterior {
    /// Computes the posterior of the untouched code for the median of these means, with a flat prior over all codes.
    /// The means are received codes divided by the gain of the light.
    fn new(fit: &ChannelFit, mut means: Vec<f64>, gain: f64) -> Self {
        let middle = median(&mut means);
        let mut distances: Vec<f64> = means.iter().map(|mean| (mean - middle).abs()).collect();
        let error = DEVIATION_PER_MAD * median(&mut distances) * MEDIAN_ERROR / (means.len() as f64).sqrt();
        let variance = ROUNDING / (gain * gain) + error * error;
        let distances: [f64; 256] = std::array::from_fn(|code| {
            let difference = middle - fit.curve[code];
            difference * difference
        });
        let mut likelihood = distances.map(|distance| libm::exp(-0.5 * distance / variance));
        let mut sum: f64 = likelihood.iter().sum();
        if sum <= 1e-12 {
            let nearest = (0..256).min_by(|a, b| distances[*a].total_cmp(&distances[*b]));
            likelihood = [0.0; 256];
            likelihood[nearest.unwrap_or(0)] = 1.0;
            sum = 1.0;
        }
        for value in &mut likelihood {
            *value /= sum;
        }
        let codes = likelihood.iter().zip(0_u16..).map(|(p, code)| (p, f64::from(code)));
        let mean: f64 = codes.clone().map(|(p, code)| p * code).sum();
        let variance: f64 = codes.map(|(p, code)| p * (code - mean) * (code - mean)).sum();
        let (blocks, _) = likelihood.as_chunks::<{ 256 / BLOCKS }>();
        Self { mean, deviation: variance.sqrt(), blocks: std::array::from_fn(|block| blocks[block].iter().sum()) }
    }
}

/// Median, the mean of the middle two for an even number of values; 0 without values.
fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => 0.0,
        n if n % 2 == 1 => values[n / 2],
        n => f64::midpoint(values[n / 2 - 1], values[n / 2]),
    }
}
