//! The cluster bootstrap: [`Resamples`].

use rand_distr::{Distribution as _, Uniform};

use super::quantiles::student;
use super::split_mix::SplitMix;

/// Number of bootstrap draws (chosen).
const DRAWS: usize = 2000;
/// Seed of the draws (chosen). It is fixed, so that the same records give the same intervals.
const SEED: u64 = 0x6461_726b_7161;

/// Draws of all clusters with replacement. Every statistic uses the same draws, so that differences are paired.
#[derive(Debug)]
pub struct Resamples {
    clusters: usize,
    /// Number of times that each cluster occurs in each draw, draw by draw.
    times: Vec<u8>,
}

impl Resamples {
    /// Bootstrap draws over `clusters` clusters.
    #[must_use]
    pub fn new(clusters: usize) -> Self {
        let mut times = vec![0_u8; DRAWS * clusters];
        if let Ok(uniform) = Uniform::new(0, clusters as u64) {
            let mut random = SplitMix(SEED);
            for draw in times.chunks_mut(clusters) {
                for cluster in uniform.sample_iter(&mut random).take(clusters) {
                    let times = &mut draw[cluster as usize];
                    *times = times.saturating_add(1);
                }
            }
        }
        Self { clusters, times }
    }

    /// The number of clusters.
    #[must_use]
    pub fn clusters(&self) -> usize {
        self.clusters
    }

    /// How many times each cluster occurs, draw by draw.
    pub(super) fn all(&self) -> impl Iterator<Item = &[u8]> {
        self.times.chunks(self.clusters.max(1))
    }

    /// Sum over the clusters of each draw; `by_cluster` holds one number for each cluster.
    ///
    /// # Panics
    /// If the length of `by_cluster` is not the number of clusters.
    #[must_use]
    pub fn sums(&self, by_cluster: &[f32]) -> Vec<f64> {
        assert_eq!(
            by_cluster.len(),
            self.clusters,
            "one number for each cluster"
        );
        let draws = self.times.chunks(self.clusters.max(1));
        let sum = |times: &[u8]| -> f64 {
            // Sums of counts are whole and small: exact in single precision up to 2²⁴.
            let partial = |(times, numbers): (&[u8], &[f32])| -> f64 {
                let products = times.iter().zip(numbers).map(|(n, x)| f32::from(*n) * x);
                f64::from(products.sum::<f32>())
            };
            times
                .chunks(256)
                .zip(by_cluster.chunks(256))
                .map(partial)
                .sum()
        };
        draws.map(sum).collect()
    }

    /// The 95 % interval of a statistic from its values in the draws, which may be infinite.
    ///
    /// The ends are percentiles, widened for few clusters by Student's distribution (Hesterberg 2015, Am. Stat. 69:371,
    /// section 5.3, "expanded percentile").
    #[must_use]
    pub fn interval(&self, mut values: Vec<f64>) -> [f64; 2] {
        if values.is_empty() {
            return [f64::NAN; 2];
        }
        values.sort_by(f64::total_cmp);
        let c = self.clusters as f64;
        let tail = if self.clusters < 2 {
            0.0
        } else {
            let z = student(c - 1.0) * (c / (c - 1.0)).sqrt();
            0.5 * libm::erfc(z / std::f64::consts::SQRT_2)
        };
        let last = values.len() - 1;
        let at = |share: f64| values[(share * last as f64).round() as usize];
        [at(tail), at(1.0 - tail)]
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
    fn the_interval_of_a_mean_is_students() {
        // The standard error of the mean of 30 numbers is known.
        let numbers: Vec<f32> = (0..30_u8).map(f32::from).collect();
        let draws = Resamples::new(30);
        let means: Vec<f64> = draws.sums(&numbers).iter().map(|sum| sum / 30.0).collect();
        let [low, high] = draws.interval(means);
        let half = student(29.0) * (77.5_f64 / 30.0).sqrt();
        assert!((low - (14.5 - half)).abs() < 0.25, "{low}");
        assert!((high - (14.5 + half)).abs() < 0.25, "{high}");
        let ends = Resamples::new(1).interval(vec![3.0, f64::INFINITY, 1.0]);
        assert!(ends[0] < 1.5 && ends[1].is_infinite());
    }
}
