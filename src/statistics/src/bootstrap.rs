//! The cluster bootstrap: [`Resamples`].

use rand_distr::{Distribution as _, Uniform};

use super::quantiles::student;
use super::split_mix::SplitMix;

/// Number of bootstrap draws (chosen).
const DRAWS: usize = 2000;
/// Seed of the draws (chosen). It is fixed, so that the same records give the same intervals.
const SEED: u64 = 0x6461_726b_7161;
/// The most units that are drawn (chosen): a standard error is then exact to 1 % for itself. With more clusters, several of them are
/// one unit, so that time and memory do not grow with the clusters.
const MOST_UNITS: usize = 8192;

/// Draws of all clusters with replacement. Every statistic uses the same draws, so that differences are paired.
///
/// With more than [`MOST_UNITS`] clusters, random groups of them are drawn in their place, each of the same number of clusters but the
/// last. As the clusters are independent, so are the groups, and the variance of a sum over groups is that of the sum over clusters
/// (the method of random groups: Wolter 2007, Introduction to Variance Estimation, chapter 2).
#[derive(Debug)]
pub struct Resamples {
    /// The unit of each cluster that is drawn with it.
    units: Vec<u16>,
    /// Number of units.
    count: usize,
    /// Number of times that each unit occurs in each draw, draw by draw.
    times: Vec<u8>,
}

/// One draw: how many times each cluster occurs in it.
#[derive(Debug, Clone, Copy)]
pub struct Draw<'d> {
    units: &'d [u16],
    times: &'d [u8],
}

impl Draw<'_> {
    /// How many times a cluster occurs.
    pub fn times(self, cluster: u32) -> usize {
        usize::from(self.times[usize::from(self.units[cluster as usize])])
    }
}

impl Resamples {
    /// Bootstrap draws over `clusters` clusters.
    #[must_use]
    pub fn new(clusters: usize) -> Self {
        let mut random = SplitMix(SEED);
        let together = clusters.div_ceil(MOST_UNITS).max(1);
        let count = clusters.div_ceil(together);
        let mut order: Vec<usize> = (0..clusters).collect();
        if together > 1 {
            random.shuffle(&mut order);
        }
        let units = order
            .into_iter()
            .map(|place| (place / together) as u16)
            .collect();
        let mut times = vec![0_u8; DRAWS * count];
        if let Ok(uniform) = Uniform::new(0, count as u64) {
            for draw in times.chunks_mut(count) {
                for unit in uniform.sample_iter(&mut random).take(count) {
                    let times = &mut draw[unit as usize];
                    *times = times.saturating_add(1);
                }
            }
        }
        Self {
            units,
            count,
            times,
        }
    }

    /// The number of clusters.
    #[must_use]
    pub fn clusters(&self) -> usize {
        self.units.len()
    }

    /// The draws.
    pub fn all(&self) -> impl Iterator<Item = Draw<'_>> {
        self.times.chunks(self.count.max(1)).map(|times| Draw {
            units: &self.units,
            times,
        })
    }

    /// Sum over the clusters of each draw; `by_cluster` holds one number for each cluster.
    ///
    /// # Panics
    /// If the length of `by_cluster` is not the number of clusters.
    #[must_use]
    pub fn sums(&self, by_cluster: &[f32]) -> Vec<f64> {
        assert_eq!(
            by_cluster.len(),
            self.units.len(),
            "one number for each cluster"
        );
        let mut by_unit = vec![0.0_f32; self.count];
        for (unit, number) in self.units.iter().zip(by_cluster) {
            by_unit[usize::from(*unit)] += number;
        }
        self.times
            .chunks(self.count.max(1))
            .map(|times: &[u8]| -> f64 {
                times
                    .chunks(256)
                    .zip(by_unit.chunks(256))
                    .map(|(times, numbers)| sum_of_products(times, numbers))
                    .sum()
            })
            .collect()
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
        let c = self.count as f64;
        let tail = if self.count < 2 {
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

/// The sum of each number as often as it occurs. Whole numbers are added without error as long as the sum stays below 2²⁴, whatever
/// their order; so eight sums side by side, which a processor adds at once, change nothing.
fn sum_of_products(times: &[u8], numbers: &[f32]) -> f64 {
    let mut lanes = [0.0_f32; 8];
    let product = |n: u8, x: f32| f32::from(n) * x;
    let (whole, rest) = times.as_chunks::<8>();
    let (whole_numbers, rest_numbers) = numbers.as_chunks::<8>();
    for (times, numbers) in whole.iter().zip(whole_numbers) {
        for lane in 0..8 {
            lanes[lane] += product(times[lane], numbers[lane]);
        }
    }
    let rest = rest.iter().zip(rest_numbers).map(|(n, x)| product(*n, *x));
    f64::from(lanes.iter().sum::<f32>() + rest.sum::<f32>())
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

    #[test]
    fn groups_of_clusters_give_the_interval_of_the_clusters() {
        // Numbers that rise with the place of a cluster: groups of neighbours would be less alike than random ones.
        for clusters in [8_193_u16, 20_000, 60_000] {
            let numbers: Vec<f32> = (0..clusters).map(f32::from).collect();
            let n = f64::from(clusters);
            let draws = Resamples::new(usize::from(clusters));
            assert!(draws.count <= MOST_UNITS && draws.count > MOST_UNITS / 2);
            let ones = draws.sums(&vec![1.0; usize::from(clusters)]);
            let means = draws
                .sums(&numbers)
                .into_iter()
                .zip(ones)
                .map(|(sum, n)| sum / n);
            let [low, high] = draws.interval(means.collect());
            let half = 1.959_964 * (n * n / 12.0 / n).sqrt();
            let ratio = (high - low) / (2.0 * half);
            // The ends of 2000 draws are known to 5 %.
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
        assert!(
            sums.iter()
                .zip(times)
                .all(|(sum, times)| (sum - times as f64).abs() < 0.5)
        );
    }
}
