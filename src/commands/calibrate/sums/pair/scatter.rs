//! Sums of products of two frames, [`Products`], and the same around their means, [`Scatter`].

/// Sums of A², A · B and B² over the sites of one part of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Products {
    pub(super) aa: u64,
    pub(super) ab: u64,
    pub(super) bb: u64,
}

/// Sums of products of A and B around their means. They give the sum of squares of A − ratio · B for any ratio.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Scatter {
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

    /// Removes a site that was added.
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

    /// Exact sum of (A − B)².
    pub(super) fn squared_difference(self) -> u64 {
        self.aa + self.bb - 2 * self.ab
    }

    /// The sums around the means of `count` sites, from the sums of A and of B.
    pub(super) fn about_means(self, count: u64, [a, b]: [u64; 2]) -> Scatter {
        let [n, a, b] = [count, a, b].map(|sum| sum as f64);
        Scatter { aa: self.aa as f64 - a * a / n, ab: self.ab as f64 - a * b / n, bb: self.bb as f64 - b * b / n }
    }
}

impl Scatter {
    /// Adds the sums of other sites.
    pub(super) fn join(&mut self, other: Self) {
        self.aa += other.aa;
        self.ab += other.ab;
        self.bb += other.bb;
    }

    /// Multiplies all sums by a factor.
    pub(super) fn times(self, factor: f64) -> Self {
        Self { aa: factor * self.aa, ab: factor * self.ab, bb: factor * self.bb }
    }

    /// Sum of D² around its mean, with D = A − ratio · B; for products of neighbours, the sum of D · D′.
    pub(crate) fn squared_difference(self, ratio: f64) -> f64 {
        self.aa - 2.0 * ratio * self.ab + ratio * ratio * self.bb
    }
}
