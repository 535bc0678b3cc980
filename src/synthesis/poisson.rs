//! Poisson numbers as a pure function of a site: [`draw`].

use super::random::{Site, Stream};

/// The mean from which transformed rejection is valid (Hörmann 1993).
const REJECTION_FROM: f64 = 10.0;

/// A Poisson number of the given mean (≥ 0; zero and below give 0), exact for every mean: no normal approximation.
#[must_use]
pub fn draw(mean: f64, stream: Stream, site: Site) -> f64 {
    if mean >= REJECTION_FROM {
        by_rejection(mean, stream, site)
    } else {
        by_inversion(mean, stream.uniform(site))
    }
}

/// Counts up the distribution function until it passes `uniform`.
fn by_inversion(mean: f64, uniform: f64) -> f64 {
    if mean <= 0.0 {
        return 0.0;
    }
    let mut count = 0.0;
    let mut probability = libm::exp(-mean);
    let mut sum = probability;
    while uniform > sum {
        count += 1.0;
        probability *= mean / count;
        let next = sum + probability;
        // Where rounding keeps the sum below the largest uniform numbers, the tail ends here.
        if next <= sum {
            break;
        }
        sum = next;
    }
    count
}

/// Hörmann's PTRS: transformed rejection with squeeze ("The transformed rejection method for generating Poisson random
/// variables", Insurance: Mathematics and Economics 12, 1993), whose constants these are.
fn by_rejection(mean: f64, stream: Stream, site: Site) -> f64 {
    let b = 0.931 + 2.53 * mean.sqrt();
    let a = -0.059 + 0.02483 * b;
    let squeeze = 0.9277 - 3.6224 / (b - 2.0);
    let mut attempt = 0;
    loop {
        let [first, v] = stream.uniforms(site, attempt);
        attempt += 1;
        let u = first - 0.5;
        let edge = 0.5 - u.abs();
        let count = ((2.0 * a / edge + b) * u + mean + 0.43).floor();
        if edge >= 0.07 && v <= squeeze {
            return count;
        }
        if count < 0.0 || (edge < 0.013 && v > edge) {
            continue;
        }
        let inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
        let height = libm::log(v * inverse_alpha / (a / (edge * edge) + b));
        if height <= log_probability(mean, count) {
            return count;
        }
    }
}

/// ln P(count) of a Poisson distribution.
fn log_probability(mean: f64, count: f64) -> f64 {
    count * libm::log(mean) - mean - libm::lgamma(count + 1.0)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use rand_distr::Distribution;

    use super::super::random::{Component, NoiseKey};
    use super::*;
    use crate::types::FrameId;

    fn stream(seed: u64) -> Stream {
        NoiseKey::new(seed, &FrameId("poisson".to_owned())).stream(Component::Shot)
    }

    fn sample(mean: f64, n: usize) -> impl Iterator<Item = f64> {
        let stream = stream(11);
        (0..n).map(move |i| draw(mean, stream, Site::new(i >> 10, i & 1023)))
    }

    /// χ² of observed against expected counts in cells of at least 20 expected, as standard deviations off its mean.
    fn surprise(observed: &BTreeMap<u64, f64>, expected: impl Fn(u64) -> f64, last: u64) -> f64 {
        let (mut chi, mut cells) = (0.0, 0.0);
        let (mut seen, mut due) = (0.0, 0.0);
        for count in 0..=last {
            seen += observed.get(&count).copied().unwrap_or(0.0);
            due += expected(count);
            if due >= 20.0 {
                chi += (seen - due) * (seen - due) / due;
                cells += 1.0;
                (seen, due) = (0.0, 0.0);
            }
        }
        (chi - (cells - 1.0)) / f64::sqrt(2.0 * f64::max(cells - 1.0, 1.0))
    }

    fn histogram(numbers: impl Iterator<Item = f64>) -> BTreeMap<u64, f64> {
        let mut counts = BTreeMap::new();
        for number in numbers {
            assert!(number >= 0.0 && number.fract() == 0.0);
            *counts.entry(number as u64).or_insert(0.0) += 1.0;
        }
        counts
    }

    const MEANS: [f64; 12] = [
        0.01, 0.3, 1.0, 4.2, 9.99, 10.0, 10.7, 31.0, 64.0, 200.0, 700.0, 1587.1,
    ];

    #[test]
    fn the_whole_distribution_is_poissons() {
        let n = 200_000;
        for mean in MEANS {
            let counts = histogram(sample(mean, n));
            let last = (mean + 12.0 * mean.sqrt() + 12.0) as u64;
            let expected = |count| n as f64 * log_probability(mean, count as f64).exp();
            let off = surprise(&counts, expected, last);
            assert!(off < 5.0, "mean {mean}: χ² is {off} sigma off");
        }
    }

    #[test]
    fn mean_and_variance_agree() {
        let n = 200_000;
        for mean in MEANS {
            let (mut first, mut second) = (0.0, 0.0);
            for number in sample(mean, n) {
                first += (number - mean) / n as f64;
                second += (number - mean).powi(2) / n as f64;
            }
            assert!(first.abs() < 5.0 * (mean / n as f64).sqrt(), "mean {mean}");
            let spread = ((2.0 + 1.0 / mean) / n as f64).sqrt();
            assert!((second / mean - 1.0).abs() < 5.0 * spread, "mean {mean}");
        }
    }

    /// An independent sampler on independent numbers gives the same histogram (χ² of two samples).
    #[test]
    fn an_independent_sampler_agrees() {
        struct Counter(Stream, usize);
        impl rand::TryRng for Counter {
            type Error = std::convert::Infallible;
            fn try_next_u32(&mut self) -> Result<u32, Self::Error> {
                Ok((self.try_next_u64()? >> 32) as u32)
            }
            fn try_next_u64(&mut self) -> Result<u64, Self::Error> {
                self.1 += 1;
                Ok(self.0.words(Site::new(0, self.1), 0)[0])
            }
            fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Self::Error> {
                for byte in bytes {
                    *byte = self.try_next_u64()? as u8;
                }
                Ok(())
            }
        }
        let n = 200_000;
        for mean in [0.3, 9.0, 12.0, 150.0, 1587.0] {
            let ours = histogram(sample(mean, n));
            let poisson = rand_distr::Poisson::new(mean).unwrap();
            let theirs = histogram(poisson.sample_iter(Counter(stream(12), 0)).take(n));
            let (mut chi, mut cells) = (0.0, 0.0);
            for count in 0..4000 {
                let [a, b] = [&ours, &theirs].map(|h| h.get(&count).copied().unwrap_or(0.0));
                if a + b >= 40.0 {
                    chi += (a - b) * (a - b) / (a + b);
                    cells += 1.0;
                }
            }
            assert!((chi - cells) / f64::sqrt(2.0 * cells) < 5.0, "mean {mean}");
        }
    }

    #[test]
    fn the_ends_are_sane() {
        let site = Site::new(0, 0);
        for mean in [0.0, -1.0, 1e-300] {
            assert!(draw(mean, stream(1), site).abs() < f64::EPSILON);
        }
        let nearly_one = 1.0 - f64::EPSILON / 2.0;
        assert!(by_inversion(9.99, nearly_one) < 70.0);
        let huge = draw(1.6e6, stream(1), site);
        assert!((huge - 1.6e6).abs() < 10.0 * f64::sqrt(1.6e6));
    }
}
