//! The distribution function of Tukey's λ distribution, which has a closed form for its inverse alone: [`TukeyTable`].

/// Points of the table from the smallest probability to ½ (chosen, with the range: the error of a probability is below 10⁻⁵ of
/// itself).
const POINTS: usize = 3001;

/// The logit of the smallest probability of the table, which is 2.8 · 10⁻¹⁰.
const SMALLEST: f64 = -22.0;

/// The lower half of the distribution: probabilities at even steps of their logit.
#[derive(Debug, Clone)]
pub(super) struct TukeyTable {
    probabilities: Vec<f64>,
    /// ln u and ln(1 − u) of each probability u.
    logarithms: Vec<[f64; 2]>,
    /// Quantiles of the last λ.
    quantiles: Vec<f64>,
}

impl TukeyTable {
    pub(super) fn new() -> Self {
        let logits = (0..POINTS).map(|i| SMALLEST * (1.0 - i as f64 / (POINTS - 1) as f64));
        let logarithms: Vec<[f64; 2]> = logits
            // u = 1 / (1 + e^−t)
            .map(|t| [t - libm::log1p(libm::exp(t)), -libm::log1p(libm::exp(t))])
            .collect();
        Self {
            probabilities: logarithms.iter().map(|[log, _]| libm::exp(*log)).collect(),
            quantiles: vec![0.0; POINTS],
            logarithms,
        }
    }

    /// Sets the shape λ for what follows.
    pub(super) fn set_shape(&mut self, shape: f64) {
        for (quantile, [below, above]) in self.quantiles.iter_mut().zip(&self.logarithms) {
            *quantile = if shape == 0.0 {
                below - above
            } else {
                (libm::expm1(shape * below) - libm::expm1(shape * above)) / shape
            };
        }
    }

    /// A reader of the distribution function of scale 1 at falling places.
    pub(super) fn falling(&self) -> Falling<'_> {
        Falling {
            table: self,
            above: POINTS - 1,
        }
    }
}

/// Reader of the distribution function at places of which each is at most the one before.
pub(super) struct Falling<'a> {
    table: &'a TukeyTable,
    /// A point of the table whose quantile is above, or at, all places that follow.
    above: usize,
}

impl Falling<'_> {
    /// The probability below `place`, which is at most 0. Beyond the table it is 0.
    pub(super) fn at(&mut self, place: f64) -> f64 {
        let TukeyTable {
            quantiles,
            probabilities,
            ..
        } = self.table;
        while self.above > 0 && quantiles[self.above - 1] > place {
            self.above -= 1;
        }
        if self.above == 0 {
            return 0.0;
        }
        let [low, high] = [self.above - 1, self.above];
        let width = quantiles[high] - quantiles[low];
        let share = if width > 0.0 {
            ((place - quantiles[low]) / width).min(1.0)
        } else {
            0.0
        };
        probabilities[low] + share * (probabilities[high] - probabilities[low])
    }
}
