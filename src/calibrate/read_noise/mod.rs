//! Shape λ and scale σ_TL of read noise, from the residuals of bias frames: [`ReadNoise`].
//!
//! They are the values of greatest likelihood of the whole codes, so that rounding is not taken for noise. Those of the probability
//! plot (Wei et al. 2021), by which the published calibrations were made, stand beside them.

mod likelihood;
mod plot;
mod simplex;
mod tukey;

pub(super) use plot::{PlotFit, plot_fit};

use super::sums::Residuals;
use likelihood::{Folded, Likelihood};

/// Read noise of a setting, with what a resample of its frames needs.
#[derive(Debug, Clone)]
pub(super) struct ReadNoise {
    /// Shape λ of the Tukey-λ distribution.
    pub(super) shape: f64,
    /// ln of its scale σ_TL in ADU.
    pub(super) log_scale: f64,
    /// Derivatives of the log-likelihood of each group of frames by λ and ln σ_TL, at these values.
    scores: Vec<[f64; 2]>,
    /// The inverse of the second derivatives of the whole log-likelihood.
    inverse: [[f64; 2]; 2],
}

impl ReadNoise {
    /// The values of greatest likelihood for the residuals of some groups of frames together.
    ///
    /// # Errors
    /// If there is no spread, or no values near which the likelihood has a greatest one.
    pub(super) fn fit(groups: &[Residuals]) -> Result<Self, String> {
        let mut all = Residuals::default();
        for group in groups {
            all.add(group);
        }
        let likelihood = Likelihood::new(Folded::new(&all));
        let [shape, log_scale] = likelihood.greatest()?;
        let curvature = likelihood.curvature([shape, log_scale]);
        let inverse = inverse(curvature)
            .ok_or("the shape and the scale of the read noise cannot be separated")?;
        let scores = groups
            .iter()
            .map(Folded::new)
            .map(|group| likelihood.score(&group, [shape, log_scale]));
        Ok(Self {
            shape,
            log_scale,
            scores: scores.collect(),
            inverse,
        })
    }

    /// λ and ln σ_TL if each group counts as often as its weight says, by one step of Newton's method from the fit.
    pub(super) fn resampled(&self, weights: &[f64]) -> [f64; 2] {
        let sums = self.scores.iter().zip(weights);
        let [a, b] = sums.fold([0.0; 2], |[a, b], (score, weight)| {
            [a + weight * score[0], b + weight * score[1]]
        });
        let [first, second] = self.inverse;
        [
            self.shape - (first[0] * a + first[1] * b),
            self.log_scale - (second[0] * a + second[1] * b),
        ]
    }
}

/// The inverse of a matrix of negative curvature; `None` if it is none.
fn inverse([[a, b], [c, d]]: [[f64; 2]; 2]) -> Option<[[f64; 2]; 2]> {
    let determinant = a * d - b * c;
    (a < 0.0 && determinant > 0.0).then(|| {
        [
            [d / determinant, -b / determinant],
            [-c / determinant, a / determinant],
        ]
    })
}

#[cfg(test)]
mod tests;
