//! The colour of a thing in the untouched frame, inferred from the received pixels: [`Shade`].

use super::cells::Cells;
use super::channel::{ChannelFit, Fit};
use super::outlines::{PatchSums, ROUNDING};
use crate::colors::{Color, Palette};

/// Largest standard deviation of an inferred code with which a colour is named, in codes (chosen).
const MAX_DEVIATION: f64 = 48.0;

/// Ratio of the standard deviation of normal numbers to their median absolute deviation.
const DEVIATION: f64 = 1.4826;

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

/// Posterior of the untouched colour of a thing.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shade([Posterior; 3]);

impl Shade {
    /// The shade of a mask; `None` if it has an eighth of no cell.
    pub(super) fn of(cells: &Cells, sums: &[PatchSums], fit: &Fit, mask: u32) -> Option<Self> {
        let least = (cells.side * cells.side / 8).max(3) as u32;
        let patches = cells.scales[0].patches.iter().zip(sums);
        let patches = patches.filter(|(patch, _)| patch.mask == mask && patch.count >= least);
        let means: Vec<[f64; 3]> = patches
            .map(|(patch, sums)| sums.received.map(|sum| sum as f64 / f64::from(patch.count)))
            .collect();
        (!means.is_empty()).then(|| {
            Self([0, 1, 2].map(|channel| {
                let means = means.iter().map(|means| means[channel]).collect();
                Posterior::of(&fit.channels[channel], means)
            }))
        })
    }

    /// The most probable of the offered colours. `None` if a channel is too uncertain, or none of them is possible.
    pub(super) fn name(&self, palette: &Palette, offered: &[Color]) -> Option<Color> {
        if self
            .0
            .iter()
            .any(|channel| channel.deviation > MAX_DEVIATION)
        {
            return None;
        }
        let codes = [0, 1, 2].map(|channel| self.0[channel].mean as u8);
        let first = palette.color(codes).filter(|color| offered.contains(color));
        first.or_else(|| self.most_probable(palette, offered))
    }

    /// The offered colour with the most posterior mass; of several, the first.
    fn most_probable(&self, palette: &Palette, offered: &[Color]) -> Option<Color> {
        let mut masses = vec![0.0; offered.len()];
        let [red, green, blue] = &self.0;
        let code = |block: usize| (block * (256 / BLOCKS)) as u8;
        for (r, red) in red.blocks.iter().enumerate() {
            for (g, green) in green.blocks.iter().enumerate() {
                for (b, blue) in blue.blocks.iter().enumerate() {
                    let color = palette.color([code(r), code(g), code(b)]);
                    let place = offered.iter().position(|offered| Some(*offered) == color);
                    if let Some(place) = place {
                        masses[place] += red * green * blue;
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
    /// The posterior of the code behind the median of these means, with a flat prior over all codes.
    fn of(fit: &ChannelFit, mut means: Vec<f64>) -> Self {
        let middle = median(&mut means);
        let mut distances: Vec<f64> = means.iter().map(|mean| (mean - middle).abs()).collect();
        let error = DEVIATION * median(&mut distances) * MEDIAN_ERROR / (means.len() as f64).sqrt();
        let variance = ROUNDING + error * error;
        let distance = |code: usize| (middle - fit.curve[code]) * (middle - fit.curve[code]);
        let mut likelihood: [f64; 256] =
            std::array::from_fn(|code| libm::exp(-0.5 * distance(code) / variance));
        let mut sum: f64 = likelihood.iter().sum();
        if sum <= 1e-12 {
            let nearest = (0..256).min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
            likelihood = [0.0; 256];
            likelihood[nearest.unwrap_or(0)] = 1.0;
            sum = 1.0;
        }
        for value in &mut likelihood {
            *value /= sum;
        }
        let codes = || {
            likelihood
                .iter()
                .zip(0_u16..)
                .map(|(p, code)| (p, f64::from(code)))
        };
        let mean: f64 = codes().map(|(p, code)| p * code).sum();
        let variance: f64 = codes()
            .map(|(p, code)| p * (code - mean) * (code - mean))
            .sum();
        let (blocks, _) = likelihood.as_chunks::<{ 256 / BLOCKS }>();
        Self {
            mean,
            deviation: variance.sqrt(),
            blocks: std::array::from_fn(|block| blocks[block].iter().sum()),
        }
    }
}

/// The median; of an even number of values, the mean of the middle two; 0 without values.
fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => 0.0,
        n if n % 2 == 1 => values[n / 2],
        n => f64::midpoint(values[n / 2 - 1], values[n / 2]),
    }
}
