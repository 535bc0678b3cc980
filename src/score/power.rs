//! [`PlannedSample`]: the difference that a planned run can detect, computed before any request.
//!
//! Paired answers right or wrong are a matched-pairs design. With n pairs, a share ψ of which differ between the two
//! sides, a difference δ is detected with power 1 − β at level α if n δ² = D (t₁₋α⁄₂ √ψ + t₁₋β √(ψ − δ²))² (Connett,
//! Smith and McHugh 1987, Stat. Med. 6:53). D is the design effect of clusters of unequal sizes m, 1 + (Σm² / Σm − 1) ρ
//! (Eldridge, Ashby and Kerry 2006, Int. J. Epidemiol. 35:1292, with its cv of the sizes written out). The quantiles
//! are those of Student's t, with the degrees of freedom that the test finds on average
//! ([`degrees_of_freedom`](crate::statistics::estimate)): half the number C of clusters, whose sums have a kurtosis of
//! about 3; C − 1 if pairs are independent.
//!
//! ψ and ρ are not known before a run, so both are assumed: [`CHANGED`] and [`CORRELATION`].

use serde::Serialize;

use super::comparisons::paired::POWER;
use super::significance::least_p;
use crate::statistics::estimate::quantile;

/// Share of the answers that change between two conditions without any effect, half of them in each direction; assumed.
/// It is that of the simulated runs of `src/docs/numbers.md`.
pub const CHANGED: f64 = 0.2;

/// Correlation of the changes of answers within a cluster; assumed.
pub const CORRELATION: f64 = 0.05;

/// Difference for which the required number of clusters is reported: 5 points.
pub const TARGET: f64 = 0.05;

/// Maximum number of clusters that is tried.
const MAX_CLUSTERS: f64 = 1e6;

/// Size of a planned run: questions by cluster, and models that findings are pooled over.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedSample {
    /// Number of questions of each cluster.
    pub questions: Vec<usize>,
    pub models: usize,
    /// Verdict level of the test.
    pub level: f64,
}

/// Smallest effect that a planned run can detect.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Detectable {
    /// Smallest difference that is detected in 80 % of runs; `None` if no difference is.
    pub difference: Option<f64>,
    /// Number of clusters of the same size needed to detect a difference of [`TARGET`].
    pub clusters_for_target: usize,
}

impl PlannedSample {
    /// Computes the smallest detectable effect.
    #[must_use]
    pub fn detectable(&self) -> Detectable {
        let clusters = self.questions.len() as f64;
        let design = Design::new(self);
        let mut low = 0.0;
        let mut high = 1.0;
        let is_possible = least_p(self.questions.len()) < self.level && design.detects(high, clusters);
        // Bisection: the power grows with the difference.
        for _ in 0..40 {
            let middle = f64::midpoint(low, high);
            if design.detects(middle, clusters) {
                high = middle;
            } else {
                low = middle;
            }
        }
        Detectable { difference: is_possible.then_some(high), clusters_for_target: design.clusters_for(TARGET) }
    }
}

/// Design of a sample: pairs per cluster and design effect.
#[derive(Debug)]
struct Design {
    /// Mean number of pairs of a cluster.
    pairs: f64,
    /// Design effect of the clusters.
    effect: f64,
    /// Verdict level of the test.
    level: f64,
}

impl Design {
    fn new(sample: &PlannedSample) -> Self {
        let pairs = sample.questions.iter().map(|count| count * sample.models);
        let [sum, squares] = pairs.fold([0.0, 0.0], |[sum, squares], pairs| {
            let pairs = pairs as f64;
            [sum + pairs, squares + pairs * pairs]
        });
        Self {
            pairs: sum / sample.questions.len() as f64,
            effect: (1.0 + (squares / sum - 1.0) * CORRELATION).max(1.0),
            level: sample.level,
        }
    }

    /// Number of clusters like these that are needed to detect a difference.
    fn clusters_for(&self, difference: f64) -> usize {
        let (mut low, mut high) = (2.0, MAX_CLUSTERS);
        while high - low > 1.0 {
            let middle = f64::midpoint(low, high).floor();
            if self.detects(difference, middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        high as usize
    }

    /// True if a difference is detected with [`POWER`] in this number of clusters like these.
    fn detects(&self, difference: f64, clusters: f64) -> bool {
        let n = self.pairs * clusters;
        // An effect reverses some answers that would change in the other direction, and changes some that would not
        // change.
        let changed = (CHANGED + difference / 2.0).max(difference);
        let degrees = if self.effect > 1.0 { clusters / 2.0 } else { clusters - 1.0 };
        let [test, power] = [1.0 - self.level / 2.0, POWER].map(|share| quantile(share, degrees.max(1.0)));
        let spread = test * changed.sqrt() + power * (changed - difference * difference).max(0.0).sqrt();
        n * difference * difference >= self.effect * spread * spread
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{RngExt as _, SeedableRng as _};

    use super::super::comparisons::paired::{ClusterNet, PairedTest};
    use super::*;

    /// Smallest effect that one model can show in clusters of equally many questions.
    fn detectable(clusters: usize, questions: usize, level: f64) -> Detectable {
        PlannedSample { questions: vec![questions; clusters], models: 1, level }.detectable()
    }

    #[test]
    fn independent_pairs_follow_the_formula_of_matched_pairs() {
        // n = (1.96 √ψ + 0.8416 √(ψ − δ²))² / δ² for ψ = 0.25 and δ = 0.1: 194 pairs.
        let found = detectable(194, 1, 0.05).difference.unwrap();
        assert!((found - 0.1).abs() < 0.001, "{found}");
        assert_eq!(detectable(5, 4, 0.05).difference, None);
        // More questions of the same clusters help less than more clusters.
        let [larger, more, few] = [(40, 8), (80, 4), (40, 4)]
            .map(|(clusters, questions)| detectable(clusters, questions, 0.05).difference.unwrap());
        assert!(larger > more && larger < few);
    }

    #[test]
    fn the_number_of_clusters_detects_the_target() {
        let needed = detectable(42, 4, 0.01).clusters_for_target;
        let [found, found_in_fewer] =
            [needed, needed - 2].map(|clusters| detectable(clusters, 4, 0.01).difference.unwrap());
        assert!(found <= TARGET + 1e-6 && found_in_fewer > TARGET);
    }

    /// Share of simulated samples in which a difference is detected. Changes of a cluster are correlated because some
    /// items take the draw of their cluster.
    fn power(sample: &PlannedSample, difference: f64, random: &mut StdRng) -> f64 {
        let runs = 400;
        let changed = CHANGED + difference / 2.0;
        let better = f64::midpoint(changed, difference);
        (0..runs)
            .filter(|_| {
                let mut squares = 0.0;
                let clusters: Vec<ClusterNet> = sample
                    .questions
                    .iter()
                    .map(|items| {
                        let common = random.random_range(0.0..1.0);
                        let nets = (0..*items).map(|_| {
                            let net: i64 = (0..sample.models)
                                .map(|_| {
                                    let is_common = random.random_bool(CORRELATION.sqrt());
                                    let draw = if is_common { common } else { random.random_range(0.0..1.0) };
                                    if draw < better {
                                        1
                                    } else if draw < changed {
                                        -1
                                    } else {
                                        0
                                    }
                                })
                                .sum();
                            squares += (net * net) as f64;
                            net
                        });
                        ClusterNet { net: nets.sum(), items: *items as u32 }
                    })
                    .collect();
                PairedTest::new(&clusters, sample.models as f64, squares).tested.p < sample.level
            })
            .count() as f64
            / f64::from(runs)
    }

    #[test]
    fn simulated_runs_detect_it_in_about_four_of_five() {
        let mut random = StdRng::seed_from_u64(11);
        let uneven = (0..40).map(|number| 1 + number % 8).collect();
        for (questions, models, level) in [
            (vec![4; 42], 1, 0.05),
            (vec![4; 42], 1, 0.005),
            (vec![8; 25], 6, 0.01),
            (uneven, 3, 0.05),
            (vec![1; 300], 1, 0.01),
        ] {
            let sample = PlannedSample { questions, models, level };
            let difference = sample.detectable().difference.unwrap();
            let found = power(&sample, difference, &mut random);
            assert!((0.7..0.9).contains(&found), "{sample:?} {difference}: {found}");
        }
    }
}
