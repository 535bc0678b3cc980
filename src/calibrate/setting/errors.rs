//! Standard errors of a setting by bootstrap over frame pairs: [`Errors`].

use super::super::bias::BiasFit;
use super::super::bootstrap::{DrawnGroups, Draws, deviation};
use super::super::flats::{Base, Flats, gain};

/// Standard errors; `None` where there is a single pair.
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
    /// Draws pairs of bias frames and pairs of flats, each on their own.
    pub(super) fn draw(bias: &BiasFit, flats: &Flats) -> Self {
        let bias_draws = Draws::new(DrawnGroups::Bias, bias.pairs());
        let flat_draws = Draws::new(DrawnGroups::Flats, flats.pairs());
        let draws: Vec<Draw> = bias_draws
            .weights()
            .zip(flat_draws.weights())
            .map(|(bias_weights, flat_weights)| {
                // A last frame without a partner counts once in each draw.
                let mut weights = bias_weights.to_vec();
                weights.resize(bias.groups(), 1.0);
                draw(bias, flats, &weights, flat_weights)
            })
            .collect();
        let of_bias = |of: &dyn Fn(&Draw) -> f64| deviation(draws.iter().map(of), bias.pairs());
        let planes = draws.first().map_or(0, |draw| draw.offsets.len());
        Self {
            gain: deviation(draws.iter().map(|draw| draw.gain), flats.pairs()),
            shape: of_bias(&|draw| draw.read[0]),
            log_scale: of_bias(&|draw| draw.read[1]),
            row: of_bias(&|draw| draw.row),
            offsets: (0..planes)
                .map(|plane| of_bias(&|draw| draw.offsets[plane]))
                .collect(),
        }
    }
}

fn draw(bias: &BiasFit, flats: &Flats, bias_weights: &[f64], flat_weights: &[f64]) -> Draw {
    let (offsets, noise) = (bias.offsets(bias_weights), bias.noise(bias_weights));
    let base = Base {
        offsets: &offsets,
        within: noise.within,
    };
    Draw {
        gain: gain(&flats.points(base, flat_weights)),
        row: noise.row_deviation(),
        read: bias.read.resampled(bias_weights),
        offsets,
    }
}
