//! The noise of a sensor in four terms: [`shot`], [`read`], [`row`] and [`quantisation`]; [`add`] puts them together.
//!
//! Each term works on one sensor row in ADU and takes each of its numbers from the site it is for, in double precision.
//!
//! By the paper's wording the ratio r belongs to the shot noise alone ("reduce the signal by r, add Poisson noise,
//! amplify back by r"), and read, row and quantisation noise act on the amplified signal. ELD lets all four act on the
//! attenuated one. [`Amplify`] chooses.

use rayon::prelude::*;

use super::bayer::{Bayer, Plane};
use super::camera::CameraState;
use super::poisson;
use super::profile::Amplify;
use super::random::{Component, NoiseKey, Site, Stream};
use super::sensor::ADU_RANGE;

/// One term of the noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Term {
    /// Photon shot noise.
    Shot,
    /// Read noise.
    Read,
    /// Row noise.
    Row,
    /// Quantisation noise.
    Quantisation,
}

impl Term {
    /// All four, in the order in which they act.
    pub const ALL: [Self; 4] = [Self::Shot, Self::Read, Self::Row, Self::Quantisation];
}

/// Adds the given terms to a RAW image (DarkQA, N₄ ∘ N₃ ∘ N₂ ∘ N₁). Leaving one out changes no draw of the others.
pub fn add(raw: &mut Bayer, state: &CameraState, key: &NoiseKey, amplify: Amplify, terms: &[Term]) {
    let stream = |term, component| terms.contains(&term).then(|| key.stream(component));
    let shots = stream(Term::Shot, Component::Shot);
    let reads = stream(Term::Read, Component::Read);
    let rows = stream(Term::Row, Component::Row);
    let roundings = stream(Term::Quantisation, Component::Quantisation);
    raw.rows_mut()
        .enumerate()
        .for_each_init(Vec::new, |adu, (at, samples)| {
            adu.clear();
            adu.extend(samples.iter().map(|sample| f64::from(*sample) * ADU_RANGE));
            scale(adu, 1.0 / state.ratio);
            if let Some(stream) = shots {
                shot(adu, at, state, stream);
            }
            if amplify == Amplify::ShotOnly {
                scale(adu, state.ratio);
            }
            if let Some(stream) = reads {
                read(adu, at, state, stream);
            }
            if let Some(stream) = rows {
                row(adu, at, state, stream);
            }
            if let Some(stream) = roundings {
                quantisation(adu, at, stream);
            }
            if amplify == Amplify::All {
                scale(adu, state.ratio);
            }
            for (sample, adu) in samples.iter_mut().zip(adu) {
                *sample = (*adu / ADU_RANGE) as f32;
            }
        });
}

/// Photon shot noise on the attenuated signal y: K · Poisson(y / K), of mean y and variance K · y.
pub fn shot(adu: &mut [f64], row: usize, state: &CameraState, stream: Stream) {
    for (column, y) in adu.iter_mut().enumerate() {
        let photons = *y / state.system_gain;
        *y = state.system_gain * poisson::draw(photons, stream, Site::new(row, column));
    }
}

/// Read noise: σ_TL · Q_λ(u) and the offset of the plane (Wei et al. 2021).
pub fn read(adu: &mut [f64], row: usize, state: &CameraState, stream: Stream) {
    for (column, y) in adu.iter_mut().enumerate() {
        let u = stream.uniform(Site::new(row, column));
        let offset = state.bias[Plane::at(row, column) as usize];
        *y += state.read_scale * tukey_lambda(u, state.read_shape) + offset;
    }
}

/// Row noise: one number of N(0, σ_r²) for the whole sensor row, that is for both of its planes (Wei et al. 2021).
pub fn row(adu: &mut [f64], row: usize, state: &CameraState, stream: Stream) {
    let offset = state.row_deviation * stream.normal(Site::new(row, 0), 0);
    for y in adu {
        *y += offset;
    }
}

/// Quantisation noise: U(−0.5, 0.5), the error of rounding to a whole ADU.
pub fn quantisation(adu: &mut [f64], row: usize, stream: Stream) {
    for (column, y) in adu.iter_mut().enumerate() {
        *y += stream.uniform(Site::new(row, column)) - 0.5;
    }
}

/// The quantile function of Tukey's λ distribution, (u^λ − (1 − u)^λ) / λ and ln u − ln(1 − u) at λ = 0, for u in the
/// open interval (0, 1).
///
/// Written as a difference of exp(λ ln u) − 1, which keeps its digits for every λ near 0.
#[must_use]
pub fn tukey_lambda(u: f64, shape: f64) -> f64 {
    let (below, above) = (libm::log(u), libm::log(1.0 - u));
    if shape == 0.0 {
        below - above
    } else {
        (libm::expm1(shape * below) - libm::expm1(shape * above)) / shape
    }
}

fn scale(adu: &mut [f64], factor: f64) {
    for y in adu {
        *y *= factor;
    }
}

#[cfg(test)]
mod tests {
    use super::super::camera::tests::median;
    use super::*;
    use crate::types::FrameId;

    const WIDTH: usize = 1000;

    fn key() -> NoiseKey {
        NoiseKey::new(21, &FrameId("noise".to_owned()))
    }

    /// Rows of `WIDTH` samples, each starting at `y` ADU, after `term` has acted on them.
    fn field(
        y: f64,
        rows: usize,
        component: Component,
        term: impl Fn(&mut [f64], usize, Stream),
    ) -> Vec<Vec<f64>> {
        let stream = key().stream(component);
        (0..rows)
            .map(|row| {
                let mut adu = vec![y; WIDTH];
                term(&mut adu, row, stream);
                adu
            })
            .collect()
    }

    /// Mean and variance.
    fn moments<'a>(numbers: impl Iterator<Item = &'a f64> + Clone) -> [f64; 2] {
        let n = numbers.clone().count() as f64;
        let mean = numbers.clone().sum::<f64>() / n;
        let variance = numbers.map(|x| (x - mean).powi(2)).sum::<f64>() / n;
        [mean, variance]
    }

    #[test]
    fn shot_noise_keeps_the_mean_and_has_k_times_its_variance() {
        for (gain, y, variance) in [(0.1, 28.57, 2.857), (1.0, 14.28, 14.28), (6.0, 9.52, 57.12)] {
            let state = CameraState {
                system_gain: gain,
                ..median()
            };
            let field = field(y, 400, Component::Shot, |adu, row, stream| {
                shot(adu, row, &state, stream);
            });
            let [mean, found] = moments(field.iter().flatten());
            let n = (400 * WIDTH) as f64;
            assert!(
                (mean - y).abs() < 5.0 * f64::sqrt(variance / n),
                "K = {gain}"
            );
            let spread = f64::sqrt((2.0 + gain / y) / n);
            assert!((found / variance - 1.0).abs() < 5.0 * spread, "K = {gain}");
            let steps = field.iter().flatten().map(|z| z / gain);
            assert!(
                steps
                    .into_iter()
                    .all(|step| (step - step.round()).abs() < 1e-9)
            );
        }
    }

    #[test]
    fn the_quantile_function_is_the_closed_form() {
        let u = [1e-5, 1e-3, 0.01, 0.25, 0.5, 0.75, 0.99, 0.999, 1.0 - 1e-5];
        for shape in [
            -1.0 / 7.0,
            -0.042857,
            0.042857,
            0.114286,
            1.0 / 7.0,
            1.0,
            2.0,
        ] {
            for u in u {
                let due = (f64::powf(u, shape) - f64::powf(1.0 - u, shape)) / shape;
                let found = tukey_lambda(u, shape);
                assert!(
                    (found - due).abs() < 1e-12 * due.abs().max(1.0),
                    "λ {shape}, u {u}"
                );
            }
        }
        for u in u {
            let due = (u / (1.0 - u)).ln();
            assert!((tukey_lambda(u, 0.0) - due).abs() < 1e-12 * due.abs().max(1.0));
            assert!((tukey_lambda(u, 1e-12) - due).abs() < 1e-9 * due.abs().max(1.0));
        }
        let tiny = f64::EPSILON / 2.0;
        for shape in [-1.0 / 7.0, 0.0, 1.0 / 7.0] {
            assert!(tukey_lambda(tiny, shape).is_finite());
            assert!(tukey_lambda(1.0 - tiny, shape).is_finite());
        }
    }

    /// Spread and tails of the read noise at both ends and the middle of the paper's range of K. The tails are the point
    /// of the distribution: the counts beyond its quantiles at 10⁻⁵ and 10⁻³ are those of the closed form.
    #[test]
    fn read_noise_has_its_spread_and_its_tails() {
        // λ, σ_TL, standard deviation, excess kurtosis and the quantile at 0.001.
        let cases = [
            (8.0 / 70.0, 0.6075, 0.9168, 0.119, -2.9012),
            (-3.0 / 70.0, 1.5647, 3.0637, 1.967, -12.577),
            (-8.0 / 70.0, 4.0297, 9.0730, 4.510, -42.386),
        ];
        for (shape, scale, deviation, kurtosis, thousandth) in cases {
            let state = CameraState {
                read_shape: shape,
                read_scale: scale,
                bias: [0.0; 4],
                ..median()
            };
            let rows = 1000;
            let field = field(0.0, rows, Component::Read, |adu, row, stream| {
                read(adu, row, &state, stream);
            });
            let n = (rows * WIDTH) as f64;
            let [mean, variance] = moments(field.iter().flatten());
            assert!(mean.abs() < 5.0 * deviation / n.sqrt(), "λ {shape}");
            let spread = 5.0 * f64::sqrt((kurtosis + 2.0) / n);
            let off = variance / (deviation * deviation) - 1.0;
            assert!(off.abs() < spread, "λ {shape}: variance {variance}");
            assert!((scale * tukey_lambda(1e-3, shape) - thousandth).abs() < 1e-3);
            for u in [1e-5, 1e-3, 0.5, 1.0 - 1e-3, 1.0 - 1e-5] {
                let quantile = scale * tukey_lambda(u, shape);
                let below = field.iter().flatten().filter(|x| **x < quantile).count() as f64;
                let bound = 5.0 * (n * u * (1.0 - u)).sqrt();
                assert!(
                    (below - n * u).abs() < bound,
                    "λ {shape}, u {u}: {below} below"
                );
            }
        }
    }

    #[test]
    fn read_noise_offsets_each_plane() {
        let state = CameraState {
            read_scale: 0.0,
            bias: [1.0, 2.0, 3.0, 4.0],
            ..median()
        };
        let field = field(0.0, 2, Component::Read, |adu, row, stream| {
            read(adu, row, &state, stream);
        });
        assert_eq!(field[0][..4], [1.0, 2.0, 1.0, 2.0]);
        assert_eq!(field[1][..4], [3.0, 4.0, 3.0, 4.0]);
    }

    #[test]
    fn row_noise_is_one_number_a_row() {
        let state = CameraState {
            row_deviation: 0.6,
            ..median()
        };
        let rows = 4000;
        let field = field(0.0, rows, Component::Row, |adu, at, stream| {
            row(adu, at, &state, stream);
        });
        for line in &field {
            assert!(line.iter().all(|y| y.to_bits() == line[0].to_bits()));
        }
        let offsets: Vec<f64> = field.iter().map(|line| line[0]).collect();
        let [mean, variance] = moments(offsets.iter());
        let n = rows as f64;
        assert!(mean.abs() < 5.0 * 0.6 / n.sqrt());
        assert!((variance / 0.36 - 1.0).abs() < 5.0 * (2.0 / n).sqrt());
        for lag in [1, 2] {
            let product: f64 = offsets
                .iter()
                .zip(&offsets[lag..])
                .map(|(a, b)| a * b)
                .sum();
            assert!((product / n / variance).abs() < 5.0 / n.sqrt(), "lag {lag}");
        }
    }

    #[test]
    fn quantisation_noise_is_uniform_within_half_a_step() {
        let field = field(0.0, 400, Component::Quantisation, quantisation);
        let [mean, variance] = moments(field.iter().flatten());
        let n = (400 * WIDTH) as f64;
        assert!(mean.abs() < 5.0 * f64::sqrt(1.0 / 12.0 / n));
        assert!((variance * 12.0 - 1.0).abs() < 5.0 * f64::sqrt(0.8 / n));
        assert!(field.iter().flatten().all(|y| y.abs() < 0.5));
    }

    /// The difference that a term makes is the same whatever the other terms are.
    #[test]
    fn switching_a_term_off_leaves_the_others_as_they_were() {
        let noisy = |terms: &[Term]| {
            let mut raw = Bayer::covering(8, 12);
            raw.rows_mut().for_each(|line| line.fill(0.3));
            add(&mut raw, &median(), &key(), Amplify::ShotOnly, terms);
            (0..8)
                .flat_map(|row| raw.row(row).to_vec())
                .collect::<Vec<_>>()
        };
        let difference = |with: &[f32], without: &[f32]| -> Vec<f32> {
            with.iter().zip(without).map(|(a, b)| a - b).collect()
        };
        for term in Term::ALL {
            let others: Vec<Term> = Term::ALL
                .into_iter()
                .filter(|other| *other != term)
                .collect();
            let in_company = difference(&noisy(&Term::ALL), &noisy(&others));
            let alone = difference(&noisy(&[term]), &noisy(&[]));
            assert!(alone.iter().any(|d| *d != 0.0), "{term:?}");
            for (a, b) in in_company.iter().zip(alone) {
                assert!((a - b).abs() < 2e-7, "{term:?}: {a} against {b}");
            }
        }
    }

    /// The sum of the four terms: ratio² · K · B / r for the shot noise, the rest unamplified.
    #[test]
    fn only_the_shot_noise_is_amplified() {
        let state = median();
        let b = 0.2;
        let mut raw = Bayer::covering(600, 600);
        raw.rows_mut().for_each(|line| line.fill(b as f32));
        add(
            &mut raw,
            &state,
            &key(),
            Amplify::ShotOnly,
            &[Term::Read, Term::Row, Term::Quantisation],
        );
        let all: Vec<f64> = (0..600)
            .flat_map(|row| raw.row(row).iter().map(|y| f64::from(*y)))
            .collect();
        let [mean, variance] = moments(all.iter());
        let due = 3.0637f64.powi(2) + state.row_deviation.powi(2) + 1.0 / 12.0;
        assert!((variance * ADU_RANGE * ADU_RANGE / due - 1.0).abs() < 0.02);
        let bias = state.bias.iter().sum::<f64>() / 4.0;
        assert!(((mean - b) * ADU_RANGE - bias).abs() < 0.13);

        raw.rows_mut().for_each(|line| line.fill(b as f32));
        add(&mut raw, &state, &key(), Amplify::ShotOnly, &[Term::Shot]);
        let all: Vec<f64> = (0..600)
            .flat_map(|row| raw.row(row).iter().map(|y| f64::from(*y)))
            .collect();
        let [mean, variance] = moments(all.iter());
        let due = state.system_gain * state.ratio * b / ADU_RANGE;
        assert!((mean - b).abs() < 5.0 * (due / 360_000.0).sqrt());
        assert!((variance / due - 1.0).abs() < 5.0 * f64::sqrt(2.1 / 360_000.0));
    }
}
