//! Standard errors of a setting by bootstrap over frame pairs: [`Errors`].

use super::super::bias::BiasFit;
use super::super::bootstrap::{DrawnGroups, Draws, deviation};
use super::super::flats::{Base, Flats, gain};

/// Standard errors; `None` with a single pair.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Errors {
    pub(super) gain: Option<f64>,
    /// Of λ.
    pub(super) shape: Option<f64>,
    /// Of ln σ_TL.
    pub(super) log_scale: Option<f64>,
    pub(super) row: Option<f64>,
    /// Of the offset of each plane.
    pub(super) offsets: Vec<Option<f64>>,
}

/// The fit of one draw.
struct Draw {
    offsets: Vec<f64>,
    row: f64,
    read: [f64; 2],
    gain: f64,
}

impl Errors {
    /// Estimates the errors by independent draws of bias pairs and flat pairs.
    pub(super) fn estimate(bias: &BiasFit, flats: &Flats) -> Self {
        let bias_draws = Draws::new(DrawnGroups::Bias, bias.pairs());
        let flat_draws = Draws::new(DrawnGroups::Flats, flats.pairs());
        let draws: Vec<Draw> = bias_draws
            .weights()
            .zip(flat_draws.weights())
            .map(|(bias_weights, flat_weights)| {
                // A last frame without a partner has weight 1 in every draw.
                let mut weights = bias_weights.to_vec();
                weights.resize(bias.groups(), 1.0);
                fit_draw(bias, flats, &weights, flat_weights)
            })
            .collect();
        let bias_error = |value: &dyn Fn(&Draw) -> f64| deviation(draws.iter().map(value), bias.pairs());
        let planes = draws.first().map_or(0, |draw| draw.offsets.len());
        Self {
            gain: deviation(draws.iter().map(|draw| draw.gain), flats.pairs()),
            shape: bias_error(&|draw| draw.read[0]),
            log_scale: bias_error(&|draw| draw.read[1]),
            row: bias_error(&|draw| draw.row),
            offsets: (0..planes).map(|plane| bias_error(&|draw| draw.offsets[plane])).collect(),
        }
    }
}

/// Fits a draw of the bias groups and the flat pairs, given by their weights.
fn fit_draw(bias: &BiasFit, flats: &Flats, bias_weights: &[f64], flat_weights: &[f64]) -> Draw {
    let (offsets, noise) = (bias.offsets(bias_weights), bias.noise(bias_weights));
    let base = Base { offsets: &offsets, within: noise.within };
    Draw {
        gain: gain(&flats.points(base, flat_weights)),
        row: noise.row_deviation(),
        read: bias.read.resampled(bias_weights),
        offsets,
    }
}
