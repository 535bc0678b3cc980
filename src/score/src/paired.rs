//! Comparison of two subjects on the same items: [`PairedComparison`].

use super::choice::ReadingMode;
use super::estimate::Estimate;
use super::grid::{Grid, GridItem};
use super::quantiles::{degrees_of_freedom, student};
use super::residuals::{residuals, unknown_design_effect};
use super::significance::{mcnemar, sign_flip};
use darkqa_ground::types::Family;

/// Accuracy of one subject against another on the items to which both replied.
#[derive(Debug, Clone, PartialEq)]
pub struct PairedComparison {
    /// Accuracy of the first subject.
    pub first: f64,
    /// Accuracy of the second subject.
    pub second: f64,
    /// Accuracy of the first minus that of the second. Its `n` is the number of pairs.
    pub difference: Estimate,
    /// Number of items that only the first subject got right.
    pub gained: usize,
    /// Number of items that only the second subject got right.
    pub lost: usize,
    /// Number of clusters that have a pair.
    pub clusters: usize,
    /// McNemar's exact p-value, which treats items as independent.
    pub mcnemar: f64,
    /// Exact p-value of swapping the two subjects in whole clusters.
    pub p: f64,
}

/// Counts of the pairs of a cluster.
#[derive(Debug, Clone, Copy, Default)]
struct ClusterPairs {
    all: i64,
    gained: i64,
    lost: i64,
}

impl ClusterPairs {
    /// The sum of the differences of the pairs, and the number of pairs.
    fn net(&self) -> (f64, f64) {
        ((self.gained - self.lost) as f64, self.all as f64)
    }
}

impl PairedComparison {
    /// Comparison of two subjects, by their indices in the grid; `None` if no item has a reply of both.
    #[must_use]
    pub fn new(
        grid: &Grid<'_>,
        first: usize,
        second: usize,
        family: Option<&Family>,
        mode: ReadingMode,
    ) -> Option<Self> {
        Self::on_items(grid, first, second, mode, |_, item| item.is_of(family))
    }

    /// The same on the items for which `has` is true; it takes the index of an item and the item.
    pub fn on_items(
        grid: &Grid<'_>,
        first: usize,
        second: usize,
        mode: ReadingMode,
        has: impl Fn(usize, &GridItem<'_>) -> bool,
    ) -> Option<Self> {
        let mut clusters = vec![ClusterPairs::default(); grid.clusters];
        let mut right = [0_usize; 2];
        for (index, item) in grid.items.iter().enumerate() {
            if !has(index, item) {
                continue;
            }
            let reading = |subject| grid.result(subject, index).reading(mode);
            let (Some(a), Some(b)) = (reading(first), reading(second)) else {
                continue;
            };
            let (a, b) = (item.is_right(a), item.is_right(b));
            let cluster = &mut clusters[item.cluster as usize];
            cluster.all += 1;
            cluster.gained += i64::from(a && !b);
            cluster.lost += i64::from(b && !a);
            right[0] += usize::from(a);
            right[1] += usize::from(b);
        }
        clusters.retain(|cluster| cluster.all > 0);
        let n = clusters.iter().map(|cluster| cluster.all).sum::<i64>() as usize;
        if n == 0 {
            return None;
        }
        let sum = |of: fn(&ClusterPairs) -> i64| clusters.iter().map(of).sum::<i64>() as usize;
        let (gained, lost) = (sum(|pairs| pairs.gained), sum(|pairs| pairs.lost));
        let differences = clusters.iter().map(|cluster| cluster.gained - cluster.lost);
        let differences: Vec<i64> = differences.collect();
        let nets: Vec<(f64, f64)> = clusters.iter().map(ClusterPairs::net).collect();
        Some(Self {
            first: right[0] as f64 / n as f64,
            second: right[1] as f64 / n as f64,
            difference: difference(&nets, (gained + lost) as f64, n),
            gained,
            lost,
            clusters: clusters.len(),
            mcnemar: mcnemar(gained, lost),
            p: sign_flip(&differences),
        })
    }
}

/// The difference with the interval of Bonett and Price (2012, J. Educ. Behav. Stat. 37:479).
///
/// It adds one pair in each direction, so that few or no discordant pairs do not look like certainty. Here the variance
/// between clusters, which is the sum of their squared [`residuals`], replaces that of independent pairs, and Student's quantile the
/// normal one. Where clusters vary more than independent pairs would, it has the degrees of freedom that their residuals allow
/// ([`degrees_of_freedom`]), else one less than clusters. If all pairs have the same difference, which is mostly none, the variance of
/// the two added pairs is multiplied by [`unknown_design_effect`]: differences that come in few clusters may all have been missed.
///
/// `clusters` holds, for each cluster, the sum of the differences of its pairs (of scores between 0 and 1) and their number;
/// `squares` is the sum of the squared differences of all pairs, and `n` the number of all pairs.
#[must_use]
pub fn difference(clusters: &[(f64, f64)], squares: f64, n: usize) -> Estimate {
    let (all, c) = (n as f64, clusters.len() as f64);
    let sum: f64 = clusters.iter().map(|(net, _)| net).sum();
    let value = sum / all;
    let residuals = residuals(clusters, value);
    // One cluster shows no spread between clusters: its residual is infinite and the interval is the whole range.
    let variance: f64 = residuals.iter().map(|residual| residual * residual).sum();
    let independent = squares - all * value * value;
    let added = if independent > all * ROUNDING {
        2.0
    } else {
        2.0 * unknown_design_effect(clusters)
    };
    let degrees = if variance * (c - 1.0) / c > independent * (1.0 + ROUNDING) {
        degrees_of_freedom(&residuals)
    } else {
        c - 1.0
    };
    let half = student(degrees) * (variance + added).sqrt() / (all + 2.0);
    let center = sum / (all + 2.0);
    Estimate {
        value,
        low: (center - half).clamp(-1.0, value),
        high: (center + half).clamp(value, 1.0),
        n,
    }
}

/// Relative error of sums that are equal but for rounding (chosen).
const ROUNDING: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(clusters: &[(i64, i64, i64)]) -> Estimate {
        let squares: i64 = clusters.iter().map(|(_, gained, lost)| gained + lost).sum();
        let clusters =
            clusters
                .iter()
                .map(|&(all, gained, lost)| ClusterPairs { all, gained, lost });
        let clusters: Vec<(f64, f64)> = clusters.map(|pairs| pairs.net()).collect();
        let n = clusters.iter().map(|(_, pairs)| pairs).sum::<f64>() as usize;
        difference(&clusters, squares as f64, n)
    }

    #[test]
    fn independent_pairs_give_bonett_and_prices_interval() {
        // 100 pairs, 12 gained and 4 lost: (8 ± z √(Σd² − …)) / 102 with the unadjusted variance of d.
        let pairs = [vec![(1, 1, 0); 12], vec![(1, 0, 1); 4], vec![(1, 0, 0); 84]].concat();
        let interval = estimate(&pairs);
        let variance = 100.0 / 99.0 * (16.0 - 100.0 * 0.08 * 0.08) + 2.0;
        let half = student(99.0) * f64::sqrt(variance) / 102.0;
        assert!((interval.value - 0.08).abs() < 1e-12);
        assert!((interval.low - (8.0 / 102.0 - half)).abs() < 1e-12);
        assert!((interval.high - (8.0 / 102.0 + half)).abs() < 1e-12);
    }

    #[test]
    fn few_clusters_with_all_differences_know_their_variance_poorly() {
        // 24 differences in the same direction: spread over 12 clusters of 20, or in two of them.
        let spread = estimate(&[(20, 2, 0); 12]);
        let clumped = estimate(&[vec![(20, 12, 0); 2], vec![(20, 0, 0); 10]].concat());
        let width = |estimate: Estimate| estimate.high - estimate.low;
        assert!((spread.value - clumped.value).abs() < 1e-12);
        // √(12 / 11 · Σr² + 2) / 242 with Σr² = 2 · 10² + 10 · 2²; κ = 12 · (2 · 10⁴ + 10 · 2⁴) / 240² = 4.2.
        let half = student(12.0 / 3.2) * f64::sqrt(12.0 / 11.0 * 240.0 + 2.0) / 242.0;
        assert!((width(clumped) - 2.0 * half).abs() < 1e-9, "{clumped:?}");
        let half = student(11.0) * f64::sqrt(2.0) / 242.0;
        assert!((width(spread) - 2.0 * half).abs() < 1e-9, "{spread:?}");
    }

    #[test]
    fn an_interval_by_clusters_of_unequal_size_is_that_of_another_program() {
        // numpy 2 and scipy 1.17.1, written apart from this program. The first cluster has more than a third of all pairs.
        let interval = estimate(&[
            (30, 6, 1),
            (4, 1, 0),
            (5, 0, 0),
            (6, 2, 0),
            (3, 0, 1),
            (8, 0, 0),
            (5, 1, 1),
            (7, 0, 0),
            (6, 0, 0),
            (4, 0, 0),
        ]);
        assert!(
            (interval.low + 0.061_251_861_397_6).abs() < 1e-9,
            "{interval:?}"
        );
        assert!(
            (interval.high - 0.236_251_861_397_6).abs() < 1e-9,
            "{interval:?}"
        );
    }

    #[test]
    fn no_difference_is_not_certainty() {
        // Neither none at all nor the same one everywhere. The two added pairs count as pairs of clusters of 4: 1 + 0.2 · 3.
        let half = student(19.0) * f64::sqrt(2.0 * 1.6) / 82.0;
        let none = estimate(&[(4, 0, 0); 20]);
        assert!((none.low + half).abs() < 1e-12, "{none:?}");
        assert!((none.high - half).abs() < 1e-12, "{none:?}");
        let all = estimate(&[(4, 4, 0); 20]);
        assert!((all.low - (80.0 / 82.0 - half)).abs() < 1e-12, "{all:?}");
        // One pair a cluster: Bonett and Price's own.
        let single = estimate(&[(1, 0, 0); 80]);
        let half = student(79.0) * f64::sqrt(2.0) / 82.0;
        assert!((single.high - half).abs() < 1e-12, "{single:?}");
        let single = estimate(&[(4, 1, 0)]);
        assert_eq!((single.low, single.high), (-1.0, 1.0));
    }
}
