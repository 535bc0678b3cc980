//! A number with its uncertainty: [`Estimate`].

use serde::{Deserialize, Serialize};

use super::grid::ClusterCount;
use super::student::student;

/// The 97.5 % quantile of the standard normal distribution, for 95 % intervals.
const Z: f64 = 1.959_963_984_540_054;

/// How alike the replies of one cluster are taken to be where all of them are right, or none, so that the records cannot
/// say: an intraclass correlation that is high for questions about one frame, which keeps the interval honest.
const UNKNOWN_CORRELATION: f64 = 0.2;

/// A share, or a difference of shares, with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The number itself.
    pub value: f64,
    /// The lower end of the interval.
    pub low: f64,
    /// The upper end of the interval.
    pub high: f64,
    /// How many trials it rests on.
    pub n: usize,
}

impl Estimate {
    /// The share of `right` among `n` independent trials with Wilson's score interval (Wilson 1927, J. Am. Stat. Assoc.
    /// 22:209); `None` of no trials.
    #[must_use]
    pub fn share(right: usize, n: usize) -> Option<Self> {
        if n == 0 || right > n {
            return None;
        }
        let value = right as f64 / n as f64;
        Some(Self::wilson(value, n as f64, Z, n))
    }

    /// The share of right replies in clusters; `None` of no replies.
    ///
    /// Wilson's interval at the effective number of replies n / d, where the design effect d ≥ 1 is the variance of the
    /// share between clusters (linearised, times C / (C − 1) for C clusters) over that of independent replies, and with
    /// Student's quantile of C − 1 degrees of freedom in place of the normal one (Dean and Pagano 2015, J. Surv. Stat.
    /// Methodol. 3:484, find it the best of seven for clustered shares). With one reply a cluster it is Wilson's own. Where
    /// all replies are right, or none, d is 1 + 0.2 (m − 1) for clusters of m replies (Kish 1965, section 5.4).
    #[must_use]
    pub fn clustered(counts: &[ClusterCount]) -> Option<Self> {
        let there = counts.iter().filter(|count| count.replies > 0);
        let n: usize = there.clone().map(|count| count.replies as usize).sum();
        if there.clone().all(|count| count.replies == 1) || there.clone().count() == 1 {
            return Self::share(there.map(|count| count.right as usize).sum(), n);
        }
        let sums = there.map(|count| (f64::from(count.right), f64::from(count.replies)));
        Self::scored(&sums.collect::<Vec<_>>(), 1.0, n)
    }

    /// The same for scores between 0 and 1 in place of right and wrong: `sums` holds, for each cluster, the sum of its scores
    /// and their number. Scores that are means of several replies may count for up to `most` independent replies each. `n` is
    /// what the estimate is said to rest on.
    #[must_use]
    pub(super) fn scored(sums: &[(f64, f64)], most: f64, n: usize) -> Option<Self> {
        let all: f64 = sums.iter().map(|(_, n)| n).sum();
        if all <= 0.0 {
            return None;
        }
        let c = sums.len() as f64;
        let value = (sums.iter().map(|(sum, _)| sum).sum::<f64>() / all).clamp(0.0, 1.0);
        let independent = value * (1.0 - value) / all;
        let spread = independent > 1e-12 && sums.len() > 1;
        let effect = if spread {
            let off = |(sum, n): &(f64, f64)| (sum - value * n) * (sum - value * n);
            let between: f64 = sums.iter().map(off).sum();
            c / (c - 1.0) * between / (all * all) / independent
        } else {
            let squares: f64 = sums.iter().map(|(_, n)| n * n).sum();
            1.0 + UNKNOWN_CORRELATION * (squares / all - 1.0)
        };
        let effective = all / effect.max(1.0 / most);
        // Where clusters spread no more than they are taken to at least, nothing was estimated that Student's quantile allows for.
        let least = if spread { 1.0 / most } else { 1.0 };
        let quantile = if sums.len() > 1 && effect > least {
            student(sums.len() - 1)
        } else {
            Z
        };
        Some(Self::wilson(value, effective, quantile, n))
    }

    fn wilson(value: f64, count: f64, quantile: f64, n: usize) -> Self {
        let square = quantile * quantile;
        let scale = 1.0 + square / count;
        let center = (value + square / (2.0 * count)) / scale;
        let spread = value * (1.0 - value) / count + square / (4.0 * count * count);
        let half = quantile / scale * spread.sqrt();
        Self {
            value,
            low: (center - half).clamp(0.0, value),
            high: (center + half).clamp(value, 1.0),
            n,
        }
    }

    /// A share that is known exactly.
    #[must_use]
    pub fn exact(value: f64, n: usize) -> Self {
        Self {
            value,
            low: value,
            high: value,
            n,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_matches_published_values() {
        // statsmodels 0.15.0, proportion_confint(method="wilson"); the first four are those of Newcombe 1998 (Stat. Med. 17:857),
        // table I, method 3.
        for (right, n, low, high) in [
            (81, 263, 0.2552885198782742, 0.36620957698280004),
            (15, 148, 0.06238639953073628, 0.16048724172330803),
            (0, 20, 0.0, 0.1611251580528194),
            (1, 29, 0.006113214292762667, 0.17175521879320294),
            (194, 194, 0.9805831454964365, 1.0),
            (3911, 15600, 0.2439657326535477, 0.25756726993901735),
        ] {
            let share = Estimate::share(right, n).unwrap();
            assert!(
                (share.low - low).abs() < 1e-9 && (share.high - high).abs() < 1e-9,
                "{right}/{n}: {share:?}"
            );
        }
        assert_eq!(Estimate::share(0, 0), None);
        let all = Estimate::share(7, 7).unwrap();
        assert!(all.high <= 1.0 && all.low < 1.0);
    }

    fn counts(pairs: &[(u32, u32)]) -> Vec<ClusterCount> {
        let count = |&(right, replies)| ClusterCount { right, replies };
        pairs.iter().map(count).collect()
    }

    #[test]
    fn replies_that_go_together_count_for_fewer() {
        let share = |pairs: &[(u32, u32)]| Estimate::clustered(&counts(pairs)).unwrap();
        let width = |estimate: Estimate| estimate.high - estimate.low;
        // Half of eighty: every cluster half right, or each all right or all wrong.
        let (spread, clumped) = (
            share(&[(2, 4); 20]),
            share(&[[(4, 4); 10], [(0, 4); 10]].concat()),
        );
        assert_eq!((spread.value, spread.n), (0.5, 80));
        let independent = Estimate::share(40, 80).unwrap();
        assert!(width(spread) >= width(independent) && width(spread) < 1.1 * width(independent));
        assert!(width(clumped) > 1.9 * width(independent));
        // One reply a cluster is Wilson's own; empty clusters are none.
        let single = [vec![(1, 1); 15], vec![(0, 1); 133], vec![(0, 0); 9]].concat();
        assert_eq!(
            Estimate::clustered(&counts(&single)),
            Estimate::share(15, 148)
        );
        // Nothing went wrong: less sure than as many independent replies.
        let (all, alone) = (share(&[(4, 4); 20]), Estimate::share(80, 80).unwrap());
        assert!(all.low < alone.low && all.low > 0.85, "{all:?}");
        assert_eq!(Estimate::clustered(&[]), None);
    }
}
