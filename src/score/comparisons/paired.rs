//! Comparison of two subjects on the same items: [`PairedComparison`].

use super::tested::Tested;
use crate::choice::ParsingMode;
use crate::estimate::Estimate;
use crate::grid::{Grid, GridItem};
use crate::significance::{ALPHA, PValues, least_p, mcnemar, swap_test};
use crate::statistics::estimate::{
    degrees_of_freedom, quantile, residuals, two_sided_tail, unknown_design_effect, variance_of_few,
};
use darkqa_base::types::Family;

/// Comparison of two subjects on the items to which both replied.
#[derive(Debug, Clone, PartialEq)]
pub struct PairedComparison {
    /// Accuracy of the first subject.
    pub first: f64,
    /// Accuracy of the second subject.
    pub second: f64,
    /// Accuracy of the first minus that of the second, with its tests ([`PairedTest`]). Its `n` is the number of pairs.
    pub tested: Tested,
    /// Number of items that only the first subject got right.
    pub gained: usize,
    /// Number of items that only the second subject got right.
    pub lost: usize,
    /// Number of clusters with a pair.
    pub clusters: usize,
    /// McNemar's exact p-value, which treats items as independent.
    pub mcnemar: f64,
    /// Number of items that both subjects were asked, and of which one has no reply.
    pub missing: usize,
    /// Standard error of the difference, and its degrees of freedom.
    pub spread: Spread,
}

impl PairedComparison {
    /// Compares two subjects, given by their indices in the grid; `None` if no item has a reply of both.
    #[must_use]
    pub fn new(
        grid: &Grid<'_>,
        first: usize,
        second: usize,
        family: Option<&Family>,
        mode: ParsingMode,
    ) -> Option<Self> {
        Self::on_items(grid, first, second, mode, |_, item| item.is_in_family(family))
    }

    /// p-values before correction.
    pub(super) fn p_values(&self) -> PValues {
        self.tested.p_values(least_p(self.clusters))
    }

    /// Compares two subjects on the items for which `has` is true; it takes the index of an item and the item.
    pub fn on_items(
        grid: &Grid<'_>,
        first: usize,
        second: usize,
        mode: ParsingMode,
        has: impl Fn(usize, &GridItem<'_>) -> bool,
    ) -> Option<Self> {
        Self::counting(grid, [first, second], mode, has, |item: &GridItem<'_>, chosen| item.is_right(chosen))
    }

    /// Compares two subjects by the replies for which `counts` is true, instead of right replies; it takes an item and
    /// a parsed reply.
    pub(crate) fn counting(
        grid: &Grid<'_>,
        [first, second]: [usize; 2],
        mode: ParsingMode,
        has: impl Fn(usize, &GridItem<'_>) -> bool,
        counts: impl Fn(&GridItem<'_>, Option<u8>) -> bool,
    ) -> Option<Self> {
        let mut sums = BoundedSums::new(grid.clusters);
        let (mut counted, mut n) = ([0_usize; 2], 0);
        let (mut gained, mut lost) = (0, 0);
        for (index, item) in grid.items.iter().enumerate() {
            if !has(index, item) {
                continue;
            }
            let results = grid.results([first, second], index);
            let counts = results.map(|result| {
                let chosen = result.parsed(mode)?;
                Some(counts(item, chosen))
            });
            match counts {
                [Some(a), Some(b)] => {
                    n += 1;
                    gained += usize::from(a && !b);
                    lost += usize::from(b && !a);
                    counted[0] += usize::from(a);
                    counted[1] += usize::from(b);
                    sums.add(item.cluster, i64::from(a) - i64::from(b));
                }
                [None, None] => {}
                _ if results.iter().all(|result| result.is_asked()) => {
                    let [lowest, highest] = net_bounds([counts].into_iter());
                    sums.add_missing(item.cluster, lowest, highest);
                }
                _ => {}
            }
        }
        let tested = sums.test(1.0)?;
        Some(Self {
            first: counted[0] as f64 / n as f64,
            second: counted[1] as f64 / n as f64,
            tested: tested.tested,
            gained,
            lost,
            clusters: sums.clusters(),
            mcnemar: mcnemar(gained, lost),
            missing: sums.missing.len(),
            spread: tested.spread,
        })
    }
}

/// Smallest and largest sum of net differences over pairs of replies: a missing reply may have counted or not. A pair
/// without any reply counts as equal.
pub(super) fn net_bounds(pairs: impl Iterator<Item = [Option<bool>; 2]>) -> [i64; 2] {
    let value = |counts: Option<bool>, if_missing: bool| i64::from(counts.unwrap_or(if_missing));
    pairs.filter(|sides| sides.iter().any(Option::is_some)).fold([0, 0], |[lowest, highest], [first, second]| {
        [lowest + value(first, false) - value(second, true), highest + value(first, true) - value(second, false)]
    })
}

/// Difference and p-value that hold for all values of the missing replies, from those of the replies and those of the
/// two bounds, the lowest difference first. The interval covers all three. p is the largest of the three, or 1 if the
/// bounds differ in sign.
pub(super) fn bounded((difference, p): (Estimate, f64), bounds: [(Estimate, f64); 2]) -> (Estimate, f64) {
    let [lowest, highest] = bounds;
    let has_one_sign = highest.0.value < 0.0 || lowest.0.value > 0.0;
    let p = if has_one_sign { p.max(lowest.1).max(highest.1) } else { 1.0 };
    (difference.covering([lowest.0, highest.0]), p)
}

/// Differences of the items of a comparison, summed by cluster. Items with missing replies have bounds in place of a
/// difference.
///
/// A reply may be missing because of the condition: a model that refuses what it cannot see would otherwise seem to see
/// it. Nothing is assumed about the missing replies: the bounds are those of Manski 1990 (Am. Econ. Rev. 80:319), here
/// for a difference whose two sides may lack replies. Items without a reply on either side are left out, because
/// nothing tells the conditions apart there.
#[derive(Debug, Clone)]
pub(crate) struct BoundedSums {
    /// Sums over the items with all replies, by cluster.
    replied: NetSums,
    /// Cluster, smallest and largest difference of each item with a missing reply.
    missing: Vec<(u32, [i64; 2])>,
}

impl BoundedSums {
    /// Creates the sums of no item in `clusters` clusters.
    pub(crate) fn new(clusters: usize) -> Self {
        Self { replied: NetSums::new(clusters), missing: Vec::new() }
    }

    /// Adds an item of a cluster with its difference.
    pub(crate) fn add(&mut self, cluster: u32, net: i64) {
        self.replied.add(cluster, net);
    }

    /// Adds an item of a cluster with the smallest and the largest difference that its missing replies allow.
    pub(super) fn add_missing(&mut self, cluster: u32, lowest: i64, highest: i64) {
        self.missing.push((cluster, [lowest, highest]));
    }

    /// Number of clusters with an item that has all replies.
    pub(super) fn clusters(&self) -> usize {
        let clusters = self.replied.clusters.iter();
        clusters.filter(|cluster| cluster.items > 0).count()
    }

    /// Tests the mean difference; `scale` is the number of pairs summed in the difference of an item. `None` if no item
    /// has all replies.
    pub(crate) fn test(&self, scale: f64) -> Option<PairedTest> {
        let replied = self.replied.test(scale)?;
        if self.missing.is_empty() {
            return Some(replied);
        }
        let [lowest, highest] = [0, 1].map(|side| {
            let mut sums = self.replied.clone();
            for (cluster, bounds) in &self.missing {
                sums.add(*cluster, bounds[side]);
            }
            sums.test(scale)
        });
        Some(replied.bounded([lowest?, highest?]))
    }
}

/// Net differences by cluster, with the sum of the squared differences of all items.
#[derive(Debug, Clone)]
struct NetSums {
    clusters: Vec<ClusterNet>,
    squares: i64,
}

impl NetSums {
    fn new(clusters: usize) -> Self {
        Self { clusters: vec![ClusterNet { net: 0, items: 0 }; clusters], squares: 0 }
    }

    fn add(&mut self, cluster: u32, net: i64) {
        let sum = &mut self.clusters[cluster as usize];
        sum.net += net;
        sum.items += 1;
        self.squares += net * net;
    }

    /// Tests the mean difference; `None` without items.
    fn test(&self, scale: f64) -> Option<PairedTest> {
        let clusters: Vec<ClusterNet> = self.clusters.iter().copied().filter(|cluster| cluster.items > 0).collect();
        (!clusters.is_empty()).then(|| PairedTest::new(&clusters, scale, self.squares as f64))
    }
}

/// Summed difference of the items of a cluster.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ClusterNet {
    /// Sum of the differences of the items, each an integer.
    pub(crate) net: i64,
    /// Number of items.
    pub(crate) items: u32,
}

/// Paired difference with its interval and its test, which agree: p is below 0.05 if and only if the interval excludes
/// 0.
///
/// p is the larger of two p-values of no difference: that of Student's t, from which the interval of [`difference`] is
/// computed, and the exact one of swapping the two sides in whole clusters ([`swap_test`]). The test is therefore valid
/// for any number of clusters. The interval contains all differences that the test does not reject: if only the swap
/// test does not reject 0, it is extended to 0.
///
/// With missing replies ([`BoundedSums`]), interval and p hold for all values of them ([`bounded`]): a difference is
/// detected only if none of these values undoes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PairedTest {
    /// The difference, not corrected yet. `p_if_answered` is the smallest p-value of the two bounds: if it is small and
    /// `p` is not, the missing replies decide.
    pub(crate) tested: Tested,
    pub(super) spread: Spread,
}

impl PairedTest {
    /// Tests clusters with at least one item each. `scale` is the number of pairs summed in the difference of an item;
    /// `squares` is the sum of the squared differences of all items.
    pub(crate) fn new(clusters: &[ClusterNet], scale: f64, squares: f64) -> Self {
        let n = clusters.iter().map(|cluster| cluster.items as usize).sum();
        let sums: Vec<(f64, f64)> =
            clusters.iter().map(|cluster| (cluster.net as f64 / scale, f64::from(cluster.items))).collect();
        let (estimate, spread) = paired_spread(&sums, squares / scale / scale, n);
        let nets: Vec<i64> = clusters.iter().map(|cluster| cluster.net).collect();
        let swapped = swap_test(&nets);
        let p = spread.p(estimate.value * n as f64 / (n as f64 + ADDED)).max(swapped.p);
        let difference = if p < ALPHA { estimate } else { extended_to_zero(estimate) };
        Self { tested: Tested { p_by: Some(swapped.by), ..Tested::new(difference, p) }, spread }
    }

    /// The test with the bounds of its missing replies, the lowest difference first.
    fn bounded(self, [lowest, highest]: [Self; 2]) -> Self {
        let [replied, lowest, highest] = [self, lowest, highest].map(|test| (test.tested.difference, test.tested.p));
        let (difference, p) = bounded(replied, [lowest, highest]);
        let p_if_answered = replied.1.min(lowest.1).min(highest.1);
        let tested = Tested { p_if_answered, p_by: self.tested.p_by, ..Tested::new(difference, p) };
        Self { tested, ..self }
    }
}

/// Returns the estimate with its interval extended to 0.
fn extended_to_zero(estimate: Estimate) -> Estimate {
    Estimate { low: estimate.low.min(0.0), high: estimate.high.max(0.0), ..estimate }
}

/// Number of pairs that Bonett and Price add to the sample.
pub(crate) const ADDED: f64 = 2.0;

/// Standard error of a difference, and the degrees of freedom of Student's t.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Standard error; infinite with one cluster.
    pub error: f64,
    /// Degrees of freedom; not necessarily an integer.
    pub degrees: f64,
}

impl Spread {
    /// Two-sided p-value of no difference, for an interval with this center.
    pub(super) fn p(&self, center: f64) -> f64 {
        if self.error.is_finite() { two_sided_tail(center.abs() / self.error, self.degrees) } else { 1.0 }
    }

    /// Smallest difference that a two-sided test at `level` detects in 80 % of samples of this spread: the error times
    /// the sum of the two quantiles (Bloom 1995, Eval. Rev. 19:547).
    #[must_use]
    pub fn detectable(&self, level: f64) -> f64 {
        let [test, power] = [1.0 - level / 2.0, POWER].map(|share| quantile(share, self.degrees));
        self.error * (test + power)
    }
}

/// Power: share of samples in which a detectable difference is detected (chosen, the usual value).
pub const POWER: f64 = 0.8;

/// Estimates a difference with the interval of Bonett and Price (2012, J. Educ. Behav. Stat. 37:479).
///
/// One pair is added in each direction, so that few or no discordant pairs do not look like certainty. Here the
/// variance between clusters, which is the sum of their squared [`residuals`] ([`variance_of_few`] for few clusters),
/// replaces that of independent pairs, and Student's quantile replaces the normal one. If clusters vary more than
/// independent pairs would, the degrees of freedom follow from the residuals ([`degrees_of_freedom`]), otherwise the
/// number of clusters minus 1. If all pairs have the same difference, usually 0, the variance of the two added pairs is
/// multiplied by [`unknown_design_effect`], because differences that are concentrated in few clusters may all have been
/// missed.
///
/// `clusters` lists, for each cluster, the sum of the differences of its pairs (of scores between 0 and 1) and their
/// number; `squares` is the sum of the squared differences of all pairs, and `n` the number of all pairs.
#[must_use]
pub fn difference(clusters: &[(f64, f64)], squares: f64, n: usize) -> Estimate {
    paired_spread(clusters, squares, n).0
}

/// Estimates a difference like [`difference`], with its p-value by Student's t: below 0.05 if and only if the interval
/// excludes 0.
#[must_use]
pub(crate) fn tested_difference(clusters: &[(f64, f64)], squares: f64, n: usize) -> (Estimate, f64) {
    let (estimate, spread) = paired_spread(clusters, squares, n);
    let p = spread.p(estimate.value * n as f64 / (n as f64 + ADDED));
    (estimate, p)
}

/// Estimates a difference like [`difference`], with its standard error. The center of the interval is the value times
/// n / (n + [`ADDED`]).
pub(crate) fn paired_spread(clusters: &[(f64, f64)], squares: f64, n: usize) -> (Estimate, Spread) {
    let (all, c) = (n as f64, clusters.len() as f64);
    let sum: f64 = clusters.iter().map(|(net, _)| net).sum();
    let value = sum / all;
    let residuals = residuals(clusters, value);
    // A single cluster has an infinite residual, so that the interval is the whole range.
    let between: f64 = residuals.iter().map(|residual| residual * residual).sum();
    let independent = squares - all * value * value;
    let variance = variance_of_few(clusters, between, independent, 1.0);
    let added = if independent > all * ROUNDING { ADDED } else { ADDED * unknown_design_effect(clusters) };
    let degrees = if variance * (c - 1.0) / c > independent * (1.0 + ROUNDING) {
        degrees_of_freedom(&residuals)
    } else {
        c - 1.0
    };
    let spread = Spread { error: (variance + added).sqrt() / (all + ADDED), degrees };
    let half = quantile(1.0 - ALPHA / 2.0, degrees) * spread.error;
    let center = sum / (all + ADDED);
    let estimate =
        Estimate { value, low: (center - half).clamp(-1.0, value), high: (center + half).clamp(value, 1.0), n };
    (estimate, spread)
}

/// Maximum relative rounding error of equal sums (chosen).
const ROUNDING: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::estimate::student;

    /// A small generator of whole numbers, for designs of many shapes.
    fn designs() -> impl Iterator<Item = Vec<ClusterNet>> {
        let mut state = 1_u64;
        let mut draw = move |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) % below
        };
        (0..4000).map(move |_| {
            let (clusters, items, shift) = (2 + draw(30), 1 + draw(8), draw(3));
            (0..clusters)
                .map(|_| ClusterNet {
                    net: (draw(2 * items + 1) + shift).min(2 * items) as i64 - items as i64,
                    items: items as u32,
                })
                .collect()
        })
    }

    #[test]
    fn interval_and_test_agree() {
        let (mut detected, mut extended) = (0, 0);
        for clusters in designs() {
            let squares = clusters.iter().map(|cluster| cluster.net.abs()).sum::<i64>() as f64;
            let tested = PairedTest::new(&clusters, 1.0, squares).tested;
            let Estimate { value, low, high, n } = tested.difference;
            assert_eq!(tested.p < 0.05, low > 0.0 || high < 0.0, "{clusters:?}");
            assert!(low <= value && value <= high && n > 0);
            let nets: Vec<i64> = clusters.iter().map(|cluster| cluster.net).collect();
            assert!(tested.p >= swap_test(&nets).p, "{clusters:?}");
            detected += usize::from(tested.p < 0.05);
            let sums: Vec<(f64, f64)> =
                clusters.iter().map(|cluster| (cluster.net as f64, f64::from(cluster.items))).collect();
            let plain = difference(&sums, squares, n);
            extended += usize::from(plain != tested.difference);
        }
        assert!(detected > 500 && extended > 10, "{detected} {extended}");
    }

    #[test]
    fn detectable_difference_matches_scipy() {
        // 1.962339 + 0.841998 standard errors (scipy 1.17.1, t.ppf).
        let spread = Spread { error: 0.01, degrees: 1000.0 };
        assert!((spread.detectable(0.05) - 0.028_043_4).abs() < 1e-6);
        assert!(spread.detectable(0.05 / 20.0) > 0.038);
    }

    fn estimate(clusters: &[(i64, i64, i64)]) -> Estimate {
        let squares: i64 = clusters.iter().map(|(_, gained, lost)| gained + lost).sum();
        let clusters: Vec<(f64, f64)> =
            clusters.iter().map(|&(all, gained, lost)| ((gained - lost) as f64, all as f64)).collect();
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
        assert!((spread.value - clumped.value).abs() < 1e-12);
        // √(12 / 11 · Σr² + 2) / 242 with Σr² = 2 · 10² + 10 · 2²; κ = 12 · (2 · 10⁴ + 10 · 2⁴) / 240² = 4.2.
        let half = student(12.0 / 3.2) * f64::sqrt(12.0 / 11.0 * 240.0 + 2.0) / 242.0;
        assert!((clumped.high - clumped.low - 2.0 * half).abs() < 1e-9, "{clumped:?}");
        // Equal clusters show no variance. The assumed one, 21.6 · (1 + 0.2 · 19), counts for 2 · (1 − 12 / 30) = 1.2
        // of 12.2 clusters.
        let half = student(11.0) * f64::sqrt(1.2 * 21.6 * 4.8 / 12.2 + 2.0) / 242.0;
        assert!((spread.high - spread.low - 2.0 * half).abs() < 1e-9, "{spread:?}");
    }

    #[test]
    fn an_interval_by_clusters_of_unequal_size_is_that_of_another_program() {
        // numpy 2 and scipy 1.17.1, written apart from this program. The first cluster has more than a third of all
        // pairs.
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
        assert!((interval.low + 0.081_789_089_647_3).abs() < 1e-9, "{interval:?}");
        assert!((interval.high - 0.256_789_089_647_3).abs() < 1e-9, "{interval:?}");
    }

    #[test]
    fn an_interval_of_six_clusters_matches_a_reference() {
        // Independent implementation with numpy 2 and scipy 1.17.1.
        let interval = estimate(&[(20, 2, 1), (20, 3, 0), (20, 0, 1), (20, 4, 1), (20, 1, 0), (20, 2, 2)]);
        assert!((interval.low + 0.063_613_940_783_4).abs() < 1e-9, "{interval:?}");
        assert!((interval.high - 0.178_368_039_144).abs() < 1e-9, "{interval:?}");
    }

    #[test]
    fn no_difference_is_not_certainty() {
        // Neither none at all nor the same one everywhere. The two added pairs count as pairs of clusters of 4: 1 + 0.2
        // · 3.
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
