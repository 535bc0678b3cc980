//! Log-likelihood of residuals under a Tukey-λ distribution rounded to integer codes: [`Likelihood`].

use std::cell::RefCell;

use super::super::sums::{Residuals, STEPS};
use super::simplex::{self, Start};
use super::tukey::TukeyTable;

/// Minimum probability of a residual (chosen). It is far below the probability of any residual of the distribution, and
/// limits the effect of outliers such as cosmic rays.
const MIN_PROBABILITY: f64 = 1e-12;

/// Search range of λ. Below −½ the variance is infinite; 1 is the uniform distribution.
const SHAPES: [f64; 2] = [-0.49, 1.0];

/// Step of the numerical derivatives in λ and in ln σ_TL (chosen larger than the spacing of the table, which is
/// interpolated linearly).
const DERIVATIVE_STEP: f64 = 2e-3;

/// Absolute residuals in ADU, in ascending order, with their counts: the distribution is symmetric around 0.
#[derive(Debug, Clone)]
pub(super) struct Folded(Vec<(f64, f64)>);

impl Folded {
    pub(super) fn new(residuals: &Residuals) -> Self {
        let mut folded: Vec<(i64, u64)> = Vec::new();
        let mut all: Vec<(i64, u64)> =
            residuals.counts().into_iter().map(|(steps, count)| (steps.abs(), count)).collect();
        all.sort_unstable();
        for (steps, count) in all {
            match folded.last_mut() {
                Some((last, sum)) if *last == steps => *sum += count,
                _ => folded.push((steps, count)),
            }
        }
        Self(folded.into_iter().map(|(steps, count)| (steps as f64 / STEPS as f64, count as f64)).collect())
    }
}

/// Likelihood of residuals.
pub(super) struct Likelihood {
    residuals: Folded,
    count: f64,
    table: RefCell<TukeyTable>,
}

impl Likelihood {
    pub(super) fn new(residuals: Folded) -> Self {
        Self {
            count: residuals.0.iter().map(|(_, count)| count).sum(),
            residuals,
            table: RefCell::new(TukeyTable::new()),
        }
    }

    /// Finds λ and ln σ_TL of maximum likelihood.
    ///
    /// # Errors
    /// If all residuals are 0, or the search ends at a limit of the range of λ.
    pub(super) fn maximize(&self) -> Result<[f64; 2], String> {
        let squares: f64 = self.residuals.0.iter().map(|(size, n)| n * size * size).sum();
        let deviation = (squares / self.count.max(1.0)).sqrt();
        if deviation <= 0.0 || self.count <= 0.0 {
            return Err("bias frames without any noise".to_owned());
        }
        // The standard deviation of the distribution with scale 1 is 1.8 at λ = 0.
        let log_scale = libm::log(deviation / 1.8);
        let [first, second] = [-0.1, 0.1].map(|shape| {
            let start = Start { at: [shape, log_scale], step: [0.05, 0.1] };
            simplex::minimize(start, &|at: [f64; 2]| {
                if !(SHAPES[0]..=SHAPES[1]).contains(&at[0]) {
                    return f64::INFINITY;
                }
                -self.log_likelihood(&self.residuals, at) / self.count
            })
        });
        let best = if first.1 <= second.1 { first.0 } else { second.0 };
        let margin = 2.0 * DERIVATIVE_STEP;
        if best[0] < SHAPES[0] + margin || best[0] > SHAPES[1] - margin {
            return Err(format!(
                "the read noise has no Tukey-λ distribution: λ {:.2} is at the end of its range",
                best[0]
            ));
        }
        Ok(best)
    }

    /// Derivatives of the log-likelihood of some of the residuals with respect to λ and ln σ_TL.
    pub(super) fn score(&self, residuals: &Folded, [shape, log_scale]: [f64; 2]) -> [f64; 2] {
        let h = DERIVATIVE_STEP;
        [[h, 0.0], [0.0, h]].map(|[x, y]| {
            let up = self.log_likelihood(residuals, [shape + x, log_scale + y]);
            let down = self.log_likelihood(residuals, [shape - x, log_scale - y]);
            (up - down) / (2.0 * h)
        })
    }

    /// Second derivatives of the log-likelihood of all residuals.
    pub(super) fn curvature(&self, at: [f64; 2]) -> [[f64; 2]; 2] {
        let h = DERIVATIVE_STEP;
        // Second derivatives: the row is the variable of the first derivative, the column that of the second.
        let [across, along] = [[h, 0.0], [0.0, h]].map(|[x, y]| {
            let high = self.score(&self.residuals, [at[0] + x, at[1] + y]);
            let low = self.score(&self.residuals, [at[0] - x, at[1] - y]);
            [0, 1].map(|i| (high[i] - low[i]) / (2.0 * h))
        });
        let mixed = 0.5 * (across[1] + along[0]);
        [[across[0], mixed], [mixed, along[1]]]
    }

    /// Log-likelihood of residuals. A code represents all values within ½ of it.
    fn log_likelihood(&self, residuals: &Folded, [shape, log_scale]: [f64; 2]) -> f64 {
        let mut table = self.table.borrow_mut();
        table.set_shape(shape);
        let scale = libm::exp(log_scale);
        let (mut inner, mut outer) = (table.falling(), table.falling());
        // Residuals below ½ need the distribution above 0: mirror it, in the descending order that the reader requires.
        let mut mirrored: Vec<f64> = Vec::new();
        let small = residuals.0.partition_point(|(size, _)| *size < 0.5);
        let mut mirrored_reader = table.falling();
        for (size, _) in residuals.0[..small].iter().rev() {
            mirrored.push(1.0 - mirrored_reader.at((size - 0.5) / scale));
        }
        let mut mirrored = mirrored.into_iter().rev();
        residuals
            .0
            .iter()
            .map(|(size, count)| {
                let above = if *size < 0.5 { mirrored.next().unwrap_or(0.5) } else { inner.at((0.5 - size) / scale) };
                let probability = above - outer.at((-0.5 - size) / scale);
                count * libm::log(probability.max(MIN_PROBABILITY))
            })
            .sum()
    }
}
