//! [`Outline`]: comparison of the contrast along each outline with the one that the untouched frame predicts.
//!
//! In each element (the pixels of a mask, and all others, in one cell) the difference of the means is compared with the
//! predicted one: a matched filter whose template is the prediction, whitened by measured variances. Its amplitude is 1
//! for the predicted contrast and 0 for none; its detectability d′ is the signal-to-noise ratio of the prediction.
//! Noise is neither white nor independent along an outline. Two factors correct for this, each measured in the same
//! image from the residual of the contrasts, and never below 1. They are measured separately for disturbed tiles, so
//! that an object that covers a part of the image changes nothing elsewhere.

use super::cells::{Cells, Element, Scale};
use super::channel::{Fit, ROUNDING, TileFit};
use darkqa_base::types::Rgb;

/// z that normal noise exceeds with probability 0.001 / 3: one false alarm in a thousand tests, over three scales
/// (chosen).
pub(super) const THRESHOLD: f64 = 3.402_932_835_385_304_3;

/// Minimum amplitude: nearer to the predicted contrast (1) than to none (0).
const MIN_AMPLITUDE: f64 = 0.5;

/// Minimum share of confirmed elements of the outline of a seen object (chosen).
pub(super) const MIN_CONFIRMED: f64 = 0.5;

/// Minimum number of elements of an object for a coarser scale to count, so that one lucky element is not enough
/// (chosen). The finest scale always counts.
const MIN_ELEMENTS: u32 = 3;

/// Scale of fixed-point numbers, with 16 fractional bits. Fixed-point sums are exact and do not depend on the order.
const FIXED: f64 = 65_536.0;

/// Sums over the pixels of a patch, by channel.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PatchSums {
    /// Received codes.
    pub(super) received: [u64; 3],
    /// Predicted codes and variances, in fixed point.
    predicted: [[u64; 2]; 3],
}

impl PatchSums {
    pub(super) fn add(&mut self, other: &Self) {
        for channel in 0..3 {
            self.received[channel] += other.received[channel];
            for part in 0..2 {
                self.predicted[channel][part] += other.predicted[channel][part];
            }
        }
    }

    /// Means of received codes, predicted codes and variances of a channel, over `count` pixels.
    pub(super) fn means(&self, channel: usize, count: f64) -> [f64; 3] {
        let [predicted, variance] = self.predicted[channel];
        [self.received[channel] as f64 / count, predicted as f64 / FIXED / count, variance as f64 / FIXED / count]
    }

    /// Returns the sums without those of a part.
    fn without(&self, part: &Self) -> Self {
        Self {
            received: [0, 1, 2].map(|i| self.received[i].saturating_sub(part.received[i])),
            predicted: [0, 1, 2].map(|i| [0, 1].map(|j| self.predicted[i][j].saturating_sub(part.predicted[i][j]))),
        }
    }
}

/// Sums over the patches of the smallest cells.
pub(super) fn patch_sums(cells: &Cells, untouched: &[u8], fit: &Fit, image: &Rgb) -> Vec<PatchSums> {
    let tables: [[[u32; 2]; 256]; 3] = [0, 1, 2].map(|channel| {
        let fit = &fit.channels[channel];
        // The conversion to an integer saturates; curves exceed its range only in light near 0.
        std::array::from_fn(|code| [fit.curve[code], fit.variance[code]].map(|value| (value * FIXED + 0.5) as u32))
    });
    let mut sums = vec![PatchSums::default(); cells.scales[0].patches.len()];
    let (mut untouched, _) = untouched.as_chunks::<3>();
    let (mut received, _) = image.samples().as_chunks::<3>();
    for run in &cells.runs {
        let length = (run.length as usize).min(received.len());
        let (own_untouched, rest) = untouched.split_at(length);
        let (own_received, more) = received.split_at(length);
        (untouched, received) = (rest, more);
        let mut codes = [0_u32; 3];
        let mut fitted = [[0_u64; 2]; 3];
        for (untouched, received) in own_untouched.iter().zip(own_received) {
            for channel in 0..3 {
                let [curve, variance] = tables[channel][usize::from(untouched[channel])];
                codes[channel] += u32::from(received[channel]);
                fitted[channel][0] += u64::from(curve);
                fitted[channel][1] += u64::from(variance);
            }
        }
        sums[run.patch as usize].add(&PatchSums { received: codes.map(u64::from), predicted: fitted });
    }
    sums
}

/// Evidence for the outline of one mask in one image.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Outline {
    /// Largest share of confirmed elements at one scale, from 0 to 1.
    pub(super) confirmed: f64,
    /// Largest z of the whole outline at one scale; 0 if its amplitude is too small at all scales.
    pub(super) z: f64,
}

impl Outline {
    /// True if the object is detected by its whole outline. It does not affect the answers, because clutter may agree
    /// by chance.
    pub(super) fn is_detected(&self) -> bool {
        self.z >= THRESHOLD
    }
}

/// Measures the outline of each mask; index 0 is unused.
pub(super) fn outlines(cells: &Cells, sums: &[PatchSums], tiles: &[TileFit]) -> Vec<Outline> {
    let mut outlines = vec![Outline::default(); cells.masks + 1];
    for (index, scale) in cells.scales.iter().enumerate() {
        let min_elements = if index == 0 { 1 } else { MIN_ELEMENTS };
        measure_scale(scale, sums, tiles, min_elements, &mut outlines);
    }
    outlines
}

/// Contrast of an element in one channel.
#[derive(Debug, Clone, Copy)]
struct Contrast {
    /// Difference of the received means, in codes.
    received: f64,
    /// Difference of the predicted means, in codes.
    predicted: f64,
    /// Variance of the received difference, if the noise were white, in codes squared.
    variance: f64,
}

/// Matched filter of an element or an outline: sums over the channels, with p the predicted contrast, d the received
/// contrast and v its variance.
#[derive(Debug, Clone, Copy, Default)]
struct MatchedFilter {
    /// Σ p d / v: output of the filter.
    output: f64,
    /// Σ p² / v: power of the prediction.
    power: f64,
    /// Σ p (d − p) / v: residual.
    residual: f64,
}

impl MatchedFilter {
    fn add(&mut self, other: &Self) {
        self.output += other.output;
        self.power += other.power;
        self.residual += other.residual;
    }

    /// z of the filter if its variance is `inflation` times its power; `None` without power or if the amplitude is too
    /// small.
    fn z(&self, inflation: f64) -> Option<f64> {
        let is_strong_enough = self.power > 0.0 && self.output >= MIN_AMPLITUDE * self.power;
        is_strong_enough.then(|| self.output / (inflation * self.power).sqrt())
    }
}

/// Measures the elements of one scale and updates the outlines that they confirm better than the other scales.
fn measure_scale(scale: &Scale, sums: &[PatchSums], tiles: &[TileFit], min_elements: u32, outlines: &mut [Outline]) {
    let filters = filters(scale, sums, tiles);
    let mut whole = vec![MatchedFilter::default(); outlines.len()];
    for (element, filter) in scale.elements.iter().zip(&filters) {
        whole[element.mask as usize].add(filter);
    }
    let single = [false, true].map(|is_disturbed| {
        inflation(
            scale
                .elements
                .iter()
                .zip(&filters)
                .filter(|(element, _)| tiles[element.tile].is_disturbed == is_disturbed)
                .map(|(_, filter)| filter),
        )
    });
    let shared = inflation(whole.iter());
    let mut counts = vec![[0_u32; 2]; outlines.len()];
    for (element, filter) in scale.elements.iter().zip(&filters) {
        let single = single[usize::from(tiles[element.tile].is_disturbed)];
        let is_confirmed = filter.z(single).is_some_and(|z| z >= THRESHOLD);
        let [confirmed, all] = &mut counts[element.mask as usize];
        *confirmed += u32::from(is_confirmed);
        *all += 1;
    }
    for ((outline, [confirmed, all]), whole) in outlines.iter_mut().zip(counts).zip(&whole) {
        if all >= min_elements {
            let share = f64::from(confirmed) / f64::from(all);
            outline.confirmed = outline.confirmed.max(share);
        }
        outline.z = outline.z.max(whole.z(shared).unwrap_or(0.0));
    }
}

/// Ratio of the scatter of the outputs of filters to the scatter expected from their power; at least 1.
fn inflation<'a>(filters: impl Iterator<Item = &'a MatchedFilter> + Clone) -> f64 {
    let power: f64 = filters.clone().map(|filter| filter.power).sum();
    let squares: f64 = filters.map(|filter| filter.residual * filter.residual).sum();
    if power > 0.0 { (squares / power).max(1.0) } else { 1.0 }
}

/// Returns the filter of each element. The variance of each channel is first scaled by the excess scatter of its
/// contrasts.
fn filters(scale: &Scale, smallest: &[PatchSums], tiles: &[TileFit]) -> Vec<MatchedFilter> {
    let mut sums = vec![PatchSums::default(); scale.patches.len()];
    for (part, whole) in smallest.iter().zip(&scale.part_of) {
        sums[*whole as usize].add(part);
    }
    let mut totals = vec![PatchSums::default(); scale.cells];
    for (patch, sums) in scale.patches.iter().zip(&sums) {
        totals[patch.cell].add(sums);
    }
    let contrasts: Vec<[Contrast; 3]> = scale
        .elements
        .iter()
        .map(|element| {
            let [inside, cell] = [&sums[element.patch], &totals[element.cell]];
            contrast(element, inside, cell, &tiles[element.tile])
        })
        .collect();
    let elements = scale.elements.iter().zip(&contrasts);
    let excess = [false, true].map(|is_disturbed| {
        let alike = elements.clone().filter(|(element, _)| tiles[element.tile].is_disturbed == is_disturbed);
        [0, 1, 2].map(|channel| excess(alike.clone().map(|(_, contrast)| contrast[channel])))
    });
    elements
        .map(|(element, contrast)| {
            let excess = excess[usize::from(tiles[element.tile].is_disturbed)];
            let mut filter = MatchedFilter::default();
            for (contrast, excess) in contrast.iter().zip(excess) {
                let (predicted, variance) = (contrast.predicted, contrast.variance * excess);
                filter.add(&MatchedFilter {
                    output: predicted * contrast.received / variance,
                    power: predicted * predicted / variance,
                    residual: predicted * (contrast.received - predicted) / variance,
                });
            }
            filter
        })
        .collect()
}

/// Ratio of the scatter of contrasts around the predicted ones to the scatter expected from their variances; at least
/// 1.
fn excess(contrasts: impl Iterator<Item = Contrast>) -> f64 {
    let [sum, count] = contrasts.fold([0.0, 0.0], |[sum, count], contrast| {
        let residual = contrast.received - contrast.predicted;
        [sum + residual * residual / contrast.variance, count + 1.0]
    });
    (sum / f64::max(count, 1.0)).max(1.0)
}

/// Contrast of an element in each channel.
fn contrast(element: &Element, inside: &PatchSums, cell: &PatchSums, tile: &TileFit) -> [Contrast; 3] {
    let outside = cell.without(inside);
    [0, 1, 2].map(|channel| {
        let [received, predicted, noise] = inside.means(channel, element.inside);
        let [around, expected, noise_around] = outside.means(channel, element.outside);
        let (gain, scale) = (tile.gain[channel], tile.noise[channel]);
        Contrast {
            received: received - around,
            predicted: gain * (predicted - expected),
            variance: (scale * noise).max(ROUNDING) / element.inside
                + (scale * noise_around).max(ROUNDING) / element.outside,
        }
    })
}
