//! Geometry of the contrast measurements: [`Cells`] of a frame, and [`OutlineElement`]s of its outlines at three scales.
//!
//! The frame is cut into square cells. The pixels of one mask in one cell form a patch. A cell of the second or third
//! scale consists of four or sixteen of the smallest cells, so that its sums are sums of theirs. A cell of the coarsest
//! scale is a tile.
//!
//! [`Outline`]: comparison of the contrast along each outline with the one that the untouched frame predicts.
//!
//! In each element (the pixels of a mask, and all others, in one cell) the difference of the means is compared with the
//! predicted one: a matched filter whose template is the prediction, whitened by measured variances. Its amplitude is 1
//! for the predicted contrast and 0 for none; its detectability d′ is the signal-to-noise ratio of the prediction.
//! Noise is neither white nor independent along an outline. Two factors correct for this, each measured in the same
//! image from the residual of the contrasts, and never below 1. They are measured separately for disturbed tiles, so
//! that an object that covers a part of the image changes nothing elsewhere.

use std::collections::BTreeMap;

use super::local::{ImageFit, ROUNDING, TileFit};
use darkqa_base::types::Rgb;

/// Number of the smallest cells along the shorter side of the frame (chosen).
const CELLS: usize = 60;

/// Sides of the cells of each scale, relative to the smallest. An observer that knows the signal averages over area:
/// with a single scale, an enhancer that removes noise would appear to add evidence.
pub(super) const SCALES: [usize; 3] = [1, 2, TILE];

/// Side of a tile, relative to the smallest cells.
pub(super) const TILE: usize = 4;

/// Consecutive pixels of a row that belong to one patch.
#[derive(Debug, Clone, Copy)]
pub(super) struct PixelRun {
    pub(super) patch: u32,
    pub(super) length: u32,
}

/// Pixels of one mask in one cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Patch {
    /// Index of the cell at the scale of the patch.
    pub(super) cell: usize,
    /// Mask, from 1; 0 for pixels without a mask.
    pub(super) mask: u32,
    /// Number of pixels.
    pub(super) count: u32,
}

/// An element of an outline: a mask and all other pixels in one cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct OutlineElement {
    /// Index of the patch of the mask.
    pub(super) patch: usize,
    /// Index of the cell.
    pub(super) cell: usize,
    /// Index of the tile that contains the cell.
    pub(super) tile: usize,
    /// The mask, from 1.
    pub(super) mask: u32,
    /// Number of pixels of the mask in the cell.
    pub(super) inside: f64,
    /// Number of the other pixels in the cell.
    pub(super) outside: f64,
}

/// Patches and elements at one scale.
#[derive(Debug)]
pub(super) struct PatchScale {
    /// Index of the patch of this scale that contains each patch of the smallest cells.
    pub(super) part_of: Vec<u32>,
    pub(super) patches: Vec<Patch>,
    /// Number of cells.
    pub(super) cells: usize,
    /// Elements, sorted by cell and mask.
    pub(super) elements: Vec<OutlineElement>,
}

/// Cells of a frame.
#[derive(Debug)]
pub(super) struct Cells {
    /// Side of the smallest cells, in pixels.
    pub(super) side: usize,
    /// Runs of all pixels, row by row.
    pub(super) runs: Vec<PixelRun>,
    /// Number of masks.
    pub(super) masks: usize,
    /// Scales, the finest first.
    pub(super) scales: [PatchScale; 3],
}

impl Cells {
    /// Cuts a map of masks with this width and height into cells.
    pub(super) fn from_masks(masks: &[u32], [width, height]: [usize; 2]) -> Self {
        let side = (width.min(height) / CELLS).next_multiple_of(2).max(4);
        let (runs, patches) = cut(masks, width, side);
        let columns = width.div_ceil(side);
        Self {
            side,
            runs,
            masks: masks.iter().max().map_or(0, |mask| *mask as usize),
            scales: SCALES.map(|scale| PatchScale::from_patches(&patches, columns, side, scale)),
        }
    }

    /// Mask of each pixel.
    pub(super) fn mask_of_pixels(&self) -> Vec<u32> {
        let patches = &self.scales[0].patches;
        self.runs
            .iter()
            .flat_map(|run| std::iter::repeat_n(patches[run.patch as usize].mask, run.length as usize))
            .collect()
    }
}

/// Returns the runs of all pixels, and the patches of the smallest cells, sorted by cell and mask.
fn cut(masks: &[u32], width: usize, side: usize) -> (Vec<PixelRun>, Vec<Patch>) {
    let columns = width.div_ceil(side);
    let (mut runs, mut patches) = (Vec::new(), Vec::<Patch>::new());
    for (band, rows) in masks.chunks(width.max(1) * side).enumerate() {
        // Pixels of each mask in each cell of this row of cells.
        let mut counts = BTreeMap::<(usize, u32), u32>::new();
        let mut found: Vec<(usize, u32, u32)> = Vec::new();
        for row in rows.chunks(width) {
            for (column, cell) in row.chunks(side).enumerate() {
                for run in cell.chunk_by(|a, b| a == b) {
                    let (mask, length) = (run[0], run.len() as u32);
                    *counts.entry((column, mask)).or_default() += length;
                    found.push((column, mask, length));
                }
            }
        }
        let first = patches.len();
        patches.extend(counts.iter().map(|(&(column, mask), &count)| Patch {
            cell: band * columns + column,
            mask,
            count,
        }));
        let numbers: BTreeMap<(usize, u32), usize> = counts.into_keys().zip(first..).collect();
        runs.extend(
            found.into_iter().map(|(column, mask, length)| PixelRun { patch: numbers[&(column, mask)] as u32, length }),
        );
    }
    (runs, patches)
}

impl PatchScale {
    /// Merges the patches of the smallest cells into cells of `scale` times their side.
    fn from_patches(smallest: &[Patch], columns: usize, side: usize, scale: usize) -> Self {
        let scale_columns = columns.div_ceil(scale);
        let cell_of = |cell: usize| cell / columns / scale * scale_columns + cell % columns / scale;
        let mut counts = BTreeMap::<(usize, u32), u32>::new();
        for patch in smallest {
            *counts.entry((cell_of(patch.cell), patch.mask)).or_default() += patch.count;
        }
        let numbers: BTreeMap<(usize, u32), usize> = counts.keys().copied().zip(0..).collect();
        let part_of = smallest.iter().map(|patch| numbers[&(cell_of(patch.cell), patch.mask)] as u32).collect();
        let patches: Vec<Patch> = counts.into_iter().map(|((cell, mask), count)| Patch { cell, mask, count }).collect();
        let cells = patches.last().map_or(0, |last| last.cell + 1);
        Self {
            elements: elements(&patches, cells, side * scale, |cell| {
                let finer = TILE / scale;
                cell / scale_columns / finer * columns.div_ceil(TILE) + cell % scale_columns / finer
            }),
            part_of,
            patches,
            cells,
        }
    }
}

/// Returns the elements: patches for which the mask and the other pixels each cover at least 1/16 of the cell and three
/// pixels.
fn elements(patches: &[Patch], cells: usize, side: usize, tile_of: impl Fn(usize) -> usize) -> Vec<OutlineElement> {
    let min_pixels = (side * side / 16).max(3) as u32;
    let mut totals = vec![0; cells];
    for patch in patches {
        totals[patch.cell] += patch.count;
    }
    patches
        .iter()
        .enumerate()
        .filter_map(|(index, patch)| {
            let outside = totals[patch.cell] - patch.count;
            (patch.mask > 0 && patch.count.min(outside) >= min_pixels).then(|| OutlineElement {
                patch: index,
                cell: patch.cell,
                tile: tile_of(patch.cell),
                mask: patch.mask,
                inside: f64::from(patch.count),
                outside: f64::from(outside),
            })
        })
        .collect()
}

/// z that normal noise exceeds with probability 0.001 / 3: one false alarm in a thousand tests, over three scales
/// (chosen).
const THRESHOLD: f64 = 3.402_932_835_385_304_3;

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
pub(super) fn patch_sums(cells: &Cells, untouched: &[u8], fit: &ImageFit, image: &Rgb) -> Vec<PatchSums> {
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
struct ElementContrast {
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
fn measure_scale(
    scale: &PatchScale,
    sums: &[PatchSums],
    tiles: &[TileFit],
    min_elements: u32,
    outlines: &mut [Outline],
) {
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
fn filters(scale: &PatchScale, smallest: &[PatchSums], tiles: &[TileFit]) -> Vec<MatchedFilter> {
    let mut sums = vec![PatchSums::default(); scale.patches.len()];
    for (part, whole) in smallest.iter().zip(&scale.part_of) {
        sums[*whole as usize].add(part);
    }
    let mut totals = vec![PatchSums::default(); scale.cells];
    for (patch, sums) in scale.patches.iter().zip(&sums) {
        totals[patch.cell].add(sums);
    }
    let contrasts: Vec<[ElementContrast; 3]> = scale
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
fn excess(contrasts: impl Iterator<Item = ElementContrast>) -> f64 {
    let [sum, count] = contrasts.fold([0.0, 0.0], |[sum, count], contrast| {
        let residual = contrast.received - contrast.predicted;
        [sum + residual * residual / contrast.variance, count + 1.0]
    });
    (sum / f64::max(count, 1.0)).max(1.0)
}

/// Contrast of an element in each channel.
fn contrast(element: &OutlineElement, inside: &PatchSums, cell: &PatchSums, tile: &TileFit) -> [ElementContrast; 3] {
    let outside = cell.without(inside);
    [0, 1, 2].map(|channel| {
        let [received, predicted, noise] = inside.means(channel, element.inside);
        let [around, expected, noise_around] = outside.means(channel, element.outside);
        let (gain, scale) = (tile.gain[channel], tile.noise[channel]);
        ElementContrast {
            received: received - around,
            predicted: gain * (predicted - expected),
            variance: (scale * noise).max(ROUNDING) / element.inside
                + (scale * noise_around).max(ROUNDING) / element.outside,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_count_every_pixel_at_every_scale() {
        let [width, height] = [37, 29];
        let masks: Vec<u32> = (0..width * height).map(|i: usize| (i % width / 9 + i / width / 11) as u32 % 3).collect();
        let cells = Cells::from_masks(&masks, [width, height]);
        assert_eq!(cells.side, 4);
        assert_eq!(cells.mask_of_pixels(), masks);
        for (scale, times) in cells.scales.iter().zip(SCALES) {
            let side = cells.side * times;
            let mut counts = BTreeMap::<(usize, u32), u32>::new();
            for (i, mask) in masks.iter().enumerate() {
                let cell = i / width / side * width.div_ceil(side) + i % width / side;
                *counts.entry((cell, *mask)).or_default() += 1;
            }
            let found: BTreeMap<(usize, u32), u32> =
                scale.patches.iter().map(|patch| ((patch.cell, patch.mask), patch.count)).collect();
            assert_eq!(found, counts);
            assert!(scale.elements.iter().all(|element| element.mask > 0));
        }
    }

    #[test]
    fn frames_without_an_outline_have_no_element() {
        for (masks, size) in [(vec![], [0, 0]), (vec![1], [1, 1]), (vec![1; 400], [20, 20]), (vec![0; 400], [20, 20])] {
            let cells = Cells::from_masks(&masks, size);
            assert!(cells.scales.iter().all(|scale| scale.elements.is_empty()));
        }
    }
}
