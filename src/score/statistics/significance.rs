//! Tests of paired differences ([`mcnemar`], [`sign_flip`] and [`swap_test`]), the correction for several tests
//! ([`holm`]), and the result ([`Verdict`]).

use std::fmt;

use super::bootstrap::SplitMix;

/// Verdict level of the tests (conventional).
pub const ALPHA: f64 = 0.05;

/// Result of a comparison at the 5 % level, after Holm's correction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The first side is better.
    Better,
    /// The first side is worse.
    Worse,
    /// No difference is detected. The two sides are not therefore equal.
    NotShown,
    /// No verdict is possible: with so few clusters and so many tests the corrected p cannot be below 0.05, however
    /// large the difference.
    TooFewClusters,
    /// Fewer items are shared than a verdict needs (`MIN_PAIRS` of the comparison).
    TooFew,
    /// The missing replies decide: with some values of them a difference would be detected, with others not.
    Missing,
}

/// p-values of a test with missing replies, before or after correction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PValues {
    /// p-value that holds whatever the missing replies would have been.
    pub p: f64,
    /// Smallest p-value that any values of the missing replies could give; `p` if no reply is missing.
    pub if_answered: f64,
    /// Smallest p-value that the clusters allow.
    pub least: f64,
}

impl PValues {
    /// Corrects each of the three p-values over all tests, by Holm's procedure ([`holm`]).
    #[must_use]
    pub fn corrected(tests: &[Self]) -> Vec<Self> {
        let [p, if_answered, least] = [|test: &Self| test.p, |test: &Self| test.if_answered, |test: &Self| test.least]
            .map(|value| holm(&tests.iter().map(value).collect::<Vec<f64>>()));
        p.into_iter()
            .zip(if_answered)
            .zip(least)
            .map(|((p, if_answered), least)| Self { p, if_answered, least })
            .collect()
    }
}

impl Verdict {
    /// The result for a difference with these corrected p-values.
    #[must_use]
    pub fn new(difference: f64, corrected: PValues) -> Self {
        if corrected.least >= ALPHA {
            Self::TooFewClusters
        } else if corrected.p >= ALPHA && corrected.if_answered < ALPHA {
            Self::Missing
        } else if corrected.p >= ALPHA {
            Self::NotShown
        } else if difference > 0.0 {
            Self::Better
        } else {
            Self::Worse
        }
    }

    /// True if a difference is detected, in either direction.
    #[must_use]
    pub fn is_shown(self) -> bool {
        matches!(self, Self::Better | Self::Worse)
    }

    /// True if a verdict is possible, whatever the replies.
    #[must_use]
    pub fn is_possible(self) -> bool {
        !matches!(self, Self::TooFew | Self::TooFewClusters)
    }

    /// True if there is a verdict: enough clusters and items, and no missing replies that decide it.
    #[must_use]
    pub fn is_decided(self) -> bool {
        self.is_possible() && self != Self::Missing
    }

    /// The word for the result in tables; empty if no verdict is possible.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Better => "better",
            Self::Worse => "worse",
            Self::NotShown => "not shown",
            Self::TooFewClusters => "",
            Self::TooFew => "too few",
            Self::Missing => "replies missing",
        }
    }
}

/// Result of a permutation test that swaps the two sides in whole clusters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SwapTest {
    /// Two-sided p-value.
    pub p: f64,
    /// Method of computing the p-value.
    pub by: SwapMethod,
}

/// Method of computing the share of swaps that are at least as extreme as the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SwapMethod {
    /// All swaps were counted.
    Counted,
    /// This number of random swaps were counted.
    Drawn(usize),
    /// The total difference of the swaps was approximated by a normal distribution.
    Normal,
}

impl fmt::Display for SwapMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Counted => f.write_str("all swaps"),
            Self::Drawn(draws) => write!(f, "{draws} random swaps"),
            Self::Normal => f.write_str("normal distribution"),
        }
    }
}

/// Maximum size of the table of exact probabilities (clusters × possible sums): 0.3 s on one core (chosen).
const MAX_CELLS: u64 = 1 << 28;

/// Number of random swaps if the table would be larger (chosen): p = 0.05 is then known to ± 0.0014.
const SWAPS: usize = 100_000;

/// Minimum effective number of clusters for the normal approximation (chosen; see [`normal_swaps`]).
const MIN_EFFECTIVE_CLUSTERS: f64 = 1000.0;

/// Seed of the random swaps (chosen). It is fixed, so that the same records give the same p-value.
const SEED: u64 = 0x7377_6170;

/// The permutation test that swaps the two sides in whole clusters. Uses [`sign_flip`] if its table has at most 2²⁸
/// cells; otherwise [`normal_swaps`] if enough clusters contribute for an error of at most 10⁻⁴; otherwise the Monte
/// Carlo estimate (1 + hits) / (1 + draws) from 100,000 seeded swaps (Phipson and Smyth 2010, Stat. Appl. Genet. Mol.
/// Biol. 9:39), which keeps the size of the test.
#[must_use]
pub fn swap_test(differences: &[i64]) -> SwapTest {
    let reduced = reduce(differences);
    let sum: u64 = reduced.iter().map(|difference| difference.unsigned_abs()).sum();
    let cells = (sum + 1).saturating_mul(reduced.len() as u64);
    let (p, by) = if cells <= MAX_CELLS {
        (sign_flip(differences), SwapMethod::Counted)
    } else if effective_clusters(&reduced) >= MIN_EFFECTIVE_CLUSTERS {
        (normal_swaps(&reduced), SwapMethod::Normal)
    } else {
        let by = SwapMethod::Drawn(SWAPS);
        (drawn_swaps(differences, SWAPS), by)
    };
    SwapTest { p, by }
}

/// The effective number of clusters, (Σ d²)² / Σ d⁴: the number of equal differences whose total is equally close to
/// normal. The excess kurtosis of the total is −2 divided by this number.
fn effective_clusters(differences: &[i64]) -> f64 {
    let [squares, fourths] = [2, 4].map(|n| differences.iter().map(|d| (*d as f64).powi(n)).sum::<f64>());
    squares * squares / fourths
}

/// Normal approximation of [`sign_flip`], for differences without a common divisor.
///
/// The total of the swaps is symmetric about 0, its variance is Σ d², and it changes in steps of 2. The probability of
/// a total is therefore that of the normal distribution from 1 below it to 1 above it (continuity correction). Because
/// of the symmetry, the first neglected term of the Edgeworth expansion is that of the kurtosis (Feller 1971, volume
/// II, section XVI.4): 10⁻⁴ at p = 0.05 with [`MIN_EFFECTIVE_CLUSTERS`] clusters, and a tenth of p at p = 10⁻⁸.
fn normal_swaps(differences: &[i64]) -> f64 {
    let total = differences.iter().sum::<i64>().abs() as f64;
    let squares: f64 = differences.iter().map(|d| (*d as f64).powi(2)).sum();
    let distance = (total - 1.0).max(0.0) / (2.0 * squares).sqrt();
    libm::erfc(distance)
}

/// Monte Carlo p-value of [`sign_flip`] from a number of random swaps.
fn drawn_swaps(differences: &[i64], draws: usize) -> f64 {
    let observed = differences.iter().sum::<i64>().abs();
    let mut random = SplitMix(SEED);
    let hits = (0..draws).filter(|_| randomly_swapped_sum(differences, &mut random).abs() >= observed).count();
    (1 + hits) as f64 / (1 + draws) as f64
}

/// The sum of the differences, each with a random sign.
fn randomly_swapped_sum(differences: &[i64], random: &mut SplitMix) -> i64 {
    let mut sum = 0;
    for block in differences.chunks(64) {
        let mut bits = random.bits();
        for difference in block {
            sum += if bits & 1 == 0 { *difference } else { -difference };
            bits >>= 1;
        }
    }
    sum
}

/// Smallest two-sided p-value that swaps of this number of clusters, c, can give: 2 / 2ᶜ.
#[must_use]
pub fn least_p(clusters: usize) -> f64 {
    (2.0 * libm::exp2(-(clusters as f64))).min(1.0)
}

/// Removes zeros and divides by the greatest common divisor, which changes no p-value.
fn reduce(differences: &[i64]) -> Vec<i64> {
    let divisor = differences.iter().fold(0, |a, d| gcd(a, d.unsigned_abs()));
    differences.iter().filter(|difference| **difference != 0).map(|difference| difference / divisor as i64).collect()
}

/// Greatest common divisor; `gcd(0, n)` is n.
#[must_use]
pub fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// Exact two-sided p-value of McNemar's test (McNemar 1947, Psychometrika 12:153; exact as the binomial sign test).
///
/// `gained` and `lost` are the numbers of pairs with only one side right. The test treats pairs as independent;
/// [`sign_flip`] does not.
#[must_use]
pub fn mcnemar(gained: usize, lost: usize) -> f64 {
    let smaller = gained.min(lost);
    let masses = binomial(gained + lost);
    let tail: f64 = masses.iter().take(smaller + 1).sum();
    (2.0 * tail).min(1.0)
}

/// Exact two-sided p-value of the hypothesis that the two sides can be swapped in every cluster: the share of the 2ᶜ
/// swaps whose total difference is at least as far from 0 as the observed one.
///
/// `differences` has, for each cluster, the pairs gained minus the pairs lost. With one pair per cluster this is
/// McNemar's exact test. Unlike McNemar's test, it keeps its size if the pairs of a cluster are correlated (the
/// permutation form of Durkalski et al. 2003, Stat. Med. 22:2417).
#[must_use]
fn sign_flip(differences: &[i64]) -> f64 {
    let reduced = reduce(differences);
    let total = reduced.iter().sum::<i64>().unsigned_abs() as usize;
    let mut sizes: Vec<usize> = reduced.iter().map(|d| d.unsigned_abs() as usize).collect();
    sizes.sort_unstable();
    // The distribution of the sum k of the sizes with positive sign; the total difference is then 2k − max_total.
    let mut masses = vec![1.0];
    let mut rest = &sizes[..];
    while let Some(&size) = rest.first() {
        let repeats = rest.partition_point(|other| *other == size);
        masses = convolve(&masses, &binomial(repeats), size);
        rest = &rest[repeats..];
    }
    let max_total: usize = sizes.iter().sum();
    masses
        .iter()
        .enumerate()
        .filter(|(positive, _)| (2 * positive).abs_diff(max_total) >= total)
        .map(|(_, mass)| mass)
        .sum::<f64>()
        .min(1.0)
}

/// Probability masses of the sum of two random numbers, of which the second has values in steps of `step`.
fn convolve(masses: &[f64], second: &[f64], step: usize) -> Vec<f64> {
    let mut sum = vec![0.0; masses.len() + (second.len() - 1) * step];
    for (index, weight) in second.iter().enumerate().filter(|(_, w)| **w > 0.0) {
        let at = &mut sum[index * step..][..masses.len()];
        for (sum, mass) in at.iter_mut().zip(masses) {
            *sum += weight * mass;
        }
    }
    sum
}

/// Probability masses of the number of heads among `n` fair coins. Masses below 10⁻⁴⁰ are 0 for n above 1000.
fn binomial(n: usize) -> Vec<f64> {
    const MIN_MASS: f64 = 1e-40;
    let log_factorial = libm::lgamma(n as f64 + 1.0);
    let log_outcomes = n as f64 * std::f64::consts::LN_2;
    if n <= 1000 {
        // 2⁻¹⁰⁰⁰ does not underflow, so the recurrence is exact up to rounding.
        let mut masses = Vec::with_capacity(n + 1);
        let mut mass = libm::exp2(-(n as f64));
        for k in 0..=n {
            masses.push(mass);
            mass *= (n - k) as f64 / (k + 1) as f64;
        }
        return masses;
    }
    (0..=n)
        .map(|k: usize| {
            let log = log_factorial - libm::lgamma(k as f64 + 1.0) - libm::lgamma((n - k) as f64 + 1.0) - log_outcomes;
            let mass = libm::exp(log);
            if mass < MIN_MASS { 0.0 } else { mass }
        })
        .collect()
}

/// Holm's adjusted p-values (Holm 1979, Scand. J. Stat. 6:65), in the order of `values`. If values below 0.05 count as
/// detected, the probability of any false positive is at most 5 %.
#[must_use]
pub fn holm(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut adjusted = vec![0.0; values.len()];
    let mut highest = 0.0_f64;
    for (rank, index) in order.into_iter().enumerate() {
        highest = highest.max((values.len() - rank) as f64 * values[index]);
        adjusted[index] = highest.min(1.0);
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOLDEN_MCNEMAR: [(usize, usize, f64); 9] = [
        (0, 1, 1.0),
        (3, 9, 0.14599609375),
        (10, 10, 1.0),
        (86, 150, 3.7159361395713866e-05),
        (1, 25, 8.046627044677734e-07),
        (700, 900, 6.319484959450105e-07),
        (2000, 2300, 5.079935568924055e-06),
        (5000, 5100, 0.32458154633139585),
        (40, 0, 1.8189894035458565e-12),
    ];

    const GOLDEN_HOLM: [(f64, f64); 8] = [
        (0.01, 0.06),
        (0.04, 0.15),
        (0.03, 0.15),
        (0.005, 0.035),
        (0.6, 1.0),
        (0.0001, 0.0008),
        (0.03, 0.15),
        (1.0, 1.0),
    ];

    /// p-values of a test without missing replies.
    fn complete(p: f64, least: f64) -> PValues {
        PValues { p, if_answered: p, least }
    }

    #[test]
    fn mcnemar_is_the_sign_test() {
        // scipy 1.17.1, binomtest(b, b + c).pvalue.
        for (gained, lost, expected) in GOLDEN_MCNEMAR {
            let p = mcnemar(gained, lost);
            assert!((p - expected).abs() < 1e-9 && (p / expected - 1.0).abs() < 1e-9, "{gained} {lost}: {p}");
            assert!((p - mcnemar(lost, gained)).abs() < 1e-15);
            let single = [vec![1; gained], vec![-1; lost], vec![0; 5]].concat();
            assert!((sign_flip(&single) - p).abs() < 1e-9, "{gained} {lost}");
        }
    }

    #[test]
    fn swaps_are_counted() {
        for differences in [vec![], vec![0, 0], vec![3], vec![2, -1, 3], vec![1, 1, 1, -4, 2, 2, -1, 5]] {
            let total: i64 = differences.iter().sum();
            let n = differences.len();
            let expected = (0..1_u32 << n)
                .filter(|signs| {
                    let sum: i64 =
                        (0..n).map(|i| if signs >> i & 1 == 0 { differences[i] } else { -differences[i] }).sum();
                    sum.abs() >= total.abs()
                })
                .count() as f64
                / f64::from(1_u32 << n);
            assert!((sign_flip(&differences) - expected).abs() < 1e-12, "{differences:?}");
        }
    }

    #[test]
    fn random_swaps_approximate_the_exact_test() {
        for differences in [vec![3, -1, 2, 4, 1, 1, 5, -2, 3, 2], vec![2; 9], vec![1, -1]] {
            let (counted, drawn) = (sign_flip(&differences), drawn_swaps(&differences, SWAPS));
            // Four standard errors.
            let near = 4.0 * (counted * (1.0 - counted) / SWAPS as f64).sqrt() + 2e-5;
            assert!((drawn - counted).abs() < near, "{differences:?}: {drawn}, {counted}");
        }
        // 900 clusters whose differences have no common divisor: 10⁹ cells.
        let large: Vec<i64> = (0..900).map(|i| 1000 + i % 7).collect();
        let tested = swap_test(&large);
        let drawn = SwapMethod::Drawn(SWAPS);
        assert_eq!((tested.p, tested.by), (1.0 / 100_001.0, drawn));
        let small = swap_test(&[2, 4, 6]);
        assert_eq!((small.p, small.by), (0.25, SwapMethod::Counted));
    }

    #[test]
    fn normal_swaps_approximate_the_exact_test() {
        // Differences of 1 to 5 in as many clusters as the table allows, `few` of them negative.
        for (clusters, few) in [(1800, 860), (1800, 830), (4000, 1900), (4000, 1850)] {
            let differences: Vec<i64> =
                (0..clusters).map(|i| (1 + i % 5) * if i * 7919 % clusters < few { -1 } else { 1 }).collect();
            assert!(effective_clusters(&differences) >= MIN_EFFECTIVE_CLUSTERS);
            let (counted, normal) = (sign_flip(&differences), normal_swaps(&differences));
            assert!((counted - normal).abs() < 1e-4, "{counted} {normal}");
        }
        // A p-value that is too small for random swaps.
        let far: Vec<i64> = (0..4000).map(|i| if i % 11 < 5 { -1 } else { 1 }).collect();
        let (counted, normal) = (sign_flip(&far), normal_swaps(&far));
        assert!(counted < 1e-6 && (normal / counted - 1.0).abs() < 0.05);
        // 20,000 clusters are too many for the table.
        let many: Vec<i64> = (0..20_000).map(|i| 1 + i % 5).collect();
        assert_eq!(swap_test(&many).by, SwapMethod::Normal);
        // If one cluster dominates, the total is not normal, whatever the number of clusters.
        let one: Vec<i64> = (0..1500).map(|i| if i == 0 { 200_001 } else { 1 }).collect();
        assert_eq!(swap_test(&one).by, SwapMethod::Drawn(SWAPS));
    }

    #[test]
    fn no_verdict_is_possible_with_few_clusters() {
        assert!((least_p(8) - 2.0 / 256.0).abs() < 1e-15);
        assert!((least_p(0) - 1.0).abs() < 1e-15);
        for (clusters, expected) in [(8, Verdict::Worse), (7, Verdict::TooFewClusters)] {
            let least = 5.0 * least_p(clusters);
            assert_eq!(Verdict::new(-0.3, complete(least, least)), expected);
        }
        assert_eq!(Verdict::new(0.3, complete(0.05, 0.01)), Verdict::NotShown);
        let undecided = PValues { p: 0.2, if_answered: 0.04, least: 0.01 };
        assert_eq!(Verdict::new(0.3, undecided), Verdict::Missing);
    }

    #[test]
    fn holm_steps_down() {
        // statsmodels 0.15.0, multipletests(method="holm").
        let adjusted = holm(&GOLDEN_HOLM.map(|(p, _)| p));
        for (adjusted, (p, expected)) in adjusted.iter().zip(GOLDEN_HOLM) {
            assert!((adjusted - expected).abs() < 1e-9, "{p}");
        }
        assert!(holm(&[]).is_empty());
    }
}
