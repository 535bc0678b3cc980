//! The cluster bootstrap: [`Resamples`].
//!
//! Seeded random generator of this crate: [`SplitMix`].

use std::convert::Infallible;

use rand::TryRng;
use rand::rand_core::utils::fill_bytes_via_next_word;
use rand::seq::SliceRandom as _;
use rand_distr::{Distribution as _, Uniform};

use super::estimate::student;

/// Number of bootstrap draws (chosen).
const DRAWS: usize = 2000;

/// Seed of the draws (chosen). It is fixed, so that the same records give the same intervals.
const SEED: u64 = 0x6461_726b_7161;

/// Maximum number of units that are drawn (chosen): the standard error then has a relative error of 1 %. With more
/// clusters, a unit is a group of clusters, so that time and memory do not grow further.
const MAX_UNITS: usize = 8192;

/// Minimum number of units for an interval of percentiles alone (chosen). With 5 units they held 92.5 % of true
/// thresholds, with the interval of Student's t 96.6 %.
const MIN_PERCENTILE_UNITS: usize = 8;

/// Draws of all clusters with replacement. Every statistic uses the same draws, so that differences are paired.
///
/// With more than [`MAX_UNITS`] clusters, random groups of clusters are drawn instead. All groups except the last have
/// the same number of clusters. Groups of independent clusters are independent too, and a sum over groups has the
/// variance of the sum over clusters (the method of random groups: Wolter 2007, Introduction to Variance Estimation,
/// chapter 2).
#[derive(Debug)]
pub struct Resamples {
    /// The index of each cluster's unit.
    units: Vec<u16>,
    /// Number of units.
    count: usize,
    /// Number of occurrences of each unit, one draw after the other.
    times: Vec<u8>,
}

/// One draw: the number of occurrences of each cluster.
#[derive(Debug, Clone, Copy)]
pub struct Draw<'d> {
    units: &'d [u16],
    times: &'d [u8],
}

impl Draw<'_> {
    /// Number of occurrences of a cluster.
    pub fn times(self, cluster: u32) -> usize {
        usize::from(self.times[usize::from(self.units[cluster as usize])])
    }
}

impl Resamples {
    /// Bootstrap draws over `clusters` clusters.
    #[must_use]
    pub fn new(clusters: usize) -> Self {
        let mut random = SplitMix(SEED);
        let together = clusters.div_ceil(MAX_UNITS).max(1);
        let count = clusters.div_ceil(together);
        let mut order: Vec<usize> = (0..clusters).collect();
        if together > 1 {
            random.shuffle(&mut order);
        }
        let units = order.into_iter().map(|place| (place / together) as u16).collect();
        let mut times = vec![0_u8; DRAWS * count];
        if let Ok(uniform) = Uniform::new(0, count as u64) {
            for draw in times.chunks_mut(count) {
                for unit in uniform.sample_iter(&mut random).take(count) {
                    let times = &mut draw[unit as usize];
                    *times = times.saturating_add(1);
                }
            }
        }
        Self { units, count, times }
    }

    /// The number of clusters.
    #[must_use]
    pub fn clusters(&self) -> usize {
        self.units.len()
    }

    /// The draws.
    pub fn all(&self) -> impl Iterator<Item = Draw<'_>> {
        self.times.chunks(self.count.max(1)).map(|times| Draw { units: &self.units, times })
    }

    /// The sum over the clusters of each draw; `by_cluster` has one number for each cluster.
    ///
    /// # Panics
    /// If the length of `by_cluster` is not the number of clusters.
    #[must_use]
    pub fn sums(&self, by_cluster: &[f32]) -> Vec<f64> {
        assert_eq!(by_cluster.len(), self.units.len(), "one number for each cluster");
        let mut by_unit = vec![0.0_f32; self.count];
        for (unit, number) in self.units.iter().zip(by_cluster) {
            by_unit[usize::from(*unit)] += number;
        }
        self.times
            .chunks(self.count.max(1))
            .map(|times: &[u8]| -> f64 {
                times.chunks(256).zip(by_unit.chunks(256)).map(|(times, numbers)| sum_of_products(times, numbers)).sum()
            })
            .collect()
    }

    /// The 95 % interval of a statistic from its values in the draws, which may be infinite.
    ///
    /// The ends are percentiles, widened for few clusters by Student's distribution (Hesterberg 2015, Am. Stat. 69:371,
    /// section 5.3, "expanded percentile"). The draws of fewer than [`MIN_PERCENTILE_UNITS`] units have no values far
    /// enough out, so that the interval also covers that of Student's t with the standard deviation of the finite
    /// values.
    #[must_use]
    pub fn interval(&self, mut values: Vec<f64>) -> [f64; 2] {
        if values.is_empty() {
            return [f64::NAN; 2];
        }
        values.sort_by(f64::total_cmp);
        let c = self.count as f64;
        let ends = |tail: f64| {
            let last = (values.len() - 1) as f64;
            [tail, 1.0 - tail].map(|share| values[(share * last).round() as usize])
        };
        if self.count < 2 {
            return ends(0.0);
        }
        let z = student(c - 1.0) * (c / (c - 1.0)).sqrt();
        let [low, high] = ends(0.5 * libm::erfc(z / std::f64::consts::SQRT_2));
        if self.count >= MIN_PERCENTILE_UNITS {
            return [low, high];
        }
        let finite = &values[..values.partition_point(|value| value.is_finite())];
        let n = finite.len() as f64;
        let mean = finite.iter().sum::<f64>() / n;
        let variance = finite.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
        let half = z * variance.sqrt();
        [low.min(mean - half), high.max(mean + half)]
    }
}

/// The sum of the products of occurrences and numbers. Eight partial sums let the compiler use vector instructions. For
/// integers the order does not matter, because sums below 2²⁴ are exact in `f32`.
fn sum_of_products(times: &[u8], numbers: &[f32]) -> f64 {
    let mut lanes = [0.0_f32; 8];
    let (whole, rest) = times.as_chunks::<8>();
    let (whole_numbers, rest_numbers) = numbers.as_chunks::<8>();
    for (times, numbers) in whole.iter().zip(whole_numbers) {
        for lane in 0..8 {
            lanes[lane] += f32::from(times[lane]) * numbers[lane];
        }
    }
    let rest: f32 = rest.iter().zip(rest_numbers).map(|(times, number)| f32::from(*times) * number).sum();
    f64::from(lanes.iter().sum::<f32>() + rest)
}

/// SplitMix64 random generator (Steele, Lea and Flood 2014, OOPSLA, figure 13). The field is the state, at first the
/// seed. Implements [`TryRng`] for the distributions of `rand_distr`.
pub(crate) struct SplitMix(pub(crate) u64);

impl SplitMix {
    /// Returns the next 64 random bits.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Shuffles values; every order is equally likely.
    pub(crate) fn shuffle<T>(&mut self, values: &mut [T]) {
        values.shuffle(self);
    }
}

impl TryRng for SplitMix {
    type Error = Infallible;

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        Ok(self.bits())
    }

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        Ok(self.bits() as u32)
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        fill_bytes_via_next_word(bytes, || self.try_next_u64())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_draw_has_all_its_clusters() {
        let draws = Resamples::new(37);
        let sums = draws.sums(&[1.0; 37]);
        assert_eq!(sums.len(), DRAWS);
        assert!(sums.iter().all(|sum| (sum - 37.0).abs() < 1e-12));
        assert!(Resamples::new(0).sums(&[]).iter().all(|sum| *sum == 0.0));
    }

    #[test]
    fn interval_of_a_mean_matches_student() {
        // The standard error of the mean of 30 numbers is known.
        let numbers: Vec<f32> = (0..30_u8).map(f32::from).collect();
        let draws = Resamples::new(30);
        let means: Vec<f64> = draws.sums(&numbers).iter().map(|sum| sum / 30.0).collect();
        let [low, high] = draws.interval(means);
        let half = student(29.0) * (77.5_f64 / 30.0).sqrt();
        assert!((low - (14.5 - half)).abs() < 0.25, "{low}");
        assert!((high - (14.5 + half)).abs() < 0.25, "{high}");
        // The draws of five numbers end at 0 and 4.
        let numbers: Vec<f32> = (0..5_u8).map(f32::from).collect();
        let draws = Resamples::new(5);
        let means = draws.sums(&numbers).iter().map(|sum| sum / 5.0).collect();
        let [low, high] = draws.interval(means);
        let half = student(4.0) * (2.5_f64 / 5.0).sqrt();
        assert!((low - (2.0 - half)).abs() < 0.1, "{low}");
        assert!((high - (2.0 + half)).abs() < 0.1, "{high}");
        let ends = Resamples::new(1).interval(vec![3.0, f64::INFINITY, 1.0]);
        assert!(ends[0] < 1.5 && ends[1].is_infinite());
    }

    #[test]
    fn grouped_clusters_keep_the_interval() {
        // Numbers that increase with the index: groups of neighbours would differ more than random groups.
        for clusters in [8_193_u16, 20_000, 60_000] {
            let numbers: Vec<f32> = (0..clusters).map(f32::from).collect();
            let n = f64::from(clusters);
            let draws = Resamples::new(usize::from(clusters));
            assert!(draws.count <= MAX_UNITS && draws.count > MAX_UNITS / 2);
            let ones = draws.sums(&vec![1.0; usize::from(clusters)]);
            let means = draws.sums(&numbers).into_iter().zip(ones).map(|(sum, n)| sum / n);
            let [low, high] = draws.interval(means.collect());
            let half = 1.959_964 * (n * n / 12.0 / n).sqrt();
            let ratio = (high - low) / (2.0 * half);
            // The ends of an interval from 2000 draws have a relative error of 5 %.
            assert!((ratio - 1.0).abs() < 0.06, "{clusters}: {ratio}");
        }
    }

    #[test]
    fn a_cluster_occurs_as_often_as_its_group() {
        let draws = Resamples::new(9000);
        let mut numbers = vec![0.0; 9000];
        numbers[77] = 1.0;
        let sums = draws.sums(&numbers);
        let times = draws.all().map(|draw| draw.times(77));
        assert!(sums.iter().zip(times).all(|(sum, times)| (sum - times as f64).abs() < 0.5));
    }

    #[test]
    fn bits_match_the_reference_implementation() {
        // First outputs of the reference implementation (Vigna, splitmix64.c) with seed 1234567.
        let mut random = SplitMix(1_234_567);
        let first = [random.bits(), random.bits()];
        assert_eq!(first, [6_457_827_717_110_365_317, 3_203_168_211_198_807_973]);
    }
}
