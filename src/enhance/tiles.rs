//! An image in tiles, each of which sees a [`TileWindow`] of it: [`TilePlan`], and [`TiledImage`], on which they come together.
//!
//! Each tile is seen with some context and gives its middle ("crop" tiling, as Real-ESRGAN's `tile_pad`): for a model whose
//! pixels depend on nothing beyond the context that is exact, and no blending hides a seam. Neighbours give a few pixels
//! twice ([`GUARD`] on either side), which must agree: where they do not, the model sees farther than was said.

use std::fmt;
use std::num::NonZeroUsize;
use std::str::FromStr;

use crate::types::Rgb;

/// What sides are tried as multiples of, where a model fails on an image's own and nobody says better.
pub(super) const MULTIPLES: [usize; 6] = [1, 4, 8, 12, 16, 32];

/// Pixels beyond a seam that a tile gives too, for the comparison.
pub(super) const GUARD: usize = 2;

/// A part of an image: left, top, right, bottom, the latter two exclusive; right and bottom may lie outside of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TileWindow {
    pub(super) left: usize,
    pub(super) top: usize,
    pub(super) right: usize,
    pub(super) bottom: usize,
}

impl TileWindow {
    /// Height and width.
    pub(super) fn size(self) -> [usize; 2] {
        [self.bottom - self.top, self.right - self.left]
    }
}

/// How an image is cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tiling {
    /// Into tiles where they are known to be exact and the image is large; else not at all.
    #[default]
    Auto,
    /// Into tiles of such a side in pixels, context included.
    Of(NonZeroUsize),
    /// Not at all.
    Whole,
}

impl fmt::Display for Tiling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Of(side) => side.fmt(f),
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
            side => {
                let side = side.parse().map(Self::Of);
                side.map_err(|_| "a side in pixels, whole or auto expected".to_owned())
            }
        }
    }
}

/// A tile along one side: what is seen, and what of it is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TileSpan {
    pub(super) start: usize,
    pub(super) end: usize,
    pub(super) from: usize,
    pub(super) to: usize,
}

impl TileWindow {
    /// What a tile sees of the image.
    pub(super) fn seen(row: TileSpan, column: TileSpan) -> Self {
        Self {
            left: column.start,
            top: row.start,
            right: column.end,
            bottom: row.end,
        }
    }

    /// What is taken of a tile, as a part of what it sees.
    pub(super) fn taken(row: TileSpan, column: TileSpan) -> Self {
        Self {
            left: column.from - column.start,
            top: row.from - row.start,
            right: column.to - column.start,
            bottom: row.to - row.start,
        }
    }
}

/// The tiles of an image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct TilePlan {
    rows: Vec<TileSpan>,
    columns: Vec<TileSpan>,
}

/// How tiles are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Cutting {
    /// Height and width of what they cover.
    pub(super) area: [usize; 2],
    /// Height and width of a tile, at most.
    pub(super) tile: [usize; 2],
    /// What is seen beyond what is taken.
    pub(super) context: usize,
    /// Where tiles may begin: at multiples of this.
    pub(super) multiple: usize,
}

impl TilePlan {
    /// The tiles of an image; `None` where a tile is not larger than its context.
    pub(super) fn of(cut: Cutting) -> Option<Self> {
        let spans = |side: usize| spans(cut.area[side], cut.tile[side], cut.context, cut.multiple);
        Some(Self {
            rows: spans(0)?,
            columns: spans(1)?,
        })
    }

    /// The tiles row by row, each by its spans along both sides.
    pub(super) fn tiles(&self) -> impl Iterator<Item = (TileSpan, TileSpan)> {
        let rows = self.rows.iter();
        rows.flat_map(|row| self.columns.iter().map(|column| (*row, *column)))
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.rows.len() * self.columns.len()
    }
}

/// The tiles along one side: all of one length and within the image, so that the border of a tile is that of the image, with
/// whatever the model makes of it, or lies beyond the context.
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
            start,
            end,
            from: if start == 0 { 0 } else { start + context },
            to: if end == length { length } else { end - context },
        });
        if end == length {
            return Some(spans);
        }
        start = (start + step).min(length - tile);
    }
}

/// The image as tile by tile makes it.
pub(super) struct TiledImage {
    rgb: Rgb,
    /// The end of what the row of tiles above has given.
    above: usize,
    /// That of what the tile to the left has given.
    left: usize,
    seam: Seam,
}

/// What neighbours gave for the same pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Seam {
    /// Samples that both gave.
    pub(super) compared: usize,
    /// Those that differ.
    pub(super) differing: usize,
    /// By how many codes at most.
    pub(super) most: u8,
}

impl Seam {
    /// Whether tiles give what the whole image would: the same bytes, but for one in a thousand that is off by the last bit of
    /// a float, and so by one code.
    pub(super) fn holds(self) -> bool {
        self.most <= 1 && self.differing * 1000 <= self.compared
    }
}

impl TiledImage {
    pub(super) fn new([height, width]: [usize; 2]) -> Self {
        Self {
            rgb: Rgb::black(height, width),
            above: 0,
            left: 0,
            seam: Seam::default(),
        }
    }

    /// Puts what a tile gave into its place, beside what is there already; tiles come row by row.
    pub(super) fn put(&mut self, row: TileSpan, column: TileSpan, bytes: &[u8]) {
        let width = self.rgb.width();
        if column.from == 0 {
            self.left = 0;
        }
        let lines = bytes.chunks_exact(3 * (column.to - column.from));
        for (y, line) in (row.from..row.to).zip(lines) {
            let start = 3 * (y * width + column.from);
            let there = &mut self.rgb.samples_mut()[start..start + line.len()];
            let twice = if y < self.above {
                column.to
            } else {
                self.left.clamp(column.from, column.to)
            };
            let twice = 3 * (twice - column.from);
            for (a, b) in there[..twice].iter().zip(&line[..twice]) {
                self.seam.compared += 1;
                self.seam.differing += usize::from(a != b);
                self.seam.most = self.seam.most.max(a.abs_diff(*b));
            }
            there[twice..].copy_from_slice(&line[twice..]);
        }
        self.left = column.to;
        if column.to == width {
            self.above = row.to;
        }
    }

    /// The image, and how its seams held.
    pub(super) fn finish(self) -> (Rgb, Seam) {
        (self.rgb, self.seam)
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
            prop_assert_eq!(spans[0].from, 0);
            prop_assert_eq!(spans.last().unwrap().to, length);
            for span in &spans {
                prop_assert_eq!(span.end - span.start, tile.min(length));
                prop_assert!(span.start % multiple == 0 && span.end <= length);
                prop_assert!(span.from == 0 || span.from - span.start >= context);
                prop_assert!(span.to == length || span.end - span.to >= context);
            }
            for pair in spans.windows(2) {
                prop_assert!(pair[0].to >= pair[1].from + 2 * GUARD);
            }
        }
    }

    #[test]
    fn seams_are_compared() {
        let cut = Cutting {
            area: [37, 50],
            tile: [20, 20],
            context: 3,
            multiple: 1,
        };
        let plan = TilePlan::of(cut).unwrap();
        // What a pixel is, and what a tile that sees its own place makes of it.
        let made = |shift: usize| {
            let mut canvas = TiledImage::new([37, 50]);
            for (row, column) in plan.tiles() {
                let pixels =
                    (row.from..row.to).flat_map(|y| (column.from..column.to).map(move |x| (y, x)));
                let byte =
                    |(y, x): (usize, usize)| [(y * 5 + x * 3 + shift * column.start) as u8; 3];
                canvas.put(row, column, &pixels.flat_map(byte).collect::<Vec<_>>());
            }
            canvas.finish()
        };
        let (image, seam) = made(0);
        let expected = (0..37 * 50).flat_map(|i| [(i / 50 * 5 + i % 50 * 3) as u8; 3]);
        assert!(image.samples().iter().copied().eq(expected));
        assert!(seam.holds() && seam.compared > 1000 && seam.most == 0);
        let (_, seam) = made(1);
        assert!(!seam.holds() && seam.most > 1, "{seam:?}");
    }
}
