//! The area under the receiver operating characteristic (AUC) for clustered replies: how well a number predicts right
//! replies ([`PairCounts`]).

use statrs::distribution::{ContinuousCDF as _, StudentsT};

use super::estimate::{Estimate, degrees_of_freedom, student};

/// Minimum number of clusters for an interval (chosen): with fewer, the variance estimate is too poor.
const MIN_CLUSTERS: usize = 8;

/// Minimum number of right and of wrong replies for an interval (chosen).
const MIN_REPLIES: usize = 10;

/// A reply with the number that may predict it.
#[derive(Debug, Clone, Copy)]
pub struct RankedReply {
    /// Index of the reply's cluster.
    pub cluster: u32,
    /// The number, for example the fidelity of the image.
    pub number: f64,
    pub right: bool,
}

/// Pairs of a right and a wrong reply of one stratum, summed over strata.
///
/// A pair is concordant if the right reply has the higher number; ties count half. The share of concordant pairs is the
/// AUC (Hanley and McNeil 1982, Radiology 143:29). Because the replies of a cluster are not independent, the variance
/// is computed between clusters, from the pairs of each cluster with all replies (Obuchowski 1997, Biometrics 53:567).
#[derive(Debug, Clone)]
pub struct PairCounts {
    /// Concordant pairs and all pairs of each cluster. A pair counts in the cluster of each of its two replies.
    clusters: Vec<[f64; 2]>,
    concordant: f64,
    pairs: f64,
    right: usize,
    wrong: usize,
}

/// An AUC with its test against ½.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Auc {
    /// Share of concordant pairs, with its interval; `n` is the number of replies.
    pub estimate: Estimate,
    /// Two-sided p-value of the hypothesis that the AUC is ½, from Student's t.
    pub p: f64,
}

impl PairCounts {
    pub fn new(clusters: usize) -> Self {
        Self { clusters: vec![[0.0; 2]; clusters], concordant: 0.0, pairs: 0.0, right: 0, wrong: 0 }
    }

    /// Adds the pairs within one stratum. Sorts `replies` by their numbers.
    pub fn add(&mut self, replies: &mut [RankedReply]) {
        replies.sort_by(|a, b| a.number.total_cmp(&b.number));
        let right = replies.iter().filter(|reply| reply.right).count();
        let wrong = replies.len() - right;
        if right == 0 || wrong == 0 {
            return;
        }
        self.right += right;
        self.wrong += wrong;
        let (mut right_below, mut wrong_below) = (0.0, 0.0);
        for tied in replies.chunk_by(|a, b| a.number.total_cmp(&b.number).is_eq()) {
            let right_here = tied.iter().filter(|reply| reply.right).count() as f64;
            let wrong_here = tied.len() as f64 - right_here;
            for reply in tied {
                let (concordant, all) = if reply.right {
                    (wrong_below + wrong_here / 2.0, wrong as f64)
                } else {
                    let above = right as f64 - right_below - right_here;
                    (above + right_here / 2.0, right as f64)
                };
                let cluster = &mut self.clusters[reply.cluster as usize];
                cluster[0] += concordant;
                cluster[1] += all;
            }
            self.concordant += right_here * (wrong_below + wrong_here / 2.0);
            right_below += right_here;
            wrong_below += wrong_here;
        }
        self.pairs += right as f64 * wrong as f64;
    }

    /// Adds the pairs of other strata.
    pub fn extend(&mut self, other: &Self) {
        for (sums, more) in self.clusters.iter_mut().zip(&other.clusters) {
            sums[0] += more[0];
            sums[1] += more[1];
        }
        self.concordant += other.concordant;
        self.pairs += other.pairs;
        self.right += other.right;
        self.wrong += other.wrong;
    }

    /// The AUC with its interval on the logit scale. `None` if there are too few replies or clusters, or if all pairs
    /// agree, so that no variance can be estimated.
    pub fn auc(&self) -> Option<Auc> {
        let used = self.clusters.iter().filter(|cluster| cluster[1] > 0.0);
        let count = used.clone().count();
        if count < MIN_CLUSTERS || self.right.min(self.wrong) < MIN_REPLIES {
            return None;
        }
        let (c, value) = (count as f64, self.concordant / self.pairs);
        let influences: Vec<f64> = used.map(|[concordant, pairs]| (concordant - value * pairs) / self.pairs).collect();
        let squares: f64 = influences.iter().map(|influence| influence * influence).sum();
        let error = (c / (c - 1.0) * squares).sqrt();
        let slope = value * (1.0 - value);
        if error <= 0.0 || slope <= 0.0 {
            return None;
        }
        let logit = libm::log(value / (1.0 - value));
        let degrees = degrees_of_freedom(&influences);
        let half = student(degrees) * error / slope;
        let distribution = StudentsT::new(0.0, 1.0, degrees).ok()?;
        // Computed on the scale of the interval, so that the interval excludes ½ exactly if p is below 0.05.
        let p = 2.0 * distribution.sf(logit.abs() * slope / error);
        Some(Auc {
            estimate: Estimate {
                value,
                low: logistic(logit - half),
                high: logistic(logit + half),
                n: self.right + self.wrong,
            },
            p: p.min(1.0),
        })
    }
}

fn logistic(logit: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-logit))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn replies(list: &[(u32, f64, bool)]) -> Vec<RankedReply> {
        list.iter().map(|&(cluster, number, right)| RankedReply { cluster, number, right }).collect()
    }

    /// Eight replies in each of `clusters` clusters. Multiples of the golden ratio spread their numbers evenly.
    fn spread(clusters: u32, slope: f64) -> Vec<RankedReply> {
        replies(
            &(0..clusters)
                .flat_map(|cluster: u32| {
                    (0..8).map(move |i| {
                        let place = 8 * cluster + i;
                        let right = place.is_multiple_of(2);
                        let spread = (f64::from(place) * 0.618_033_988_749_895).fract();
                        let number = spread + if right { slope } else { 0.0 };
                        (cluster, number, right)
                    })
                })
                .collect::<Vec<_>>(),
        )
    }

    fn auc(replies: &[RankedReply], clusters: usize) -> Option<Auc> {
        let mut counts = PairCounts::new(clusters);
        counts.add(&mut replies.to_vec());
        counts.auc()
    }

    #[test]
    fn pair_counts_match_a_manual_count() {
        let mut counts = PairCounts::new(2);
        // Right: 1, 2, 3; wrong: 0, 2. Pairs: 1>0, 2>0, 3>0, 3>2 are concordant, 2=2 is tied, 1<2 is not.
        counts.add(&mut replies(&[(0, 1.0, true), (0, 0.0, false), (1, 2.0, true), (1, 2.0, false), (1, 3.0, true)]));
        let sums = [counts.concordant, counts.pairs];
        assert!((sums[0] - 4.5).abs() < 1e-12 && (sums[1] - 6.0).abs() < 1e-12);
        // Each pair is counted for both of its replies.
        let sums = counts.clusters.iter().map(|cluster| cluster[0]);
        assert!((sums.sum::<f64>() - 9.0).abs() < 1e-12);
        // A stratum of right replies alone has no pairs.
        counts.add(&mut replies(&[(0, 9.0, true)]));
        assert!((counts.pairs - 6.0).abs() < 1e-12);
        assert_eq!(counts.auc(), None, "two clusters give no interval");
    }

    #[test]
    fn predictive_numbers_are_detected() {
        let none = auc(&spread(20, 0.0), 20).unwrap();
        assert!((none.estimate.value - 0.5).abs() < 0.05 && none.p > 0.05, "{none:?}");
        let some = auc(&spread(20, 0.3), 20).unwrap();
        assert!(some.estimate.low > 0.5 && some.p < 0.001, "{some:?}");
        let reversed = auc(&spread(20, -0.3), 20).unwrap();
        assert!((some.estimate.value + reversed.estimate.value - 1.0).abs() < 0.1);
        assert_eq!(auc(&spread(7, 0.3), 7), None);
        assert_eq!(auc(&spread(20, 3.0), 20), None, "all pairs agree");
    }

    #[test]
    fn repeated_strata_add_no_evidence() {
        let mut once = PairCounts::new(12);
        once.add(&mut spread(12, 0.2));
        let mut pooled = once.clone();
        for _ in 1..15 {
            pooled.extend(&once);
        }
        let (once, pooled) = (once.auc().unwrap(), pooled.auc().unwrap());
        assert!((once.p - pooled.p).abs() < 1e-9 && once.p > 1e-6, "{once:?}");
        let (once, pooled) = (once.estimate, pooled.estimate);
        assert!((once.low - pooled.low).abs() < 1e-9, "{pooled:?}");
        assert!((once.high - pooled.high).abs() < 1e-9, "{pooled:?}");
    }

    #[test]
    fn p_and_interval_agree() {
        for step in 0..40 {
            let found = auc(&spread(12, f64::from(step) * 0.01), 12).unwrap();
            let excludes = found.estimate.low > 0.5 || found.estimate.high < 0.5;
            assert_eq!(excludes, found.p < 0.05, "{found:?}");
        }
    }
}
