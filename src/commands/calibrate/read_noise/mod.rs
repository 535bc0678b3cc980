//! Fit of the shape λ and the scale σ_TL of read noise to the residuals of bias frames: [`ReadNoise`].
//!
//! The fit maximizes the likelihood of the integer codes, so that rounding does not count as noise. [`plot_fit`] is the
//! fit by the probability plot (Wei et al. 2021), which the published calibrations use.

mod likelihood;
mod plot;
mod simplex;
mod tukey;

pub(super) use plot::{PlotFit, plot_fit};

use super::sums::Residuals;
use likelihood::{Folded, Likelihood};

/// Read noise of a setting, with the derivatives for resampling its frames.
#[derive(Debug, Clone)]
pub(super) struct ReadNoise {
    /// Shape λ of the Tukey-λ distribution.
    pub(super) shape: f64,
    /// ln of its scale σ_TL in ADU.
    pub(super) log_scale: f64,
    /// Derivatives of the log-likelihood of each group of frames with respect to λ and ln σ_TL, at the fitted values.
    scores: Vec<[f64; 2]>,
    /// Inverse of the matrix of second derivatives of the whole log-likelihood.
    inverse: [[f64; 2]; 2],
}

impl ReadNoise {
    /// Fits the residuals of all groups of frames together.
    ///
    /// # Errors
    /// If the residuals have no spread, or the likelihood has no maximum.
    pub(super) fn fit(groups: &[Residuals]) -> Result<Self, String> {
        let mut all = Residuals::default();
        for group in groups {
            all.add(group);
        }
        let likelihood = Likelihood::new(Folded::new(&all));
        let [shape, log_scale] = likelihood.maximize()?;
        let curvature = likelihood.curvature([shape, log_scale]);
        let inverse = inverse(curvature).ok_or("the shape and the scale of the read noise cannot be separated")?;
        let scores = groups.iter().map(|group| likelihood.score(&Folded::new(group), [shape, log_scale])).collect();
        Ok(Self { shape, log_scale, scores, inverse })
    }

    /// λ and ln σ_TL with one weight for each group, by one step of Newton's method from the fit.
    pub(super) fn resampled(&self, weights: &[f64]) -> [f64; 2] {
        let [a, b] = self
            .scores
            .iter()
            .zip(weights)
            .fold([0.0; 2], |[a, b], (score, weight)| [a + weight * score[0], b + weight * score[1]]);
        let [first, second] = self.inverse;
        [self.shape - (first[0] * a + first[1] * b), self.log_scale - (second[0] * a + second[1] * b)]
    }
}

/// Inverse of a negative definite matrix; `None` if the matrix is not negative definite.
fn inverse([[a, b], [c, d]]: [[f64; 2]; 2]) -> Option<[[f64; 2]; 2]> {
    let determinant = a * d - b * c;
    (a < 0.0 && determinant > 0.0).then(|| [[d / determinant, -b / determinant], [-c / determinant, a / determinant]])
}

#[cfg(test)]
mod tests;
