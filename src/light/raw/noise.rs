//! Sensor noise in four terms: [`shot`], [`read`], [`row`] and [`quantisation`]; [`add`] combines them.
//!
//! The terms work in ADU on the sites of one Bayer plane in one sensor row, and draw from the random bits of those
//! sites.
//!
//! In the paper, the ratio r applies only to the shot noise ("reduce the signal by r, add Poisson noise, amplify back
//! by r"): read, row and quantisation noise are added to the amplified signal. In ELD, all four terms are added to the
//! attenuated signal. [`Amplify`] selects one of the two. In the first, the three terms add less than 0.1 codes to an
//! image (measured in `departures`).

use std::sync::Arc;

use rayon::prelude::*;

use super::bayer::{Bayer, Plane, RawRow};
use crate::camera::CameraState;
use crate::draws::{Component, LANES, Lanes, NoiseKey, Quantile, Site, Stream, poisson};
use crate::noise_profile::Amplify;
use darkqa_base::types::images::{Isa, Kernel};

/// One term of the noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Term {
    /// Photon shot noise: Poisson-distributed electrons.
    Shot,
    /// Read noise: Tukey-λ distributed, with an offset for each plane.
    Read,
    /// Row noise: one normal number for each sensor row.
    Row,
    /// Quantisation noise: uniform within one ADU.
    Quantisation,
}

impl Term {
    /// All four terms, in the order in which they are added.
    pub const ALL: [Self; 4] = [Self::Shot, Self::Read, Self::Row, Self::Quantisation];
}

/// Adds the given terms to a RAW image (DarkQA, N₄ ∘ N₃ ∘ N₂ ∘ N₁). Leaving out a term does not change the others'
/// draws.
pub fn add(raw: &mut Bayer, state: &CameraState, key: &NoiseKey, amplify: Amplify, terms: &[Term]) {
    let noise = Noise::new(state, key, amplify, terms, Isa::best());
    raw.lines_mut().enumerate().for_each(|(row, mut line)| {
        noise.apply(row, &mut line);
        line.repeat_edges();
    });
}

/// Photon shot noise on the attenuated signal y: K · Poisson(y / K), with mean y and variance K · y.
#[inline(always)]
pub fn shot(adu: &mut Lanes<f32>, gain: f32, words: [&Lanes<u32>; 2]) {
    for y in adu.iter_mut() {
        *y /= gain;
    }
    poisson::lanes(adu, words);
    for y in adu {
        *y *= gain;
    }
}

/// Read noise: σ_TL · Q_λ(u) plus the offset of the plane (Wei et al. 2021).
#[inline(always)]
pub fn read(adu: &mut Lanes<f32>, scale: f32, shape: &Quantile, offset: f32, words: &Lanes<u32>) {
    let quantiles = shape.lanes(words);
    for (y, quantile) in adu.iter_mut().zip(&quantiles) {
        *y += scale * quantile + offset;
    }
}

/// Row noise: one number of N(0, σ_r²) for a whole sensor row, that is, for both of its planes (Wei et al. 2021).
///
/// The paper states "each row" of a RAW image of H/2 × W/2 × 4 samples. Because circuits read out sensor rows, the two
/// sensor rows in each such row get separate numbers.
#[must_use]
pub fn row(deviation: f64, stream: Stream, row: usize) -> f32 {
    (deviation * stream.at(Site::new(row, 0)).normal()) as f32
}

/// Quantisation noise: U(−½, ½), the error of rounding to a whole ADU.
#[inline(always)]
pub fn quantisation(adu: &mut Lanes<f32>, words: &Lanes<u32>) {
    for (y, word) in adu.iter_mut().zip(words) {
        *y += word.cast_signed() as f32 * (1.0 / 4_294_967_296.0);
    }
}

/// Noise of one frame, prepared for any row.
#[derive(Debug)]
pub(super) struct Noise {
    amplify: Amplify,
    /// White in ADU divided by r: the scale of the samples when the shot noise is added.
    attenuated: f32,
    ratio: f32,
    adu_range: f32,
    /// System gain K, in ADU per electron; `None` without shot noise.
    shot: Option<f32>,
    /// Scale in ADU and quantile function; `None` without read noise.
    read: Option<(f32, Arc<Quantile>)>,
    bias: [f32; 4],
    /// Standard deviation in ADU and random stream; `None` without row noise.
    row: Option<(f64, Stream)>,
    quantisation: bool,
    field: Stream,
    isa: Isa,
}

impl Noise {
    pub(super) fn new(state: &CameraState, key: &NoiseKey, amplify: Amplify, terms: &[Term], isa: Isa) -> Self {
        Self {
            amplify,
            attenuated: (state.adu_range / state.ratio) as f32,
            ratio: state.ratio as f32,
            adu_range: state.adu_range as f32,
            shot: terms.contains(&Term::Shot).then_some(state.system_gain as f32),
            read: terms.contains(&Term::Read).then(|| {
                let shape = Quantile::cached_tukey_lambda(state.read_shape);
                (state.read_scale as f32, shape)
            }),
            bias: state.bias.map(|offset| offset as f32),
            row: terms.contains(&Term::Row).then(|| (state.row_deviation, key.stream(Component::Row))),
            quantisation: terms.contains(&Term::Quantisation),
            field: key.stream(Component::RandomField),
            isa,
        }
    }

    /// Scales a sensor row to ADU, adds the noise and scales it back.
    pub(super) fn apply(&self, at: usize, line: &mut RawRow<'_>) {
        let row_offset = match self.row {
            Some((deviation, stream)) => row(deviation, stream, at),
            None => 0.0,
        };
        for (parity, samples) in line.planes().into_iter().enumerate() {
            self.isa.run(NoisyRow {
                noise: self,
                site: [at, parity],
                offset: self.bias[Plane::at(at, parity) as usize],
                row_offset,
                samples,
            });
        }
    }
}

/// Sites of one plane in one row, with the noise to add.
struct NoisyRow<'a> {
    noise: &'a Noise,
    /// Row and first column.
    site: [usize; 2],
    offset: f32,
    row_offset: f32,
    samples: &'a mut [Lanes<f32>],
}

impl Kernel for NoisyRow<'_> {
    #[inline(always)]
    fn run(self) {
        let [row, first] = self.site;
        for (index, samples) in self.samples.iter_mut().enumerate() {
            let site = Site::new(row, first + 2 * LANES * index);
            self.noise.apply_to_lanes(samples, site, self.offset, self.row_offset);
        }
    }
}

impl Noise {
    #[inline(always)]
    fn apply_to_lanes(&self, adu: &mut Lanes<f32>, first: Site, offset: f32, row_offset: f32) {
        let field = self.field.field(first);
        scale(adu, self.attenuated);
        if let Some(gain) = self.shot {
            shot(adu, gain, [&field.shot[0], &field.shot[1]]);
        }
        if self.amplify == Amplify::ShotOnly {
            scale(adu, self.ratio);
        }
        if let Some((scale, shape)) = &self.read {
            read(adu, *scale, shape, offset, &field.read);
        }
        for y in adu.iter_mut() {
            *y += row_offset;
        }
        if self.quantisation {
            quantisation(adu, &field.quantisation);
        }
        if self.amplify == Amplify::All {
            scale(adu, self.ratio);
        }
        scale(adu, 1.0 / self.adu_range);
    }
}

#[inline(always)]
fn scale(adu: &mut Lanes<f32>, factor: f32) {
    for y in adu {
        *y *= factor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::tests::median;
    use darkqa_base::types::FrameId;

    fn key() -> NoiseKey {
        NoiseKey::new(21, &FrameId("noise".to_owned()))
    }

    /// A grey RAW image with the given noise terms, row by row.
    fn noisy(state: &CameraState, amplify: Amplify, terms: &[Term]) -> Vec<Vec<f32>> {
        let mut raw = Bayer::covering(8, 12);
        raw.lines_mut().for_each(|mut line| {
            for plane in line.planes() {
                plane.as_flattened_mut().fill(0.3);
            }
        });
        add(&mut raw, state, &key(), amplify, terms);
        (0..8).map(|row| (0..12).map(|column| raw.sample(row, column)).collect()).collect()
    }

    #[test]
    fn read_noise_offsets_each_plane() {
        let state = CameraState { read_scale: 0.0, bias: [100.0, 200.0, 300.0, 400.0], ..median() };
        let rows = noisy(&state, Amplify::ShotOnly, &[Term::Read]);
        let range = state.adu_range as f32;
        for (row, offsets) in [(0, [100.0, 200.0]), (1, [300.0, 400.0])] {
            for (column, sample) in rows[row].iter().enumerate() {
                let offset = (sample - 0.3) * range;
                assert!((offset - offsets[column % 2]).abs() < 0.01);
            }
        }
    }

    #[test]
    fn row_noise_is_one_number_per_row() {
        let rows = noisy(&median(), Amplify::ShotOnly, &[Term::Row]);
        for row in &rows {
            assert!(row.iter().all(|y| y.to_bits() == row[0].to_bits()));
        }
        assert!(rows.windows(2).all(|pair| pair[0] != pair[1]));
    }

    /// The difference that a term makes does not depend on the other terms.
    #[test]
    fn leaving_out_a_term_does_not_change_the_others() {
        for amplify in [Amplify::ShotOnly, Amplify::All] {
            for term in Term::ALL {
                let others: Vec<Term> = Term::ALL.into_iter().filter(|other| *other != term).collect();
                let [all, others, alone, none] =
                    [&Term::ALL[..], &others, &[term], &[]].map(|terms| noisy(&median(), amplify, terms).concat());
                for i in 0..all.len() {
                    let off = (all[i] - others[i]) - (alone[i] - none[i]);
                    assert!(off.abs() < 1e-6, "{term:?}");
                }
            }
        }
    }

    /// With [`Amplify::All`], the terms after the shot noise are r times larger than with [`Amplify::ShotOnly`]; the
    /// shot noise is the same.
    #[test]
    fn the_ratio_amplifies_the_chosen_terms() {
        let state = median();
        let after = [Term::Read, Term::Row, Term::Quantisation];
        let clean = noisy(&state, Amplify::All, &[]).concat();
        let [shot_only, all] = [Amplify::ShotOnly, Amplify::All].map(|amplify| noisy(&state, amplify, &after).concat());
        for ((clean, shot_only), all) in clean.iter().zip(&shot_only).zip(&all) {
            let ratio = state.ratio as f32;
            assert!(((shot_only - clean) * ratio - (all - clean)).abs() < 2e-4);
        }
        let shot = [Amplify::ShotOnly, Amplify::All].map(|amplify| noisy(&state, amplify, &[Term::Shot]).concat());
        for (a, b) in shot[0].iter().zip(&shot[1]) {
            assert!((a - b).abs() < 1e-6);
        }
    }
}
