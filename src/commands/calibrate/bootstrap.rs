//! Standard errors by the bootstrap over frame pairs: [`Draws`].

use crate::types::FrameId;
use darkqa_light::{Component, NoiseKey, Site};

/// Number of draws (chosen: the relative error of a standard error is then 3 %).
const DRAWS: usize = 1000;

/// Bootstrap draws of groups of frames.
///
/// A draw has n − 1 of n groups, with replacement, so that the variance of a mean over the draws is unbiased for few
/// groups too (Rao and Wu 1988, Journal of the American Statistical Association 83:231).
#[derive(Debug)]
pub(super) struct Draws {
    /// Weights of the groups in each draw, with mean 1.
    weights: Vec<Vec<f64>>,
}

/// Kind of groups; each kind is drawn independently.
#[derive(Debug, Clone, Copy)]
pub(super) enum DrawnGroups {
    Bias,
    Flats,
}

impl Draws {
    /// Draws from this number of groups. A single group has weight 1 in every draw.
    pub(super) fn new(kind: DrawnGroups, groups: usize) -> Self {
        let key = NoiseKey::new(0, &FrameId("calibrate".to_owned()));
        let stream = key.stream(Component::Resamples);
        let weights = (0..DRAWS)
            .map(|draw| {
                if groups < 2 {
                    return vec![1.0; groups];
                }
                let mut weights = vec![0.0; groups];
                let share = groups as f64 / (groups - 1) as f64;
                for pick in 0..groups - 1 {
                    let site = Site::new(2 * draw + kind as usize, pick);
                    // The upper half of the 64-bit product is uniform from 0 to n − 1, except for a bias of n / 2³².
                    let word = u64::from(stream.words(site, 0)[0]);
                    weights[((word * groups as u64) >> 32) as usize] += share;
                }
                weights
            })
            .collect();
        Self { weights }
    }

    /// Weights of each draw.
    pub(super) fn weights(&self) -> impl Iterator<Item = &[f64]> {
        self.weights.iter().map(Vec::as_slice)
    }
}

/// Standard deviation of values, one for each draw; `None` for fewer than two groups.
pub(super) fn deviation(values: impl Iterator<Item = f64>, groups: usize) -> Option<f64> {
    if groups < 2 {
        return None;
    }
    let values: Vec<f64> = values.collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    Some((squares / (n - 1.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five groups with known values: the error of their mean is known.
    #[test]
    fn the_error_of_a_mean_is_unbiased_for_few_values() {
        let values = [1.0, 4.0, 2.0, 8.0, 5.0];
        let mean = values.iter().sum::<f64>() / 5.0;
        let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
        let expected = (squares / 4.0 / 5.0_f64).sqrt();
        let draws = Draws::new(DrawnGroups::Bias, 5);
        let means = draws.weights().map(|weights| {
            assert!((weights.iter().sum::<f64>() - 5.0).abs() < 1e-12);
            values.iter().zip(weights).map(|(v, w)| v * w).sum::<f64>() / 5.0
        });
        let error = deviation(means, 5).unwrap();
        assert!((error / expected - 1.0).abs() < 0.08, "{error}, {expected}");
        assert_eq!(deviation([1.0, 2.0].into_iter(), 1), None);
        let other = Draws::new(DrawnGroups::Flats, 5);
        assert!(draws.weights().zip(other.weights()).any(|(a, b)| a != b));
    }
}
