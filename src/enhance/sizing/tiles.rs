//! Division of an image into tiles ([`TilePlan`], [`TileWindow`]), and the image made of their results
//! ([`TiledImage`]).
//!
//! Each tile is enhanced with some context around it, and only its middle is used (like Real-ESRGAN's `tile_pad`),
//! without blending. The result is exact if pixels depend on nothing beyond the context. To check this, the used parts
//! of neighbours overlap by a few pixels ([`GUARD`] on either side); if these differ, pixels depend on more than the
//! context.

use std::fmt;
use std::num::NonZeroUsize;
use std::str::FromStr;

use darkqa_base::types::Rgb;

/// Number of pixels beyond a seam that a tile provides for the comparison; chosen.
const GUARD: usize = 2;

/// Maximum code of samples that count as nearly black, so that their equality proves little; chosen.
const NEARLY_BLACK: u8 = 2;

/// Rectangle of an image, in pixels. `right` and `bottom` are exclusive and may lie outside the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TileWindow {
    pub(crate) left: usize,
    pub(crate) top: usize,
    pub(crate) right: usize,
    pub(crate) bottom: usize,
}

impl TileWindow {
    /// The whole of an image of this height and width.
    pub(crate) fn whole([height, width]: [usize; 2]) -> Self {
        Self { left: 0, top: 0, right: width, bottom: height }
    }

    /// Height and width in pixels.
    pub(crate) fn size(self) -> [usize; 2] {
        [self.bottom - self.top, self.right - self.left]
    }
}

/// Division of images into tiles (`--llie-options tile`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tiling {
    /// Tiles if they are known to be exact and the image is large; else the whole image.
    #[default]
    Auto,
    /// Tiles of this side in pixels, context included.
    Side(NonZeroUsize),
    /// The whole image at once.
    Whole,
}

impl fmt::Display for Tiling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Side(side) => side.fmt(f),
            Self::Whole => f.write_str("whole"),
        }
    }
}

impl FromStr for Tiling {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "whole" => Ok(Self::Whole),
            side => side.parse().map(Self::Side).map_err(|_| "expected a side in pixels, whole or auto".to_owned()),
        }
    }
}

/// Extent of a tile along one side: the pixels fed to the model, and the pixels used of its output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TileSpan {
    pub(super) input_start: usize,
    pub(super) input_end: usize,
    pub(super) output_start: usize,
    pub(super) output_end: usize,
}

impl TileWindow {
    /// Part of the image that is fed to the model for a tile.
    pub(crate) fn for_input(row: TileSpan, column: TileSpan) -> Self {
        Self { left: column.input_start, top: row.input_start, right: column.input_end, bottom: row.input_end }
    }

    /// Part of a tile's output that is used, relative to its input.
    pub(crate) fn for_output(row: TileSpan, column: TileSpan) -> Self {
        Self {
            left: column.output_start - column.input_start,
            top: row.output_start - row.input_start,
            right: column.output_end - column.input_start,
            bottom: row.output_end - row.input_start,
        }
    }
}

/// All tiles of an image, as rows and columns.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct TilePlan {
    rows: Vec<TileSpan>,
    columns: Vec<TileSpan>,
}

/// Area, size and context of tiles, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TileGeometry {
    /// Height and width of the area that the tiles cover.
    pub(crate) area: [usize; 2],
    /// Largest height and width of a tile, context included.
    pub(super) tile: [usize; 2],
    /// Number of pixels around the used part that are fed, too.
    pub(crate) context: usize,
    /// Multiple of pixels at which tiles start.
    pub(super) multiple: usize,
}

impl TilePlan {
    /// The tiles of an area; `None` if a tile is not larger than its context.
    pub(super) fn new(geometry: TileGeometry) -> Option<Self> {
        let TileGeometry { area, tile, context, multiple } = geometry;
        Some(Self {
            rows: spans(area[0], tile[0], context, multiple)?,
            columns: spans(area[1], tile[1], context, multiple)?,
        })
    }

    /// Tiles row by row, each as its vertical and horizontal extent.
    pub(crate) fn tiles(&self) -> impl Iterator<Item = (TileSpan, TileSpan)> {
        self.rows.iter().flat_map(|row| self.columns.iter().map(|column| (*row, *column)))
    }

    /// Number of tiles in rows and columns.
    pub(crate) fn count(&self) -> usize {
        self.rows.len() * self.columns.len()
    }
}

/// Tiles along one side, all of the same length and within the image. Each edge of a tile is an edge of the image, or
/// is separated from the used part by the context. `None` if the context leaves no used part.
fn spans(length: usize, tile: usize, context: usize, multiple: usize) -> Option<Vec<TileSpan>> {
    let tile = tile.min(length);
    let step = tile.checked_sub(2 * (context + GUARD));
    let step = step.map_or(0, |step| step / multiple * multiple);
    if step == 0 && tile < length {
        return None;
    }
    let mut spans = Vec::new();
    let mut start = 0;
    loop {
        let end = start + tile;
        spans.push(TileSpan {
            input_start: start,
            input_end: end,
            output_start: if start == 0 { 0 } else { start + context },
            output_end: if end == length { length } else { end - context },
        });
        if end == length {
            return Some(spans);
        }
        start = (start + step).min(length - tile);
    }
}

/// Image that is assembled tile by tile.
pub(crate) struct TiledImage {
    rgb: Rgb,
    /// Row at which the output of the row of tiles above ends.
    above_end: usize,
    /// Column at which the output of the tile to the left ends.
    left_end: usize,
    seam: Seam,
}

/// Comparison of the pixels that neighbouring tiles have in common.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Seam {
    /// Number of samples that both tiles contain.
    pub(super) compared: usize,
    /// Number of those samples that are nearly black in both.
    pub(super) black: usize,
    /// Number of those samples that differ.
    pub(super) differing: usize,
    /// Largest difference, in codes.
    pub(super) max_difference: u8,
}

impl Seam {
    /// True if the overlaps agree: at most one sample in a thousand differs, by one code, because of rounding.
    pub(crate) fn agrees(self) -> bool {
        self.max_difference <= 1 && self.differing * 1000 <= self.compared
    }
}

impl TiledImage {
    pub(crate) fn new([height, width]: [usize; 2]) -> Self {
        Self { rgb: Rgb::black(height, width), above_end: 0, left_end: 0, seam: Seam::default() }
    }

    /// Adds the output of a tile and compares the overlap with earlier tiles; tiles must come row by row.
    pub(crate) fn add(&mut self, row: TileSpan, column: TileSpan, bytes: &[u8]) {
        let width = self.rgb.width();
        if column.output_start == 0 {
            self.left_end = 0;
        }
        let lines = bytes.chunks_exact(3 * (column.output_end - column.output_start));
        for (y, line) in (row.output_start..row.output_end).zip(lines) {
            let start = 3 * (y * width + column.output_start);
            let target = &mut self.rgb.samples_mut()[start..start + line.len()];
            let overlap_end = if y < self.above_end {
                column.output_end
            } else {
                self.left_end.clamp(column.output_start, column.output_end)
            };
            let overlap = 3 * (overlap_end - column.output_start);
            for (a, b) in target[..overlap].iter().zip(&line[..overlap]) {
                self.seam.compared += 1;
                self.seam.black += usize::from((*a).max(*b) <= NEARLY_BLACK);
                self.seam.differing += usize::from(a != b);
                self.seam.max_difference = self.seam.max_difference.max(a.abs_diff(*b));
            }
            target[overlap..].copy_from_slice(&line[overlap..]);
        }
        self.left_end = column.output_end;
        if column.output_end == width {
            self.above_end = row.output_end;
        }
    }

    /// Top left part, of this height and width, of the assembled image, and the comparison of its overlaps.
    pub(crate) fn finish(self, [height, width]: [usize; 2]) -> (Rgb, Seam) {
        let (rgb, seam) = (self.rgb, self.seam);
        if [rgb.height(), rgb.width()] == [height, width] {
            return (rgb, seam);
        }
        let mut part = Rgb::black(height, width);
        let lines = part.samples_mut().chunks_exact_mut(3 * width);
        for (to, from) in lines.zip(rgb.samples().chunks_exact(3 * rgb.width())) {
            to.copy_from_slice(&from[..3 * width]);
        }
        (part, seam)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn tiles_cover_the_side_with_context(
            length in 1..400_usize, tile in 1..200_usize, context in 0..20_usize, multiple in 1..9_usize,
        ) {
            let (length, tile) = (length * multiple, tile * multiple);
            let Some(spans) = spans(length, tile, context, multiple) else {
                prop_assert!(tile < 2 * (context + GUARD) + multiple);
                return Ok(());
            };
            prop_assert_eq!(spans[0].output_start, 0);
            prop_assert_eq!(spans.last().unwrap().output_end, length);
            for span in &spans {
                prop_assert_eq!(span.input_end - span.input_start, tile.min(length));
                prop_assert!(span.input_start % multiple == 0 && span.input_end <= length);
                prop_assert!(span.output_start == 0 || span.output_start - span.input_start >= context);
                prop_assert!(span.output_end == length || span.input_end - span.output_end >= context);
            }
            for pair in spans.windows(2) {
                prop_assert!(pair[0].output_end >= pair[1].output_start + 2 * GUARD);
            }
        }
    }

    /// Assembles an image from tiles. With `shift`, the codes depend on the tile's position, so that seams differ.
    fn assemble(shift: usize) -> (Rgb, Seam) {
        let geometry = TileGeometry { area: [37, 50], tile: [20, 20], context: 3, multiple: 1 };
        let mut canvas = TiledImage::new([37, 50]);
        for (row, column) in TilePlan::new(geometry).unwrap().tiles() {
            let mut bytes = Vec::new();
            for y in row.output_start..row.output_end {
                for x in column.output_start..column.output_end {
                    bytes.extend([(y * 5 + x * 3 + shift * column.input_start) as u8; 3]);
                }
            }
            canvas.add(row, column, &bytes);
        }
        canvas.finish([37, 50])
    }

    #[test]
    fn seams_are_compared() {
        let (image, seam) = assemble(0);
        let expected = (0..37 * 50).flat_map(|i| [(i / 50 * 5 + i % 50 * 3) as u8; 3]);
        assert!(image.samples().iter().copied().eq(expected));
        assert!(seam.agrees() && seam.compared > 1000 && seam.max_difference == 0);
        let (_, seam) = assemble(1);
        assert!(!seam.agrees() && seam.max_difference > 1, "{seam:?}");
    }
}
