//! Sums of the difference of two frames of one exposure: [`PairSums`].
//!
//! A difference removes everything that stands still: fixed pattern, response of the sites, fall-off of light.

use rayon::prelude::*;

use super::super::hot_pixels::HotPixels;
use super::super::layout::{Layout, TILES};
use super::gather;

/// Sums of two frames A and B by part of a row and tile, without hot pixels.
#[derive(Debug)]
pub(in super::super) struct PairSums {
    layout: Layout,
    rows: Vec<PairRow>,
}

/// Sums of the part of a row that belongs to one plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct PairRow {
    tiles: [Cell; TILES],
    neighbours: Neighbours,
}

/// Sums of a tile in one row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Cell {
    count: u64,
    /// Sum of A.
    a: u64,
    /// Sum of B.
    b: u64,
    /// Sum of (A − B)².
    squares: u64,
}

/// Sums over neighbours d and d′ in a part of a row, where d = A − B.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Neighbours {
    count: i64,
    /// Sum of d + d′.
    both: i64,
    /// Sum of d · d′.
    products: i64,
}

/// Light and noise of a tile of one plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) struct Tile {
    pub(in super::super) plane: usize,
    /// Number of sites.
    pub(in super::super) count: f64,
    /// Mean of both frames, in ADU.
    pub(in super::super) mean: f64,
    /// Variance of one frame without row noise: half of the mean squared difference about its row's mean, in ADU².
    pub(in super::super) variance: f64,
}

/// Noise of a pair without the noise of light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) struct PairNoise {
    /// Variance of one frame within its rows, in ADU².
    pub(in super::super) within: f64,
    /// Variance of the row noise, in ADU²; may be below 0 by chance.
    pub(in super::super) row: f64,
}

impl PairNoise {
    /// Standard deviation of the row noise in ADU; 0 if chance has made the variance negative.
    pub(in super::super) fn row_deviation(self) -> f64 {
        self.row.max(0.0).sqrt()
    }
}

impl PairSums {
    pub(in super::super) fn of(layout: Layout, [a, b]: [&[u16]; 2], hot: &HotPixels) -> Self {
        let parts = (0..layout.plane_rows()).into_par_iter().with_min_len(64);
        let rows = parts.map_init(
            || [Vec::new(), Vec::new()],
            |[part_a, part_b], plane_row| {
                gather(layout, a, plane_row, part_a);
                gather(layout, b, plane_row, part_b);
                PairRow::of(part_a, part_b, hot.columns(plane_row))
            },
        );
        Self {
            layout,
            rows: rows.collect(),
        }
    }

    /// Means of A and of B, over all planes alike.
    pub(in super::super) fn means(&self) -> [f64; 2] {
        let cells = self.rows.iter().flat_map(|row| row.tiles);
        let [n, a, b] = cells.fold([0; 3], |[n, a, b], cell| {
            [n + cell.count, a + cell.a, b + cell.b]
        });
        [a, b].map(|sum| sum as f64 / n as f64)
    }

    /// Mean of A − B of each plane.
    fn plane_means(&self) -> Vec<f64> {
        let planes = self.layout.cfa.planes();
        let mut sums = vec![(0_u64, 0_i64); planes];
        for (plane, row) in self.by_plane() {
            for cell in &row.tiles {
                sums[plane].0 += cell.count;
                sums[plane].1 += cell.difference();
            }
        }
        let mean = |(count, sum): (u64, i64)| sum as f64 / count.max(1) as f64;
        sums.into_iter().map(mean).collect()
    }

    /// Parts of rows with their planes.
    fn by_plane(&self) -> impl Iterator<Item = (usize, &PairRow)> {
        self.rows.iter().enumerate().map(|(plane_row, row)| {
            let [at, parity] = self.layout.place(plane_row);
            (self.layout.cfa.plane(at, parity), row)
        })
    }

    /// Read noise and row noise of one frame, where the pair has no light.
    ///
    /// D is A − B without the means of its planes, m the mean of a whole sensor row of D. The variance within rows is
    /// Σ(D − m)² / (2 · degrees of freedom). The row noise is var(m) / 2 less the share of the sites, within / width.
    pub(in super::super) fn noise(&self) -> PairNoise {
        let step = self.layout.cfa.step();
        let plane_means = self.plane_means();
        let (mut count, mut rows, mut within, mut of_means) = (0.0, 0.0, 0.0, 0.0);
        for (row, parts) in self.rows.chunks(step).enumerate() {
            let [mut n, mut sum, mut squares] = [0.0; 3];
            for (parity, part) in parts.iter().enumerate() {
                let mean = plane_means[self.layout.cfa.plane(row, parity)];
                let [part_n, part_sum, part_squares] = part.about(mean);
                n += part_n;
                sum += part_sum;
                squares += part_squares;
            }
            if n > 0.0 {
                let mean = sum / n;
                count += n;
                rows += 1.0;
                within += squares - sum * mean;
                of_means += mean * mean;
            }
        }
        // The means of the planes that share a row are one number less than their row means leave free.
        let planes = (self.layout.cfa.planes() - step) as f64;
        let within = within / (count - rows - planes) / 2.0;
        let of_means = of_means / (rows - step as f64) / 2.0;
        PairNoise {
            within,
            row: of_means - within * rows / count,
        }
    }

    /// Correlation of neighbours of a plane in a row of A − B, which is 0 for noise of single sites.
    pub(in super::super) fn correlation(&self) -> f64 {
        let [mut products, mut squares, mut length] = [0.0; 3];
        let mut rows = 0.0;
        for (_, row) in self.by_plane() {
            let [count, sum, _] = row.about(0.0);
            if count < 2.0 || row.neighbours.count == 0 {
                continue;
            }
            let mean = sum / count;
            let Neighbours {
                count: pairs,
                both,
                products: product,
            } = row.neighbours;
            let (pairs, both, product) = (pairs as f64, both as f64, product as f64);
            products += (product - mean * both + pairs * mean * mean) * count / pairs;
            squares += row.about(mean)[2];
            length += count;
            rows += 1.0;
        }
        if squares <= 0.0 {
            return 0.0;
        }
        // Taking off the mean of n sites makes independent neighbours correlate by −1/(n − 1).
        products / squares + 1.0 / (length / rows - 1.0)
    }

    /// Light and noise of all tiles of all planes; tiles without sites are left out.
    pub(in super::super) fn tiles(&self) -> Vec<Tile> {
        let mut tiles = vec![[0.0; 3]; self.layout.cfa.planes() * TILES * TILES];
        for (plane_row, row) in self.rows.iter().enumerate() {
            let [at, parity] = self.layout.place(plane_row);
            let plane = self.layout.cfa.plane(at, parity);
            let [n, sum, _] = row.about(0.0);
            if n < 2.0 {
                continue;
            }
            let mean = sum / n;
            let first = (plane * TILES + self.layout.tile_row(at)) * TILES;
            for (cell, tile) in row.tiles.iter().zip(&mut tiles[first..]) {
                tile[0] += cell.count as f64;
                tile[1] += (cell.a + cell.b) as f64;
                // The mean takes 1/n of the variance with it.
                tile[2] += cell.about(mean)[2] * n / (n - 1.0);
            }
        }
        let tiles = tiles.into_iter().enumerate();
        let tiles = tiles.filter(|(_, [count, ..])| *count > 0.0);
        tiles
            .map(|(index, [count, both, squares])| Tile {
                plane: index / (TILES * TILES),
                count,
                mean: both / count / 2.0,
                variance: squares / count / 2.0,
            })
            .collect()
    }
}

impl Cell {
    /// Sum of A − B.
    fn difference(&self) -> i64 {
        self.a as i64 - self.b as i64
    }

    /// Number, sum and sum of squares of A − B − `mean`.
    fn about(&self, mean: f64) -> [f64; 3] {
        let (n, sum) = (self.count as f64, self.difference() as f64);
        let squares = self.squares as f64 - 2.0 * mean * sum + n * mean * mean;
        [n, sum - n * mean, squares]
    }
}

impl PairRow {
    /// Sums of the samples of both frames in a part of a row, without its hot columns.
    fn of(a: &[u16], b: &[u16], hot: impl Iterator<Item = usize>) -> Self {
        let mut row = Self::default();
        for (tile, cell) in row.tiles.iter_mut().enumerate() {
            let columns = Layout::tile(a.len(), tile);
            *cell = cell_of(&a[columns.clone()], &b[columns]);
        }
        let difference = |column: usize| i64::from(a[column]) - i64::from(b[column]);
        row.neighbours = neighbours_of(a, b);
        let mut last = None;
        for column in hot {
            let tile = (0..TILES).find(|tile| Layout::tile(a.len(), *tile).contains(&column));
            let cell = &mut row.tiles[tile.unwrap_or(TILES - 1)];
            cell.count -= 1;
            cell.a -= u64::from(a[column]);
            cell.b -= u64::from(b[column]);
            cell.squares -= difference(column).unsigned_abs().pow(2);
            // The two pairs of neighbours that the column is in, each once.
            for left in column.saturating_sub(1)..=column {
                let is_new = last.is_none_or(|last| left > last);
                if is_new && left + 1 < a.len() {
                    let [d, next] = [difference(left), difference(left + 1)];
                    row.neighbours.count -= 1;
                    row.neighbours.both -= d + next;
                    row.neighbours.products -= d * next;
                    last = Some(left);
                }
            }
        }
        row
    }

    /// Number, sum and sum of squares of A − B − `mean` over the part of the row.
    fn about(&self, mean: f64) -> [f64; 3] {
        let cells = self.tiles.iter().map(|cell| cell.about(mean));
        cells.fold([0.0; 3], |sums, cell| {
            std::array::from_fn(|i| sums[i] + cell[i])
        })
    }
}

fn cell_of(a: &[u16], b: &[u16]) -> Cell {
    let mut cell = Cell {
        count: a.len() as u64,
        ..Cell::default()
    };
    for (a, b) in a.iter().zip(b) {
        let difference = u64::from(a.abs_diff(*b));
        cell.a += u64::from(*a);
        cell.b += u64::from(*b);
        cell.squares += difference * difference;
    }
    cell
}

fn neighbours_of(a: &[u16], b: &[u16]) -> Neighbours {
    let mut sums = Neighbours {
        count: a.len() as i64 - 1,
        ..Neighbours::default()
    };
    let differences = a.iter().zip(b).map(|(a, b)| i64::from(*a) - i64::from(*b));
    for (d, next) in differences.clone().zip(differences.skip(1)) {
        sums.both += d + next;
        sums.products += d * next;
    }
    sums
}

#[cfg(test)]
mod tests;
