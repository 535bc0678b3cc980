//! Correlation of neighbouring sites of one colour: [`NeighbourSums`].

use super::scatter::Scatter;

/// Sums over neighbours x and x′ in a part of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct RowNeighbours {
    pub(super) count: u64,
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
    pub(super) fn new(a: &[u16], b: &[u16]) -> Self {
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
    pub(super) fn remove(&mut self, site: Site, next: Site) {
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
    pub(super) fn none(planes: usize) -> Self {
        Self { planes: vec![PlaneSums::default(); planes] }
    }

    /// Adds a part of a row with `count` sites, the means of A and of B, and the squares around them.
    pub(super) fn add(&mut self, plane: usize, row: RowNeighbours, count: f64, means: [f64; 2], squares: Scatter) {
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
