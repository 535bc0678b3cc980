//! The log-likelihood of residuals for a Tukey-λ distribution that is rounded to whole codes: [`Likelihood`].

use std::cell::RefCell;

use super::super::sums::{Residuals, STEPS};
use super::simplex::{self, Start};
use super::tukey::TukeyTable;

/// Least probability of a residual (chosen). It is far below that of any residual that the distribution makes, and lets single
/// samples of another origin, such as cosmic rays, count for little.
const LEAST_PROBABILITY: f64 = 1e-12;

/// Range of λ that is searched. Below −½ the variance is infinite; 1 is the uniform distribution.
const SHAPES: [f64; 2] = [-0.49, 1.0];

/// Step of the derivatives in λ and in ln σ_TL (chosen: the table of the distribution is linear between points that are nearer).
const DERIVATIVE_STEP: f64 = 2e-3;

/// Residuals by size, in ADU and ascending, with their counts: a distribution symmetric about 0 knows no sign.
#[derive(Debug, Clone)]
pub(super) struct Folded(Vec<(f64, f64)>);

impl Folded {
    pub(super) fn new(residuals: &Residuals) -> Self {
        let mut folded: Vec<(i64, u64)> = Vec::new();
        let mut all: Vec<(i64, u64)> = residuals
            .counts()
            .into_iter()
            .map(|(steps, count)| (steps.abs(), count))
            .collect();
        all.sort_unstable();
        for (steps, count) in all {
            match folded.last_mut() {
                Some((last, sum)) if *last == steps => *sum += count,
                _ => folded.push((steps, count)),
            }
        }
        let adu = |(steps, count): (i64, u64)| (steps as f64 / STEPS as f64, count as f64);
        Self(folded.into_iter().map(adu).collect())
    }
}

/// The likelihood of some residuals.
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

    /// λ and ln σ_TL of the greatest likelihood.
    ///
    /// # Errors
    /// If all residuals are equal, or the search ends at an end of the range of λ.
    pub(super) fn greatest(&self) -> Result<[f64; 2], String> {
        let squares = self.residuals.0.iter().map(|(size, n)| n * size * size);
        let deviation = (squares.sum::<f64>() / self.count.max(1.0)).sqrt();
        if deviation <= 0.0 || self.count <= 0.0 {
            return Err("bias frames without any noise".to_owned());
        }
        // The deviation of a distribution of scale 1 is 1.8 at λ = 0.
        let log_scale = libm::log(deviation / 1.8);
        let loss = |[shape, log_scale]: [f64; 2]| {
            if !(SHAPES[0]..=SHAPES[1]).contains(&shape) {
                return f64::INFINITY;
            }
            -self.log_likelihood(&self.residuals, [shape, log_scale]) / self.count
        };
        let from = |shape: f64| {
            let start = Start {
                at: [shape, log_scale],
                step: [0.05, 0.1],
            };
            simplex::minimize(start, &loss)
        };
        let (first, second) = (from(-0.1), from(0.1));
        let best = if first.1 <= second.1 {
            first.0
        } else {
            second.0
        };
        let margin = 2.0 * DERIVATIVE_STEP;
        if best[0] < SHAPES[0] + margin || best[0] > SHAPES[1] - margin {
            return Err(format!(
                "the read noise has no Tukey-λ distribution: λ {:.2} is at the end of its range",
                best[0]
            ));
        }
        Ok(best)
    }

    /// The derivatives of the log-likelihood of some of the residuals by λ and ln σ_TL.
    pub(super) fn score(&self, residuals: &Folded, [shape, log_scale]: [f64; 2]) -> [f64; 2] {
        let h = DERIVATIVE_STEP;
        let slope = |[x, y]: [f64; 2]| {
            let up = self.log_likelihood(residuals, [shape + x, log_scale + y]);
            let down = self.log_likelihood(residuals, [shape - x, log_scale - y]);
            (up - down) / (2.0 * h)
        };
        [slope([h, 0.0]), slope([0.0, h])]
    }

    /// The second derivatives of the log-likelihood of all residuals.
    pub(super) fn curvature(&self, at: [f64; 2]) -> [[f64; 2]; 2] {
        let h = DERIVATIVE_STEP;
        let slope = |x: f64, y: f64| self.score(&self.residuals, [at[0] + x, at[1] + y]);
        let (right, left) = (slope(h, 0.0), slope(-h, 0.0));
        let (up, down) = (slope(0.0, h), slope(0.0, -h));
        let second = |high: f64, low: f64| (high - low) / (2.0 * h);
        let mixed = 0.5 * (second(right[1], left[1]) + second(up[0], down[0]));
        [
            [second(right[0], left[0]), mixed],
            [mixed, second(up[1], down[1])],
        ]
    }

    /// The log-likelihood of residuals. A code stands for all values within ½ of it.
    fn log_likelihood(&self, residuals: &Folded, [shape, log_scale]: [f64; 2]) -> f64 {
        let mut table = self.table.borrow_mut();
        table.set_shape(shape);
        let scale = libm::exp(log_scale);
        let (mut inner, mut outer) = (table.falling(), table.falling());
        // Places from 0 to ½ rise to 0 from below when mirrored, before all others fall.
        let mut mirrored: Vec<f64> = Vec::new();
        let small = residuals.0.iter().take_while(|(size, _)| *size < 0.5);
        let mut rising = table.falling();
        for (size, _) in small.collect::<Vec<_>>().into_iter().rev() {
            mirrored.push(1.0 - rising.at((size - 0.5) / scale));
        }
        let mut mirrored = mirrored.into_iter().rev();
        residuals
            .0
            .iter()
            .map(|(size, count)| {
                let above = if *size < 0.5 {
                    mirrored.next().unwrap_or(0.5)
                } else {
                    inner.at((0.5 - size) / scale)
                };
                let probability = above - outer.at((-0.5 - size) / scale);
                count * libm::log(probability.max(LEAST_PROBABILITY))
            })
            .sum()
    }
}
