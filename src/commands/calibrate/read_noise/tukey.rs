//! Cumulative distribution function of Tukey's λ distribution, by a table: [`TukeyTable`]. Only its inverse has a
//! closed form.

/// Number of points of the table from the smallest probability to ½ (chosen with the range for relative errors below
/// 10⁻⁵).
const POINTS: usize = 3001;

/// Logit of the smallest probability of the table, 2.8 · 10⁻¹⁰.
const MIN_LOGIT: f64 = -22.0;

/// Lower half of the distribution: probabilities with equally spaced logits, and their quantiles.
#[derive(Debug, Clone)]
pub(super) struct TukeyTable {
    probabilities: Vec<f64>,
    /// ln u and ln(1 − u) of each probability u.
    logarithms: Vec<[f64; 2]>,
    /// Quantiles for the current λ.
    quantiles: Vec<f64>,
}

impl TukeyTable {
    pub(super) fn new() -> Self {
        let logarithms: Vec<[f64; 2]> = (0..POINTS)
            .map(|i| MIN_LOGIT * (1.0 - i as f64 / (POINTS - 1) as f64))
            // u = 1 / (1 + e^−t)
            .map(|t| [t - libm::log1p(libm::exp(t)), -libm::log1p(libm::exp(t))])
            .collect();
        Self {
            probabilities: logarithms.iter().map(|[log, _]| libm::exp(*log)).collect(),
            quantiles: vec![0.0; POINTS],
            logarithms,
        }
    }

    /// Sets the shape λ.
    pub(super) fn set_shape(&mut self, shape: f64) {
        for (quantile, [below, above]) in self.quantiles.iter_mut().zip(&self.logarithms) {
            *quantile = if shape == 0.0 {
                below - above
            } else {
                (libm::expm1(shape * below) - libm::expm1(shape * above)) / shape
            };
        }
    }

    /// Reader of the distribution function with scale 1 at descending arguments.
    pub(super) fn falling(&self) -> Falling<'_> {
        Falling { table: self, above: POINTS - 1 }
    }
}

/// Reader of the distribution function at descending arguments.
pub(super) struct Falling<'a> {
    table: &'a TukeyTable,
    /// Index of a point whose quantile is not below any further argument.
    above: usize,
}

impl Falling<'_> {
    /// Probability of values below `x`, which must be at most 0 and at most the previous argument. It is 0 below the
    /// table.
    pub(super) fn at(&mut self, x: f64) -> f64 {
        let TukeyTable { quantiles, probabilities, .. } = self.table;
        while self.above > 0 && quantiles[self.above - 1] > x {
            self.above -= 1;
        }
        if self.above == 0 {
            return 0.0;
        }
        let [low, high] = [self.above - 1, self.above];
        let width = quantiles[high] - quantiles[low];
        let share = if width > 0.0 { ((x - quantiles[low]) / width).min(1.0) } else { 0.0 };
        probabilities[low] + share * (probabilities[high] - probabilities[low])
    }
}
