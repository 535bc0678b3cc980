//! Sums of products of two frames: [`Products`], and about their means [`Scatter`].

/// Sums of A², A · B and B² over the sites of one part of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Products {
    pub(super) aa: u64,
    pub(super) ab: u64,
    pub(super) bb: u64,
}

/// Sums of products of A and B about their means. From them follows the sum for any difference of the two, A − ratio · B.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(in crate::calibrate) struct Scatter {
    pub(super) aa: f64,
    pub(super) ab: f64,
    pub(super) bb: f64,
}

impl Products {
    /// Adds a site.
    pub(super) fn add(&mut self, a: u16, b: u16) {
        let [a, b] = [a, b].map(u64::from);
        self.aa += a * a;
        self.ab += a * b;
        self.bb += b * b;
    }

    /// Takes out a site that was added.
    pub(super) fn remove(&mut self, a: u16, b: u16) {
        let [a, b] = [a, b].map(u64::from);
        self.aa -= a * a;
        self.ab -= a * b;
        self.bb -= b * b;
    }

    /// Adds the sums of other sites.
    pub(super) fn join(&mut self, other: Self) {
        self.aa += other.aa;
        self.ab += other.ab;
        self.bb += other.bb;
    }

    /// Sum of (A − B)², which is exact.
    pub(super) fn squared_difference(self) -> u64 {
        self.aa + self.bb - 2 * self.ab
    }

    /// The sums about the means of `count` sites with these sums of A and of B.
    pub(super) fn about_means(self, count: u64, [a, b]: [u64; 2]) -> Scatter {
        let [n, a, b] = [count, a, b].map(|sum| sum as f64);
        Scatter {
            aa: self.aa as f64 - a * a / n,
            ab: self.ab as f64 - a * b / n,
            bb: self.bb as f64 - b * b / n,
        }
    }
}

impl Scatter {
    /// Adds the sums of other sites.
    pub(super) fn join(&mut self, other: Self) {
        self.aa += other.aa;
        self.ab += other.ab;
        self.bb += other.bb;
    }

    /// The same with every product times a factor.
    pub(super) fn times(self, factor: f64) -> Self {
        Self {
            aa: factor * self.aa,
            ab: factor * self.ab,
            bb: factor * self.bb,
        }
    }

    /// The sum of D² about its mean, where D = A − ratio · B; of products of neighbours the sum of D · D′.
    pub(in crate::calibrate) fn squared_difference(self, ratio: f64) -> f64 {
        self.aa - 2.0 * ratio * self.ab + ratio * ratio * self.bb
    }
}
