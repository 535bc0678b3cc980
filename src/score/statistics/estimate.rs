//! A share with its 95 % interval: [`Estimate`].
//!
//! Quantiles and tails of distributions: [`student`] with its [`degrees_of_freedom`], [`two_sided_tail`], and
//! [`least_share`].
//!
//! Residuals of clusters about the overall mean, and what is assumed where few clusters show little: [`residuals`],
//! [`unknown_design_effect`], [`variance_of_few`].

use serde::{Deserialize, Serialize};
use statrs::distribution::{Beta, ContinuousCDF as _, StudentsT};

/// Counts of the replies in a cluster.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ClusterCount {
    /// Number of right replies.
    pub right: u32,
    /// Number of replies, right or wrong.
    pub replies: u32,
}

/// The counts with the missing replies of each cluster filled in, all of them right or all wrong. `missing` may be
/// empty.
#[must_use]
pub fn fill_missing(counts: &[ClusterCount], missing: &[u32], are_right: bool) -> Vec<ClusterCount> {
    let missing = missing.iter().copied().chain(std::iter::repeat(0));
    counts
        .iter()
        .zip(missing)
        .map(|(count, missing)| ClusterCount {
            right: count.right + if are_right { missing } else { 0 },
            replies: count.replies + missing,
        })
        .collect()
}

/// The 97.5 % quantile of the standard normal distribution, for 95 % intervals.
const Z: f64 = 1.959_963_984_540_054;

/// A share, or a difference of shares, with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The share or difference itself.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
    /// Number of trials that it is computed from.
    pub n: usize,
}

/// The item whose estimate is furthest from 0 in either direction, and the first of equal ones; `None` without items.
#[must_use]
pub fn largest<'i, T>(items: &[&'i T], estimate: impl Fn(&T) -> Estimate) -> Option<&'i T> {
    items
        .iter()
        .copied()
        .reduce(|largest, next| if estimate(next).value.abs() > estimate(largest).value.abs() { next } else { largest })
}

impl Estimate {
    /// The share of `right` among `n` independent trials, with Wilson's score interval (Wilson 1927, J. Am. Stat.
    /// Assoc. 22:209). `None` without trials.
    #[must_use]
    pub fn share(right: usize, n: usize) -> Option<Self> {
        if n == 0 || right > n {
            return None;
        }
        let value = right as f64 / n as f64;
        Some(Self::wilson(value, n as f64, Z, n))
    }

    /// The share of right replies in clusters; `None` without replies.
    ///
    /// The interval is Wilson's at the effective number of replies n / d. The design effect d ≥ 1 is the variance of
    /// the share between clusters, which is the sum of their squared [`residuals`] ([`variance_of_few`] for few
    /// clusters), over that of independent replies. Student's quantile replaces the normal one. Dean and Pagano 2015
    /// (J. Surv. Stat. Methodol. 3:484) find this interval the best of seven for clustered shares. With one reply per
    /// cluster it is Wilson's own. If all replies are right, or none, d is [`unknown_design_effect`].
    ///
    /// The degrees of freedom follow from the clusters' residuals ([`degrees_of_freedom`]). The shares of wholly right
    /// and wholly wrong clusters bound the interval ([`Self::bounded_by_whole_clusters`]).
    #[must_use]
    pub fn clustered(counts: &[ClusterCount]) -> Option<Self> {
        let answered = counts.iter().filter(|count| count.replies > 0);
        let n: usize = answered.clone().map(|count| count.replies as usize).sum();
        if answered.clone().all(|count| count.replies == 1) || answered.clone().count() == 1 {
            return Self::share(answered.map(|count| count.right as usize).sum(), n);
        }
        let sums: Vec<(f64, f64)> = answered.map(|count| (f64::from(count.right), f64::from(count.replies))).collect();
        Self::from_scores(&sums, 1.0, n)
    }

    /// The share of right replies, with an interval that holds whatever the missing replies of each cluster would have
    /// been: it covers the interval of the share with all of them wrong, and the one with all of them right. `None`
    /// without replies.
    #[must_use]
    pub fn with_missing(counts: &[ClusterCount], missing: &[u32]) -> Option<Self> {
        let estimate = Self::clustered(counts)?;
        if missing.iter().all(|missing| *missing == 0) {
            return Some(estimate);
        }
        let bounds = [false, true].map(|are_right| Self::clustered(&fill_missing(counts, missing, are_right)));
        Some(estimate.covering(bounds.into_iter().flatten()))
    }

    /// The mean of scores between 0 and 1 in clusters, with the interval of [`Self::clustered`].
    ///
    /// `sums` has, for each cluster, the sum and the number of its scores. A score may count as up to `max_weight`
    /// independent replies, if it is the mean of several replies. `n` becomes the estimate's number of trials.
    #[must_use]
    pub fn from_scores(sums: &[(f64, f64)], max_weight: f64, n: usize) -> Option<Self> {
        let all: f64 = sums.iter().map(|(_, n)| n).sum();
        if all <= 0.0 {
            return None;
        }
        let value = (sums.iter().map(|(sum, _)| sum).sum::<f64>() / all).clamp(0.0, 1.0);
        let residuals = residuals(sums, value);
        let binomial_variance = value * (1.0 - value) / all;
        let has_spread = binomial_variance > 1e-12 && residuals.len() > 1;
        let design_effect = if has_spread {
            let between: f64 = residuals.iter().map(|residual| residual * residual).sum();
            let independent = binomial_variance * all * all;
            variance_of_few(sums, between, independent, max_weight) / independent
        } else {
            unknown_design_effect(sums)
        };
        let effective = all / design_effect.max(1.0 / max_weight);
        // At the minimum design effect the variance is not an estimate, so the normal quantile is used.
        let min_effect = if has_spread { 1.0 / max_weight } else { 1.0 };
        let quantile =
            if residuals.len() > 1 && design_effect > min_effect { student(degrees_of_freedom(&residuals)) } else { Z };
        let estimate = Self::wilson(value, effective, quantile, n);
        Some(if has_spread { estimate.bounded_by_whole_clusters(sums) } else { estimate })
    }

    /// Narrows the interval by two bounds: the share of right replies is at least the share of wholly right clusters,
    /// and at most one minus the share of wholly wrong clusters. The bounds use the lower ends of the exact intervals
    /// of these shares.
    ///
    /// The bounds are invalid if clusters differ much in size, so they are not applied if the largest cluster has three
    /// times the mean size or more.
    fn bounded_by_whole_clusters(self, sums: &[(f64, f64)]) -> Self {
        const ROUNDING: f64 = 1e-9;
        let all: f64 = sums.iter().map(|(_, n)| n).sum();
        let largest = sums.iter().map(|(_, n)| *n).fold(0.0, f64::max);
        if largest >= 3.0 * all / sums.len() as f64 {
            return self;
        }
        let right = sums.iter().filter(|(sum, n)| *sum >= n * (1.0 - ROUNDING)).count();
        let wrong = sums.iter().filter(|(sum, n)| *sum <= n * ROUNDING).count();
        let [right, wrong] = [right, wrong].map(|whole| least_share(whole, sums.len()));
        Self { low: self.low.max(right.min(self.value)), high: self.high.min((1.0 - wrong).max(self.value)), ..self }
    }

    /// Wilson's score interval about `value` for `count` effective replies.
    fn wilson(value: f64, count: f64, quantile: f64, n: usize) -> Self {
        let square = quantile * quantile;
        let scale = 1.0 + square / count;
        let center = (value + square / (2.0 * count)) / scale;
        let spread = value * (1.0 - value) / count + square / (4.0 * count * count);
        let half = quantile / scale * spread.sqrt();
        Self { value, low: (center - half).clamp(0.0, value), high: (center + half).clamp(value, 1.0), n }
    }

    /// The estimate with its interval widened to cover those of `others`.
    #[must_use]
    pub fn covering(self, others: impl IntoIterator<Item = Self>) -> Self {
        others.into_iter().fold(self, |covering, other| Self {
            low: covering.low.min(other.low),
            high: covering.high.max(other.high),
            ..covering
        })
    }

    /// A value with this interval, widened to contain the value.
    #[must_use]
    pub fn around(value: f64, [low, high]: [f64; 2], n: usize) -> Self {
        Self { value, low: low.min(value), high: high.max(value), n }
    }

    /// A share that is known exactly: the interval is the value itself.
    #[must_use]
    pub fn exact(value: f64, n: usize) -> Self {
        Self { value, low: value, high: value, n }
    }
}

/// The 97.5 % quantile of Student's t distribution with `degrees` degrees of freedom, not necessarily an integer;
/// infinite for 0.
#[must_use]
pub(crate) fn student(degrees: f64) -> f64 {
    quantile(0.975, degrees)
}

/// The quantile of Student's t distribution at `share`; infinite for 0 degrees of freedom.
#[must_use]
pub(crate) fn quantile(share: f64, degrees: f64) -> f64 {
    StudentsT::new(0.0, 1.0, degrees).map_or(f64::INFINITY, |student| student.inverse_cdf(share))
}

/// The two-sided tail probability of Student's t: that it is at least `distance` away from 0. 1 for 0 degrees of
/// freedom.
#[must_use]
pub(crate) fn two_sided_tail(distance: f64, degrees: f64) -> f64 {
    StudentsT::new(0.0, 1.0, degrees).map_or(1.0, |student| (2.0 * student.sf(distance)).min(1.0))
}

/// Degrees of freedom of a variance between C clusters, from the clusters' residuals r: C / (κ − 1), limited to 2 to C
/// − 1, with the kurtosis κ = C Σr⁴ / (Σr²)².
///
/// The variance of a variance grows with the kurtosis (Satterthwaite 1946, Biometrics Bull. 2:110, gives 2C / (κ − 1)).
/// κ is estimated from the same clusters and is too small if a few clusters dominate the variance. In simulations,
/// intervals with half of Satterthwaite's number cover the truth even if shares are near 0 or 1 and clusters are
/// strongly correlated (`tests/program/scores/coverage/`).
#[must_use]
pub(crate) fn degrees_of_freedom(residuals: &[f64]) -> f64 {
    let c = residuals.len() as f64;
    let squares = residuals.iter().map(|residual| residual * residual);
    let second: f64 = squares.clone().sum();
    let fourth: f64 = squares.map(|square| square * square).sum();
    let kurtosis = c * fourth / (second * second);
    if kurtosis > 1.0 { (c / (kurtosis - 1.0)).clamp(f64::min(2.0, c - 1.0), c - 1.0) } else { c - 1.0 }
}

/// The lower end of the exact 95 % interval of a share, from `hits` of `n` independent trials (Clopper and Pearson
/// 1934, Biometrika 26:404).
#[must_use]
fn least_share(hits: usize, n: usize) -> f64 {
    Beta::new(hits as f64, (n - hits) as f64 + 1.0).map_or(0.0, |beta| beta.inverse_cdf(0.025))
}

/// The adjusted residuals of clusters about a mean: r / √(1 − h). Here r is a cluster's sum − `mean` × its number of
/// replies, and h its share of all replies.
///
/// `clusters` lists the sum and the number of replies of each cluster. Empty clusters are skipped. A cluster with all
/// replies has an infinite residual.
///
/// A cluster pulls the mean towards itself in proportion to h, which makes r too small. The sum of the squared adjusted
/// residuals estimates the variance of the total (Bell and McCaffrey 2002, Surv. Methodol. 28:169, CR2 for a mean). For
/// C clusters of equal size, this sum is C / (C − 1) Σr². If one cluster has a third of the replies, intervals from
/// that simpler sum cover the truth less often (`tests/program/scores/coverage/unequal.rs`).
#[must_use]
pub(crate) fn residuals(clusters: &[(f64, f64)], mean: f64) -> Vec<f64> {
    let total: f64 = clusters.iter().map(|(_, count)| count).sum();
    clusters
        .iter()
        .filter(|(_, count)| *count > 0.0)
        .map(|(sum, count)| {
            let others = total - count;
            if others > 0.0 { (sum - mean * count) / (others / total).sqrt() } else { f64::INFINITY }
        })
        .collect()
}

/// Assumed intraclass correlation if the data cannot show one: all replies are correct, all are wrong, no pair differs,
/// or there are few clusters (chosen). The value is high for questions about one frame, so that intervals are not too
/// narrow.
const ASSUMED_CORRELATION: f64 = 0.2;

/// Number of clusters that the assumed correlation counts for if a single cluster has all replies (chosen by
/// simulation).
const ASSUMED_CLUSTERS: f64 = 2.0;

/// Number of equal clusters from which nothing is assumed about their variance (chosen by simulation).
const MANY_CLUSTERS: f64 = 30.0;

/// The assumed design effect if the replies have no variance: 1 + 0.2 (m̄ − 1), where m̄ is the mean number of replies
/// per cluster, weighted by the number of replies (Kish 1965, section 5.4).
#[must_use]
pub(crate) fn unknown_design_effect(clusters: &[(f64, f64)]) -> f64 {
    let total: f64 = clusters.iter().map(|(_, count)| count).sum();
    let squares: f64 = clusters.iter().map(|(_, count)| count * count).sum();
    1.0 + ASSUMED_CORRELATION * (squares / total - 1.0)
}

/// The variance of a total between clusters, `between`, averaged with the variance for the assumed intraclass
/// correlation, and never smaller than `between`. `independent` is the variance for independent replies; each reply is
/// the mean of `weight` answers, or 1.
///
/// The variance between few clusters is poorly known, and too small if the few have missed what happens in one cluster
/// of ten. A prior guess then helps (a scaled inverse chi-squared prior, as in Smyth 2004, Stat. Appl. Genet. Mol.
/// Biol. 3:3). It counts for [`ASSUMED_CLUSTERS`] clusters, and for fewer with each cluster of the data, until none at
/// [`MANY_CLUSTERS`]. Clusters of unequal size count as (Σ n)² / Σ n² clusters (Kish 1965, section 11.7), so that one
/// cluster with nearly all replies does not look like many.
#[must_use]
pub(crate) fn variance_of_few(clusters: &[(f64, f64)], between: f64, independent: f64, weight: f64) -> f64 {
    let count = clusters.iter().filter(|(_, n)| *n > 0.0).count() as f64;
    let total: f64 = clusters.iter().map(|(_, n)| n).sum();
    let squares: f64 = clusters.iter().map(|(_, n)| n * n).sum();
    let effective = total * total / squares;
    if count < 2.0 || effective >= MANY_CLUSTERS {
        return between;
    }
    let assumed_clusters = ASSUMED_CLUSTERS * (1.0 - effective / MANY_CLUSTERS);
    let answers = weight * squares / total;
    let assumed = independent * (1.0 + ASSUMED_CORRELATION * (answers - 1.0)) / weight;
    let known = count - 1.0;
    between.max((assumed_clusters * assumed + known * between) / (assumed_clusters + known))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_matches_published_values() {
        // statsmodels 0.15.0, proportion_confint(method="wilson"); the first four are those of Newcombe 1998 (Stat.
        // Med. 17:857), table I, method 3.
        for (right, n, low, high) in [
            (81, 263, 0.2552885198782742, 0.36620957698280004),
            (15, 148, 0.06238639953073628, 0.16048724172330803),
            (0, 20, 0.0, 0.1611251580528194),
            (1, 29, 0.006113214292762667, 0.17175521879320294),
            (194, 194, 0.9805831454964365, 1.0),
            (3911, 15600, 0.2439657326535477, 0.25756726993901735),
        ] {
            let share = Estimate::share(right, n).unwrap();
            assert!((share.low - low).abs() < 1e-9 && (share.high - high).abs() < 1e-9, "{right}/{n}: {share:?}");
        }
        assert_eq!(Estimate::share(0, 0), None);
        let all = Estimate::share(7, 7).unwrap();
        assert!(all.high <= 1.0 && all.low < 1.0);
    }

    fn counts(pairs: &[(u32, u32)]) -> Vec<ClusterCount> {
        pairs.iter().map(|&(right, replies)| ClusterCount { right, replies }).collect()
    }

    #[test]
    fn clustered_intervals_match_a_reference() {
        // Independent implementation with numpy 2 and scipy 1.17.1.
        let one_bad = [vec![(180, 180); 51], vec![(20, 180)]].concat();
        let few = [4, 4, 3, 4, 0, 2, 4, 4, 1, 4].map(|right| (right, 4));
        let unequal = [(9, 10), (3, 4), (0, 6), (7, 7), (8, 9), (8, 9), (1, 3), (0, 2), (2, 4), (5, 6), (5, 9), (6, 8)];
        // One cluster has a third of all replies.
        let small = [5, 4, 5, 3, 5, 5, 4, 2, 5, 4, 5, 5, 3, 5, 4, 5].map(|right| (right, 5));
        let third = [&[(14, 40)], &small[..]].concat();
        let even = [5, 6, 4, 5, 5, 6, 4, 5].map(|right| (right, 10));
        let six = [12, 14, 10, 16, 11, 13].map(|right| (right, 20));
        let small = [3, 2, 4, 1, 3, 2, 4, 4, 3, 2].map(|right| (right, 4));
        let most = [&[(60, 90)], &small[..]].concat();
        for (pairs, low, high) in [
            // Without the bound by whole clusters, the lower end would be 73.1 %.
            (&one_bad[..], 0.897_446_455_347_9, 0.999_177_030_322_5),
            (&few, 0.424_046_756_632_2, 0.924_380_341_940_7),
            (&unequal, 0.475_837_910_733_2, 0.858_599_144_512_9),
            (&third[..], 0.175_134_913_598_4, 0.959_515_474_172_5),
            (&even, 0.392_974_150_861_2, 0.607_025_849_138_8),
            // Few clusters, and one with most replies: an assumed correlation widens both.
            (&six, 0.470_828_099_851_5, 0.770_282_614_722_5),
            (&most[..], 0.522_580_047_732_3, 0.800_424_999_111_3),
        ] {
            let share = Estimate::clustered(&counts(pairs)).unwrap();
            assert!((share.low - low).abs() < 1e-9, "{pairs:?}: {share:?}");
            assert!((share.high - high).abs() < 1e-9, "{pairs:?}: {share:?}");
        }
        // One cluster has most replies, so whole clusters do not bound the share.
        let large = [(1, 1), (2, 2), (2, 2), (5, 5), (9, 90), (0, 3), (0, 3), (3, 3)];
        let share = Estimate::clustered(&counts(&large)).unwrap();
        assert!(share.low < least_share(5, 8), "{share:?}");
    }

    #[test]
    fn correlated_replies_count_for_fewer() {
        // 40 of 80 are right: half of every cluster, or all or none of each cluster.
        let (spread, clumped) = (clustered(&[(2, 4); 20]), clustered(&[[(4, 4); 10], [(0, 4); 10]].concat()));
        assert_eq!((spread.value, spread.n), (0.5, 80));
        let independent = Estimate::share(40, 80).unwrap();
        assert!(width(spread) >= width(independent) && width(spread) < 1.1 * width(independent));
        assert!(width(clumped) > 1.9 * width(independent));
        // One reply per cluster gives Wilson's own interval; empty clusters are ignored.
        let single = [vec![(1, 1); 15], vec![(0, 1); 133], vec![(0, 0); 9]].concat();
        assert_eq!(Estimate::clustered(&counts(&single)), Estimate::share(15, 148));
        // All replies are right: the interval is wider than for the same number of independent replies.
        let (all, alone) = (clustered(&[(4, 4); 20]), Estimate::share(80, 80).unwrap());
        assert!(all.low < alone.low && all.low > 0.85, "{all:?}");
        assert_eq!(Estimate::clustered(&[]), None);
    }

    fn clustered(pairs: &[(u32, u32)]) -> Estimate {
        Estimate::clustered(&counts(pairs)).unwrap()
    }

    fn width(estimate: Estimate) -> f64 {
        estimate.high - estimate.low
    }

    const STUDENTS: [(f64, f64); 10] = [
        (2.0, 4.30265272975),
        (2.0625, 4.18009114849),
        (2.5, 3.574654842),
        (3.1, 3.12515056686),
        (3.75, 2.85098928359),
        (5.5, 2.50185861759),
        (9.2, 2.25468293628),
        (24.7, 2.06080767881),
        (51.0, 2.00758377032),
        (113.3, 1.98112358874),
    ];

    const SHARES: [(usize, usize, f64); 8] = [
        (1, 8, 0.00315972353125),
        (8, 8, 0.630583352447),
        (3, 8, 0.0852334141373),
        (40, 52, 0.631597228358),
        (51, 52, 0.897446455348),
        (52, 52, 0.931517791297),
        (1, 300, 8.43891323178e-05),
        (250, 300, 0.7862443212),
    ];

    #[test]
    fn quantiles_match_published_tables() {
        // NIST/SEMATECH e-Handbook of Statistical Methods, section 1.3.6.7.2, with more digits from R's qt().
        for (degrees, expected) in [
            (1, 12.706_204_736),
            (2, 4.302_652_730),
            (10, 2.228_138_852),
            (11, 2.200_985_160),
            (30, 2.042_272_456),
            (120, 1.979_930_405),
            (1000, 1.962_339_081),
        ] {
            assert!((student(f64::from(degrees)) - expected).abs() < 1e-9, "{degrees}");
        }
        assert!(student(0.0).is_infinite());
    }

    #[test]
    fn tails_match_the_quantiles() {
        for (degrees, quantile) in STUDENTS {
            assert!((two_sided_tail(quantile, degrees) - 0.05).abs() < 1e-9, "{degrees}");
        }
        assert!((two_sided_tail(1.0, 0.0) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn quantiles_match_scipy() {
        // scipy 1.17.1, t.ppf(0.975, df) and beta.ppf(0.025, hits, n - hits + 1).
        for (degrees, expected) in STUDENTS {
            assert!((student(degrees) - expected).abs() < 1e-9, "{degrees}: {}", student(degrees));
        }
        for (hits, n, expected) in SHARES {
            let least = least_share(hits, n);
            assert!((least - expected).abs() < 1e-9, "{hits} of {n}: {least}");
        }
        assert!(least_share(0, 9) < f64::MIN_POSITIVE);
    }

    #[test]
    fn assumed_variance_fades_with_the_number_of_clusters() {
        let variance = |clusters: usize| {
            let sums = vec![(5.0, 10.0); clusters];
            variance_of_few(&sums, 4.0, 5.0, 1.0)
        };
        // The assumed variance is 5 · (1 + 0.2 · 9) = 14; it counts for 2 · (1 − 6 / 30) = 1.6 of 6.6 clusters.
        assert!((variance(6) - (1.6 * 14.0 + 5.0 * 4.0) / 6.6).abs() < 1e-12);
        assert!(variance(29) > 4.0 && variance(29) < 4.1);
        for clusters in [1, 30, 100] {
            assert!((variance(clusters) - 4.0).abs() < 1e-12, "{clusters}");
        }
        // A larger variance in the data stays.
        assert!((variance_of_few(&[(5.0, 10.0); 6], 20.0, 5.0, 1.0) - 20.0).abs() < 1e-12);
        // 40 clusters, one with most of the replies: 1.2 effective clusters.
        let large = [vec![(50.0, 400.0)], vec![(1.0, 1.0); 39]].concat();
        assert!(variance_of_few(&large, 4.0, 5.0, 1.0) > 20.0);
        // Each reply is the mean of five answers: 5 · (1 + 0.2 · 49) / 5.
        let mean = variance_of_few(&[(5.0, 10.0); 6], 4.0, 5.0, 5.0);
        assert!((mean - (1.6 * 10.8 + 5.0 * 4.0) / 6.6).abs() < 1e-12);
    }

    #[test]
    fn large_clusters_have_larger_residuals() {
        // 6 of 12 replies are correct; the large cluster has half of the replies.
        let sums = [(5.0, 6.0), (0.0, 0.0), (1.0, 3.0), (0.0, 3.0)];
        let found = residuals(&sums, 0.5);
        let expected = [2.0 / f64::sqrt(0.5), -0.5 / f64::sqrt(0.75), -1.5 / f64::sqrt(0.75)];
        assert_eq!(found.len(), 3);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        assert!(residuals(&[(1.0, 2.0)], 0.5)[0].is_infinite());
        // For clusters of equal size, the factor is C / (C − 1).
        let equal_sizes: f64 =
            residuals(&[(1.0, 4.0), (2.0, 4.0), (3.0, 4.0)], 0.5).iter().map(|residual| residual * residual).sum();
        assert!((equal_sizes - 1.5 * 2.0).abs() < 1e-12, "{equal_sizes}");
    }

    #[test]
    fn assumed_design_effect_grows_with_cluster_size() {
        assert!((unknown_design_effect(&[(6.0, 6.0); 9]) - 2.0).abs() < 1e-12);
        assert!((unknown_design_effect(&[(1.0, 1.0); 9]) - 1.0).abs() < 1e-12);
    }
}
