//! Sums over the difference of two frames of one exposure: [`PairSums`].
//!
//! A difference removes everything that is constant: fixed pattern, response of the sites, fall-off of light. The light
//! of two flats is never exactly equal, so the sums of products of A and B are stored, which give the difference for
//! any ratio of light.
//!
//! Correlation of neighbouring sites of one colour: [`NeighbourSums`].
//!
//! Sums of products of two frames, [`Products`], and the same around their means, [`Scatter`].

#[cfg(test)]
mod tests;

use rayon::prelude::*;

use super::gather;
use crate::commands::calibrate::frames::{HotPixels, Layout, TILES};

/// Sums over two frames A and B for each part of a row and tile, without hot pixels.
#[derive(Debug)]
pub(crate) struct PairSums {
    layout: Layout,
    rows: Vec<PairRow>,
}

/// Sums of a part of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct PairRow {
    tiles: [Cell; TILES],
    neighbours: RowNeighbours,
}

/// Sums of a tile in one row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Cell {
    count: u64,
    /// Sum of A.
    a: u64,
    /// Sum of B.
    b: u64,
    products: Products,
}

/// Light and noise of a tile of one plane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct TileSums {
    pub(crate) plane: usize,
    /// Number of sites.
    pub(crate) count: f64,
    /// Sums of A and of B, in ADU.
    pub(crate) sums: [f64; 2],
    /// Products around the means of the parts of rows in the tile, without fall-off and row noise.
    pub(crate) scatter: Scatter,
    /// Degrees of freedom of `scatter`: the number of sites minus the number of parts of rows.
    pub(crate) free: f64,
}

impl TileSums {
    /// Mean of both frames, in ADU.
    pub(crate) fn mean(&self) -> f64 {
        (self.sums[0] + self.sums[1]) / self.count / 2.0
    }

    /// Variance of one frame without row noise, in ADU², if the light of A is `ratio` times the light of B.
    ///
    /// A and B · ratio have equal light, so that their difference D has neither fall-off nor the response of the sites.
    /// If S is the light of B, the variance of D is K · ratio · S + ratio² · K · S = 2 ratio · K · S̄, where S̄ is the
    /// mean light of both.
    pub(crate) fn variance(&self, ratio: f64) -> f64 {
        self.scatter.squared_difference(ratio) / self.free / (2.0 * ratio)
    }
}

/// Noise of a pair of frames without light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PairNoise {
    /// Variance of one frame within its rows, in ADU².
    pub(crate) within: f64,
    /// Variance of the row noise, in ADU²; may be negative by chance.
    pub(crate) row: f64,
}

impl PairNoise {
    /// Standard deviation of the row noise in ADU; 0 if the variance is negative by chance.
    pub(crate) fn row_deviation(self) -> f64 {
        self.row.max(0.0).sqrt()
    }
}

impl PairSums {
    pub(crate) fn new(layout: Layout, [a, b]: [&[u16]; 2], hot: &HotPixels) -> Self {
        let rows = (0..layout.plane_rows())
            .into_par_iter()
            .with_min_len(64)
            .map_init(
                || [Vec::new(), Vec::new()],
                |[part_a, part_b], plane_row| {
                    gather(layout, a, plane_row, part_a);
                    gather(layout, b, plane_row, part_b);
                    PairRow::new(part_a, part_b, hot.columns(plane_row))
                },
            )
            .collect();
        Self { layout, rows }
    }

    /// Means of A and of B over all sites.
    pub(crate) fn means(&self) -> [f64; 2] {
        let [n, a, b] = self
            .rows
            .iter()
            .flat_map(|row| row.tiles)
            .fold([0; 3], |[n, a, b], cell| [n + cell.count, a + cell.a, b + cell.b]);
        [a, b].map(|sum| sum as f64 / n as f64)
    }

    /// Mean of A − B of each plane.
    fn plane_means(&self) -> Vec<f64> {
        let planes = self.layout.cfa.planes();
        let mut sums = vec![(0_u64, 0_i64); planes];
        for (plane, row) in self.rows_with_planes() {
            for cell in &row.tiles {
                sums[plane].0 += cell.count;
                sums[plane].1 += cell.difference();
            }
        }
        sums.into_iter().map(|(count, sum)| sum as f64 / count.max(1) as f64).collect()
    }

    /// Parts of rows with their planes.
    fn rows_with_planes(&self) -> impl Iterator<Item = (usize, &PairRow)> {
        self.rows.iter().enumerate().map(|(plane_row, row)| {
            let [at, parity] = self.layout.place(plane_row);
            (self.layout.cfa.plane(at, parity), row)
        })
    }

    /// Read noise and row noise of one frame, for a pair without light.
    ///
    /// D is A − B minus the means of its planes, and m is the mean of D over a sensor row. The variance within rows is
    /// Σ(D − m)² / (2 · degrees of freedom). The row noise is var(m) / 2 minus the contribution of the sites, within /
    /// width.
    pub(crate) fn noise(&self) -> PairNoise {
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
        // Degrees of freedom that the plane means take in addition to the row means.
        let planes = (self.layout.cfa.planes() - step) as f64;
        let within = within / (count - rows - planes) / 2.0;
        let of_means = of_means / (rows - step as f64) / 2.0;
        PairNoise { within, row: of_means - within * rows / count }
    }

    /// Sums over neighbours in the rows of each plane.
    pub(crate) fn neighbours(&self) -> NeighbourSums {
        let mut sums = NeighbourSums::none(self.layout.cfa.planes());
        for (plane, row) in self.rows_with_planes() {
            let whole = row.whole();
            if whole.count < 2 || row.neighbours.count == 0 {
                continue;
            }
            let count = whole.count as f64;
            let means = [whole.a, whole.b].map(|sum| sum as f64 / count);
            sums.add(plane, row.neighbours, count, means, whole.scatter());
        }
        sums
    }

    /// Light and noise of all tiles of all planes, except tiles with fewer than two sites in every row.
    pub(crate) fn tiles(&self) -> Vec<TileSums> {
        let mut tiles = vec![TileSums::default(); self.layout.cfa.planes() * TILES * TILES];
        for (plane_row, row) in self.rows.iter().enumerate() {
            let [at, parity] = self.layout.place(plane_row);
            let plane = self.layout.cfa.plane(at, parity);
            let first = (plane * TILES + self.layout.tile_row(at)) * TILES;
            for (cell, tile) in row.tiles.iter().zip(&mut tiles[first..]) {
                if cell.count < 2 {
                    continue;
                }
                tile.plane = plane;
                tile.count += cell.count as f64;
                tile.sums[0] += cell.a as f64;
                tile.sums[1] += cell.b as f64;
                tile.scatter.join(cell.scatter());
                tile.free += cell.count as f64 - 1.0;
            }
        }
        tiles.retain(|tile| tile.free > 0.0);
        tiles
    }
}

impl Cell {
    /// Computes the sums of the sites of both frames in a tile and row.
    fn new(a: &[u16], b: &[u16]) -> Self {
        let mut cell = Self { count: a.len() as u64, ..Self::default() };
        for (a, b) in a.iter().zip(b) {
            cell.a += u64::from(*a);
            cell.b += u64::from(*b);
            cell.products.add(*a, *b);
        }
        cell
    }

    /// Sum of A − B.
    fn difference(&self) -> i64 {
        self.a as i64 - self.b as i64
    }

    /// Number, sum and sum of squares of A − B − `mean`.
    fn about(&self, mean: f64) -> [f64; 3] {
        let (n, sum) = (self.count as f64, self.difference() as f64);
        let squares = self.products.squared_difference() as f64;
        let squares = squares - 2.0 * mean * sum + n * mean * mean;
        [n, sum - n * mean, squares]
    }

    /// Products around the means of A and of B.
    fn scatter(&self) -> Scatter {
        self.products.about_means(self.count, [self.a, self.b])
    }
}

impl PairRow {
    /// Computes the sums of a part of a row, without its hot columns.
    fn new(a: &[u16], b: &[u16], hot: impl Iterator<Item = usize>) -> Self {
        let mut row = Self::default();
        for (tile, cell) in row.tiles.iter_mut().enumerate() {
            let columns = Layout::tile(a.len(), tile);
            *cell = Cell::new(&a[columns.clone()], &b[columns]);
        }
        row.neighbours = RowNeighbours::new(a, b);
        let mut last = None;
        for column in hot {
            let tile = (0..TILES).find(|tile| Layout::tile(a.len(), *tile).contains(&column));
            let cell = &mut row.tiles[tile.unwrap_or(TILES - 1)];
            cell.count -= 1;
            cell.a -= u64::from(a[column]);
            cell.b -= u64::from(b[column]);
            cell.products.remove(a[column], b[column]);
            // Remove the two pairs of neighbours with this column, each only once.
            for left in column.saturating_sub(1)..=column {
                let is_new = last.is_none_or(|last| left > last);
                if is_new && left + 1 < a.len() {
                    row.neighbours.remove([a[left], b[left]], [a[left + 1], b[left + 1]]);
                    last = Some(left);
                }
            }
        }
        row
    }

    /// Sums over all tiles.
    fn whole(&self) -> Cell {
        self.tiles.iter().fold(Cell::default(), |mut whole, cell| {
            whole.count += cell.count;
            whole.a += cell.a;
            whole.b += cell.b;
            whole.products.join(cell.products);
            whole
        })
    }

    /// Number, sum and sum of squares of A − B − `mean` over the part of the row.
    fn about(&self, mean: f64) -> [f64; 3] {
        self.tiles
            .iter()
            .map(|cell| cell.about(mean))
            .fold([0.0; 3], |sums, cell| std::array::from_fn(|i| sums[i] + cell[i]))
    }
}

/// Sums over neighbours x and x′ in a part of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct RowNeighbours {
    count: u64,
    /// Sums of A + A′ and of B + B′.
    both: [u64; 2],
    /// Sum of A · A′.
    aa: u64,
    /// Sum of A · B′ + A′ · B.
    ab: u64,
    /// Sum of B · B′.
    bb: u64,
}

/// Sums over neighbours in a pair of frames, by plane.
#[derive(Debug)]
pub(crate) struct NeighbourSums {
    planes: Vec<PlaneSums>,
}

/// Sums of a plane around the means of its rows.
#[derive(Debug, Clone, Copy, Default)]
struct PlaneSums {
    /// Products of neighbours.
    products: Scatter,
    /// Products of each site with itself.
    squares: Scatter,
    /// Number of sites.
    sites: f64,
    /// Number of parts of rows.
    rows: f64,
}

/// Samples of both frames at a site.
type Site = [u16; 2];

impl RowNeighbours {
    /// Computes the sums of a part of a row.
    fn new(a: &[u16], b: &[u16]) -> Self {
        let mut sums = Self::default();
        let sites = a.iter().zip(b).map(|(a, b)| [*a, *b]);
        for (site, next) in sites.clone().zip(sites.skip(1)) {
            let more = Self::from_sites(site, next);
            sums.count += 1;
            sums.both = [0, 1].map(|frame| sums.both[frame] + more.both[frame]);
            sums.aa += more.aa;
            sums.ab += more.ab;
            sums.bb += more.bb;
        }
        sums
    }

    fn from_sites(site: Site, next: Site) -> Self {
        let [[a, b], [next_a, next_b]] = [site, next].map(|site| site.map(u64::from));
        Self { count: 1, both: [a + next_a, b + next_b], aa: a * next_a, ab: a * next_b + next_a * b, bb: b * next_b }
    }

    /// Removes two neighbours that were added.
    fn remove(&mut self, site: Site, next: Site) {
        let less = Self::from_sites(site, next);
        self.count -= 1;
        self.both = [0, 1].map(|frame| self.both[frame] - less.both[frame]);
        self.aa -= less.aa;
        self.ab -= less.ab;
        self.bb -= less.bb;
    }

    /// Products around these means of A and of B.
    fn about(self, [a, b]: [f64; 2]) -> Scatter {
        let n = self.count as f64;
        let [both_a, both_b] = self.both.map(|sum| sum as f64);
        let crossed = self.ab as f64 - a * both_b - b * both_a + 2.0 * n * a * b;
        Scatter {
            aa: self.aa as f64 - a * both_a + n * a * a,
            ab: crossed / 2.0,
            bb: self.bb as f64 - b * both_b + n * b * b,
        }
    }
}

impl NeighbourSums {
    /// Empty sums for this number of planes.
    fn none(planes: usize) -> Self {
        Self { planes: vec![PlaneSums::default(); planes] }
    }

    /// Adds a part of a row with `count` sites, the means of A and of B, and the squares around them.
    fn add(&mut self, plane: usize, row: RowNeighbours, count: f64, means: [f64; 2], squares: Scatter) {
        let plane = &mut self.planes[plane];
        // Scale the products to the number of squares.
        let products = row.about(means).times(count / row.count as f64);
        plane.products.join(products);
        plane.squares.join(squares);
        plane.sites += count;
        plane.rows += 1.0;
    }

    /// Correlation of neighbours of a plane within rows of A − ratio · B, which is 0 for independent noise. `ratios`
    /// are the light of A over the light of B, by plane.
    pub(crate) fn correlation(&self, ratios: &[f64]) -> f64 {
        let [mut products, mut squares, mut sites, mut rows] = [0.0; 4];
        for (plane, ratio) in self.planes.iter().zip(ratios) {
            products += plane.products.squared_difference(*ratio);
            squares += plane.squares.squared_difference(*ratio);
            sites += plane.sites;
            rows += plane.rows;
        }
        if squares <= 0.0 {
            return 0.0;
        }
        // Subtracting the mean of n sites gives independent neighbours a correlation of −1/(n − 1).
        products / squares + 1.0 / (sites / rows - 1.0)
    }
}

/// Sums of A², A · B and B² over the sites of one part of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Products {
    aa: u64,
    ab: u64,
    bb: u64,
}

/// Sums of products of A and B around their means. They give the sum of squares of A − ratio · B for any ratio.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Scatter {
    aa: f64,
    ab: f64,
    bb: f64,
}

impl Products {
    /// Adds a site.
    fn add(&mut self, a: u16, b: u16) {
        let [a, b] = [a, b].map(u64::from);
        self.aa += a * a;
        self.ab += a * b;
        self.bb += b * b;
    }

    /// Removes a site that was added.
    fn remove(&mut self, a: u16, b: u16) {
        let [a, b] = [a, b].map(u64::from);
        self.aa -= a * a;
        self.ab -= a * b;
        self.bb -= b * b;
    }

    /// Adds the sums of other sites.
    fn join(&mut self, other: Self) {
        self.aa += other.aa;
        self.ab += other.ab;
        self.bb += other.bb;
    }

    /// Exact sum of (A − B)².
    fn squared_difference(self) -> u64 {
        self.aa + self.bb - 2 * self.ab
    }

    /// The sums around the means of `count` sites, from the sums of A and of B.
    fn about_means(self, count: u64, [a, b]: [u64; 2]) -> Scatter {
        let [n, a, b] = [count, a, b].map(|sum| sum as f64);
        Scatter { aa: self.aa as f64 - a * a / n, ab: self.ab as f64 - a * b / n, bb: self.bb as f64 - b * b / n }
    }
}

impl Scatter {
    /// Adds the sums of other sites.
    fn join(&mut self, other: Self) {
        self.aa += other.aa;
        self.ab += other.ab;
        self.bb += other.bb;
    }

    /// Multiplies all sums by a factor.
    fn times(self, factor: f64) -> Self {
        Self { aa: factor * self.aa, ab: factor * self.ab, bb: factor * self.bb }
    }

    /// Sum of D² around its mean, with D = A − ratio · B; for products of neighbours, the sum of D · D′.
    pub(crate) fn squared_difference(self, ratio: f64) -> f64 {
        self.aa - 2.0 * ratio * self.ab + ratio * ratio * self.bb
    }
}
