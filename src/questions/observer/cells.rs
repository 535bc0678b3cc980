//! Geometry of the contrast measurements: [`Cells`] of a frame, and [`Element`]s of its outlines at three scales.
//!
//! The frame is cut into square cells. The pixels of one mask in one cell form a patch. A cell of the second or third
//! scale consists of four or sixteen of the smallest cells, so that its sums are sums of theirs. A cell of the coarsest
//! scale is a tile.

use std::collections::BTreeMap;

/// Number of the smallest cells along the shorter side of the frame (chosen).
const CELLS: usize = 60;

/// Sides of the cells of each scale, relative to the smallest. An observer that knows the signal averages over area:
/// with a single scale, an enhancer that removes noise would appear to add evidence.
pub(super) const SCALES: [usize; 3] = [1, 2, TILE];

/// Side of a tile, relative to the smallest cells.
pub(super) const TILE: usize = 4;

/// Consecutive pixels of a row that belong to one patch.
#[derive(Debug, Clone, Copy)]
pub(super) struct Run {
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
pub(super) struct Element {
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
pub(super) struct Scale {
    /// Index of the patch of this scale that contains each patch of the smallest cells.
    pub(super) part_of: Vec<u32>,
    pub(super) patches: Vec<Patch>,
    /// Number of cells.
    pub(super) cells: usize,
    /// Elements, sorted by cell and mask.
    pub(super) elements: Vec<Element>,
}

/// Cells of a frame.
#[derive(Debug)]
pub(super) struct Cells {
    /// Side of the smallest cells, in pixels.
    pub(super) side: usize,
    /// Runs of all pixels, row by row.
    pub(super) runs: Vec<Run>,
    /// Number of masks.
    pub(super) masks: usize,
    /// Scales, the finest first.
    pub(super) scales: [Scale; 3],
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
            scales: SCALES.map(|scale| Scale::from_patches(&patches, columns, side, scale)),
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
fn cut(masks: &[u32], width: usize, side: usize) -> (Vec<Run>, Vec<Patch>) {
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
            found.into_iter().map(|(column, mask, length)| Run { patch: numbers[&(column, mask)] as u32, length }),
        );
    }
    (runs, patches)
}

impl Scale {
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
fn elements(patches: &[Patch], cells: usize, side: usize, tile_of: impl Fn(usize) -> usize) -> Vec<Element> {
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
            (patch.mask > 0 && patch.count.min(outside) >= min_pixels).then(|| Element {
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
