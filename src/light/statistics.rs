//! Tests of each noise term against theory and `rand_distr` with ten million draws; with a billion draws by
//! `cargo test --release -- --ignored draws`.

use rand_distr::Distribution;
use rayon::prelude::*;

use super::camera::tests::median;
use super::draws::{Component, LANES, Lanes, NoiseKey, Quantile, RandomField, Site, Stream, poisson, tukey_lambda};
use super::raw::noise;
use darkqa_base::types::FrameId;

const TEN_MILLION: usize = 10_000_000;
const BILLION: usize = 1_000_000_000;

/// Largest deviation that passes, in standard errors; chosen.
const BOUND: f64 = 4.0;

fn stream(component: Component) -> Stream {
    NoiseKey::new(21, &FrameId("noise".to_owned())).stream(component)
}

/// Histogram of `n` draws (rounded up to whole batches), computed in parallel by rows of a thousand batches. `tally`
/// counts one batch.
fn histogram(n: usize, bins: usize, tally: impl Fn(&RandomField, &mut [u64]) + Sync) -> Vec<u64> {
    let field = stream(Component::RandomField);
    let rows = n.div_ceil(1000 * LANES);
    (0..rows)
        .into_par_iter()
        .map(|row| {
            let mut counts = vec![0; bins];
            for index in 0..1000 {
                tally(&field.field(Site::new(row, 2 * LANES * index)), &mut counts);
            }
            counts
        })
        .reduce(
            || vec![0; bins],
            |mut a, b| {
                a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                a
            },
        )
}

fn poisson_counts(mean: f64, n: usize) -> Vec<u64> {
    let bins = (mean + 14.0 * mean.sqrt() + 30.0) as usize;
    histogram(n, bins, |field, counts| {
        let mut numbers = [mean as f32; LANES];
        poisson::lanes(&mut numbers, [&field.shot[0], &field.shot[1]]);
        for number in numbers {
            assert!(number >= 0.0 && number.fract() == 0.0);
            counts[number as usize] += 1;
        }
    })
}

fn poisson_probability(mean: f64, count: usize) -> f64 {
    let count = count as f64;
    libm::exp(count * libm::log(mean) - mean - libm::lgamma(count + 1.0))
}

/// χ² of observed counts, in standard deviations from its mean; cells have an expected count of at least 20.
fn chi_square(observed: &[u64], expected: impl Fn(usize) -> f64) -> f64 {
    let (mut chi, mut cells) = (0.0, 0.0);
    let (mut found, mut expected_sum) = (0.0, 0.0);
    for (index, count) in observed.iter().enumerate() {
        found += *count as f64;
        expected_sum += expected(index);
        if expected_sum >= 20.0 {
            chi += (found - expected_sum) * (found - expected_sum) / expected_sum;
            cells += 1.0;
            (found, expected_sum) = (0.0, 0.0);
        }
    }
    let freedom = f64::max(cells - 1.0, 1.0);
    (chi - freedom) / f64::sqrt(2.0 * freedom)
}

/// Mean and variance of a histogram, whose bins have the values `value_at(bin)`.
fn moments(counts: &[u64], value_at: impl Fn(usize) -> f64) -> [f64; 2] {
    let n = counts.iter().sum::<u64>() as f64;
    let (mut sum, mut squares) = (0.0, 0.0);
    for (bin, count) in counts.iter().enumerate() {
        sum += *count as f64 * value_at(bin);
    }
    let mean = sum / n;
    for (bin, count) in counts.iter().enumerate() {
        let off = value_at(bin) - mean;
        squares += *count as f64 * (off * off);
    }
    [mean, squares / n]
}

/// Means on both sides of every boundary of the sampler: multiples of ½, the start of the expansion, the ranges of K
/// and r.
const MEANS: [f64; 16] =
    [0.01, 0.1, 0.3, 0.5, 0.999, 1.75, 4.2, 9.99, 15.5, 31.25, 47.98, 48.0, 64.0, 120.5, 200.0, 1587.1];

fn assert_poisson_distribution(n: usize) {
    for mean in MEANS {
        // The sampler takes single precision.
        let mean = f64::from(mean as f32);
        let counts = poisson_counts(mean, n);
        let n = counts.iter().sum::<u64>() as f64;
        let off = chi_square(&counts, |count| n * poisson_probability(mean, count));
        assert!(off.abs() < BOUND, "mean {mean}: χ² is {off} deviations off");
        let [found, variance] = moments(&counts, |count| count as f64);
        let off = (found - mean) / f64::sqrt(mean / n);
        assert!(off.abs() < BOUND, "mean {mean}: the mean is {off} errors off");
        let off = (variance / mean - 1.0) / f64::sqrt((2.0 + 1.0 / mean) / n);
        assert!(off.abs() < BOUND, "mean {mean}: the variance is {off} errors off");
    }
}

#[test]
fn ten_million_draws_of_shot_noise_follow_poisson() {
    assert_poisson_distribution(TEN_MILLION);
}

#[test]
#[ignore = "a billion draws for each of sixteen means"]
fn a_billion_draws_of_shot_noise_follow_poisson() {
    assert_poisson_distribution(BILLION);
}

/// Random number generator for the samplers of `rand_distr`: a stream and the index of the next draw.
struct ReferenceRng(Stream, usize);

impl rand::TryRng for ReferenceRng {
    type Error = std::convert::Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Self::Error> {
        self.1 += 1;
        Ok(self.0.words(Site::new(self.1 >> 20, self.1 & 0xF_FFFF), 9)[0])
    }

    fn try_next_u64(&mut self) -> Result<u64, Self::Error> {
        let [low, high] = [self.try_next_u32()?, self.try_next_u32()?].map(u64::from);
        Ok(high << 32 | low)
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Self::Error> {
        for byte in bytes {
            *byte = self.try_next_u32()? as u8;
        }
        Ok(())
    }
}

/// χ² of two histograms of equal size, in standard deviations from its mean.
fn chi_square_of_two(ours: &[u64], theirs: &[u64]) -> f64 {
    let (mut chi, mut cells) = (0.0, 0.0);
    for (a, b) in ours.iter().zip(theirs) {
        let [a, b] = [*a as f64, *b as f64];
        if a + b >= 40.0 {
            chi += (a - b) * (a - b) / (a + b);
            cells += 1.0;
        }
    }
    (chi - cells) / f64::sqrt(2.0 * cells)
}

#[test]
fn an_independent_sampler_agrees() {
    for mean in [0.3_f32, 9.0, 44.4, 150.0, 1587.0] {
        let ours = poisson_counts(f64::from(mean), 1_000_000);
        let n = ours.iter().sum::<u64>() as usize;
        let mut theirs = vec![0; ours.len()];
        let poisson = rand_distr::Poisson::new(f64::from(mean)).unwrap();
        for number in poisson.sample_iter(ReferenceRng(stream(Component::Camera), 0)).take(n) {
            theirs[number as usize] += 1;
        }
        let off = chi_square_of_two(&ours, &theirs);
        assert!(off.abs() < BOUND, "mean {mean}: {off}");
    }
}

#[test]
fn shot_noise_keeps_the_mean_and_its_variance_is_k_times_the_mean() {
    for (gain, y) in [(0.1_f32, 28.57_f32), (1.0, 14.28), (6.0, 9.52), (0.1, 158.71)] {
        let counts = histogram(1_000_000, 4000, |field, counts| {
            let mut adu = [y; LANES];
            noise::shot(&mut adu, gain, [&field.shot[0], &field.shot[1]]);
            for z in adu {
                let photons = z / gain;
                assert!((photons - photons.round()).abs() < 1e-3);
                counts[photons.round() as usize] += 1;
            }
        });
        let (gain, y) = (f64::from(gain), f64::from(y));
        let [mean, variance] = moments(&counts, |photons| gain * photons as f64);
        let n = counts.iter().sum::<u64>() as f64;
        assert!((mean - y).abs() < BOUND * f64::sqrt(gain * y / n), "K = {gain}");
        let spread = f64::sqrt((2.0 + gain / y) / n);
        assert!((variance / (gain * y) - 1.0).abs() < BOUND * spread, "K = {gain}");
    }
}

/// All shapes λ of the five calibrated cameras, in units of 1/70.
const SHAPES: [f64; 11] = [-10.0, -9.0, -8.0, -6.0, -4.0, -3.0, 0.0, 3.0, 4.0, 8.0, 9.0];

/// Asserts that read noise has the quantiles of the closed form, including the tails.
fn assert_read_noise_quantiles(n: usize) {
    let lower = [1e-5, 1e-4, 1e-3, 0.01, 0.05, 0.1, 0.25, 0.4, 0.5];
    let upper = lower.iter().rev().skip(1).map(|u| 1.0 - u);
    let levels: Vec<f64> = lower.iter().copied().chain(upper).collect();
    for shape in SHAPES.map(|shape| shape / 70.0) {
        let table = Quantile::tukey_lambda(shape);
        let quantiles: Vec<f32> = levels.iter().map(|u| tukey_lambda(*u, shape) as f32).collect();
        let counts = histogram(n, levels.len() + 1, |field, counts| {
            let mut adu = [0.0; LANES];
            noise::read(&mut adu, 1.0, &table, 0.0, &field.read);
            for x in adu {
                counts[quantiles.partition_point(|quantile| *quantile < x)] += 1;
            }
        });
        let n = counts.iter().sum::<u64>() as f64;
        let mut below = 0.0;
        for (u, count) in levels.iter().zip(&counts) {
            below += *count as f64;
            let off = (below - n * u) / f64::sqrt(n * u * (1.0 - u));
            assert!(off.abs() < BOUND, "λ {shape}, u {u}: {off} errors off");
        }
    }
}

#[test]
fn ten_million_draws_of_read_noise_have_its_quantiles() {
    assert_read_noise_quantiles(TEN_MILLION);
}

#[test]
#[ignore = "a billion draws for each of eleven shapes"]
fn a_billion_draws_of_read_noise_have_its_quantiles() {
    assert_read_noise_quantiles(BILLION);
}

/// Sum and sum of squares of a batch, in double precision.
fn sums(numbers: &Lanes<f32>) -> [f64; 2] {
    let numbers = numbers.map(f64::from);
    [numbers.iter().sum(), numbers.iter().map(|x| x * x).sum()]
}

/// Deviation and offset at both ends and in the middle of the paper's range of K.
#[test]
fn read_noise_has_its_spread_and_its_offset() {
    // λ, σ_TL, standard deviation, excess kurtosis.
    let cases = [
        (8.0 / 70.0, 0.6075, 0.9168, 0.119),
        (-3.0 / 70.0, 1.5647, 3.0637, 1.967),
        (-8.0 / 70.0, 4.0297, 9.0730, 4.510),
    ];
    let field = stream(Component::RandomField);
    for (shape, scale, deviation, kurtosis) in cases {
        let table = Quantile::tukey_lambda(shape);
        let batches = TEN_MILLION / LANES;
        let [sum, squares] = (0..batches)
            .map(|batch| {
                let mut adu = [0.0; LANES];
                let words = field.field(Site::new(batch, 0)).read;
                noise::read(&mut adu, scale as f32, &table, -1.25, &words);
                sums(&adu)
            })
            .fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        let n = (batches * LANES) as f64;
        let mean = sum / n;
        let off = (mean + 1.25) / (deviation / n.sqrt());
        assert!(off.abs() < BOUND, "λ {shape}: the offset is {off} errors off");
        let variance = squares / n - mean * mean;
        let spread = f64::sqrt((kurtosis + 2.0) / n);
        // The deviations above have four digits.
        let off = variance / (deviation * deviation) - 1.0;
        assert!(off.abs() < BOUND * spread + 2e-4, "λ {shape}: variance {variance}");
    }
}

/// Histogram with bins of width 0.1 from −6 to 6.
fn normal_histogram(numbers: impl Iterator<Item = f64>) -> Vec<u64> {
    let mut counts = vec![0; 120];
    for z in numbers {
        counts[((z + 6.0) * 10.0).clamp(0.0, 119.0) as usize] += 1;
    }
    counts
}

#[test]
fn row_noise_is_normal_and_uncorrelated_between_rows() {
    let deviation = 0.6;
    let stream = stream(Component::Row);
    let rows: Vec<f64> =
        (0..TEN_MILLION).into_par_iter().map(|at| f64::from(noise::row(deviation, stream, at)) / deviation).collect();
    let n = rows.len() as f64;
    // Mean, variance, skewness and fourth moment; the variances of these sample moments are 1, 2, 15 and 96 over n.
    for (power, expected, variance) in [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)] {
        let moment = rows.iter().map(|z| z.powi(power)).sum::<f64>() / n;
        let off = (moment - expected) / f64::sqrt(variance / n);
        assert!(off.abs() < BOUND, "moment {power}: {off} errors off");
    }
    for lag in [1, 2, 3, 16] {
        let product: f64 = rows.iter().zip(&rows[lag..]).map(|(a, b)| a * b).sum();
        let off = product / n * n.sqrt();
        assert!(off.abs() < BOUND, "lag {lag}: {off} errors off");
    }
    let ours = normal_histogram(rows.iter().take(1_000_000).copied());
    let words = ReferenceRng(self::stream(Component::Camera), 0);
    let theirs = normal_histogram(rand_distr::StandardNormal.sample_iter(words).take(1_000_000));
    assert!(chi_square_of_two(&ours, &theirs).abs() < BOUND);
}

#[test]
fn quantisation_noise_is_uniform_within_half_a_step() {
    let counts = histogram(TEN_MILLION, 1000, |field, counts| {
        let mut adu = [0.0; LANES];
        noise::quantisation(&mut adu, &field.quantisation);
        for y in adu {
            assert!((-0.5..=0.5).contains(&y));
            counts[(((y + 0.5) * 1000.0) as usize).min(999)] += 1;
        }
    });
    let n = counts.iter().sum::<u64>() as f64;
    assert!(chi_square(&counts, |_| n / 1000.0).abs() < BOUND);
    let [mean, variance] = moments(&counts, |bin| (bin as f64 + 0.5) / 1000.0 - 0.5);
    assert!(mean.abs() < BOUND * f64::sqrt(1.0 / 12.0 / n));
    assert!((variance * 12.0 - 1.0).abs() < BOUND * f64::sqrt(0.8 / n) + 1e-6);
}

/// Shot, read and quantisation noise share a block of the generator: their numbers must not be correlated.
#[test]
fn terms_of_one_site_are_uncorrelated() {
    let state = median();
    let table = Quantile::tukey_lambda(state.read_shape);
    let field = stream(Component::RandomField);
    let mut products = [0.0; 3];
    let mut squares = [0.0; 3];
    let batches = 1_000_000 / LANES;
    for batch in 0..batches {
        let field = field.field(Site::new(batch, 1));
        let mut terms = [[20.0; LANES], [0.0; LANES], [0.0; LANES]];
        noise::shot(&mut terms[0], 1.0, [&field.shot[0], &field.shot[1]]);
        noise::read(&mut terms[1], 1.0, &table, 0.0, &field.read);
        noise::quantisation(&mut terms[2], &field.quantisation);
        let [shot, read, rounding] = terms;
        for ((a, b), c) in shot.into_iter().zip(read).zip(rounding) {
            let [a, b, c] = [a - 20.0, b, c].map(f64::from);
            for (sum, product) in products.iter_mut().zip([a * b, b * c, c * a]) {
                *sum += product;
            }
            for (sum, x) in squares.iter_mut().zip([a, b, c]) {
                *sum += x * x;
            }
        }
    }
    let n = (batches * LANES) as f64;
    for (product, pair) in products.iter().zip([[0, 1], [1, 2], [2, 0]]) {
        let correlation = product / f64::sqrt(squares[pair[0]] * squares[pair[1]]);
        assert!(correlation.abs() < BOUND / n.sqrt(), "{pair:?}: {correlation}");
    }
}
