//! Colour filters of a sensor ([`Cfa`]), and the planes, rows and tiles of its frames ([`Layout`]).

use std::ops::Range;

use clap::ValueEnum;
use serde::Serialize;

use crate::types::flags::flag_words;

/// Number of tiles of a plane along each side (chosen). Photon transfer is fitted to tiles, so that the fall-off of
/// light towards the corners adds points and not variance.
pub(super) const TILES: usize = 8;

/// The colours of the four sites at the upper left corner of a frame, row by row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum, Serialize)]
#[serde(rename_all = "UPPERCASE")]
#[value(rename_all = "UPPER")]
pub(crate) enum Cfa {
    /// Red and green above green and blue
    #[default]
    Rggb,
    /// Blue and green above green and red
    Bggr,
    /// Green and red above blue and green
    Grbg,
    /// Green and blue above red and green
    Gbrg,
    /// No colour filters
    #[value(name = "mono")]
    #[serde(rename = "mono")]
    Mono,
}

flag_words!(Cfa);

impl Cfa {
    /// Period of the pattern in rows and columns: the number of planes in a row.
    pub(super) fn step(self) -> usize {
        if self == Self::Mono { 1 } else { 2 }
    }

    /// Number of planes.
    pub(super) fn planes(self) -> usize {
        self.step() * self.step()
    }

    /// Plane of the sites in a row whose column modulo the period is `parity`. Planes 0 to 3 are red, green in red
    /// rows, green in blue rows, and blue; the only plane of a sensor without filters is 0.
    pub(super) fn plane(self, row: usize, parity: usize) -> usize {
        let [first_row, first_column] = match self {
            Self::Mono => return 0,
            Self::Rggb => [0, 0],
            Self::Grbg => [0, 1],
            Self::Gbrg => [1, 0],
            Self::Bggr => [1, 1],
        };
        2 * ((row + first_row) % 2) + (parity + first_column) % 2
    }

    /// Names of the planes, in order.
    pub(crate) fn plane_names(self) -> &'static [&'static str] {
        match self {
            Self::Mono => &["all"],
            _ => &["R", "G1", "G2", "B"],
        }
    }
}

/// Colour filters and size of all frames of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) cfa: Cfa,
    pub(super) height: usize,
    pub(super) width: usize,
}

impl Layout {
    /// Rows and columns of each plane.
    pub(super) fn plane_size(self) -> [usize; 2] {
        [self.height, self.width].map(|side| side / self.cfa.step())
    }

    /// Number of parts of rows, each with the sites of one plane in one row. They are numbered row by row, and by
    /// parity within a row.
    pub(super) fn plane_rows(self) -> usize {
        self.height * self.cfa.step()
    }

    /// Row and column parity of a part of a row.
    pub(super) fn place(self, plane_row: usize) -> [usize; 2] {
        let step = self.cfa.step();
        [plane_row / step, plane_row % step]
    }

    /// Rows or columns of a tile, for a plane with `side` rows or columns.
    pub(super) fn tile(side: usize, tile: usize) -> Range<usize> {
        tile * side / TILES..(tile + 1) * side / TILES
    }

    /// Tile row of a sensor row.
    pub(super) fn tile_row(self, row: usize) -> usize {
        let [rows, _] = self.plane_size();
        let row = row / self.cfa.step();
        (0..TILES).find(|tile| Self::tile(rows, *tile).contains(&row)).unwrap_or(TILES - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_name_their_first_four_sites() {
        for (cfa, planes) in [
            (Cfa::Rggb, [0, 1, 2, 3]),
            (Cfa::Bggr, [3, 2, 1, 0]),
            (Cfa::Grbg, [1, 0, 3, 2]),
            (Cfa::Gbrg, [2, 3, 0, 1]),
            (Cfa::Mono, [0; 4]),
        ] {
            let found = [[0, 0], [0, 1], [1, 0], [1, 1]];
            let found = found.map(|[row, parity]| cfa.plane(row, parity));
            assert_eq!(found, planes, "{cfa}");
            // The colours by name: both greens are on a diagonal.
            let letters: String = found.iter().map(|plane| &cfa.plane_names()[*plane][..1]).collect();
            if cfa != Cfa::Mono {
                assert_eq!(letters, cfa.to_string());
            }
        }
    }

    #[test]
    fn tiles_cover_a_plane() {
        let layout = Layout { cfa: Cfa::Rggb, height: 514, width: 300 };
        assert_eq!(layout.plane_size(), [257, 150]);
        assert_eq!(layout.plane_rows(), 1028);
        let covered: usize = (0..TILES).map(|tile| Layout::tile(150, tile).len()).sum();
        assert_eq!(covered, 150);
        assert_eq!([0, 513].map(|row| layout.tile_row(row)), [0, 7]);
        // Row 64 of the plane is the last of the third tile: 2 · 257 / 8 = 64.25.
        assert_eq!([127, 128].map(|row| layout.tile_row(row)), [1, 2]);
    }
}
