//! Intervals of shares, of scores between 0 and 1, and of κ.

use super::*;
use darkqa_score::comparisons::{AgreementCounts, clustered_kappa};

pub(super) fn share(random: &mut StdRng, design: &Design, _: &Resamples) -> [Option<bool>; 1] {
    let counts = design.clusters(random, |random, replies| {
        let rate = design.rate(random);
        let right = binomial(random, replies, rate);
        ClusterCount { right, replies }
    });
    [Estimate::clustered(&counts).map(|share| holds(share, design.mean))]
}

/// Share of questions that are right in three independent repeats.
fn always(random: &mut StdRng, design: &Design, _: &Resamples) -> [Option<bool>; 1] {
    let truth = if design.correlation == 0.0 {
        design.mean.powi(3)
    } else {
        let scale = (1.0 - design.correlation) / design.correlation;
        let moment = |i: f64| (design.mean * scale + i) / (scale + i);
        moment(0.0) * moment(1.0) * moment(2.0)
    };
    let counts = design.clusters(random, |random, replies| {
        let rate = design.rate(random).powi(3);
        let right = binomial(random, replies, rate);
        ClusterCount { right, replies }
    });
    [Estimate::clustered(&counts).map(|share| holds(share, truth))]
}

/// Whether the interval of a score holds the truth.
fn score(sums: &[(f64, f64)], max_weight: f64, truth: f64) -> [Option<bool>; 1] {
    let n = sums.iter().map(|(_, n)| n).sum::<f64>() as usize;
    [Estimate::from_scores(sums, max_weight, n).map(|score| holds(score, truth))]
}

/// Scores between 0 and 1 that are not all 0 or 1, as expected scores are.
fn expected_score(random: &mut StdRng, design: &Design, _: &Resamples) -> [Option<bool>; 1] {
    let sums = design.clusters(random, |random, size| {
        let rate = design.rate(random).clamp(1e-6, 1.0 - 1e-6);
        let score = Beta::new(4.0 * rate, 4.0 * (1.0 - rate)).unwrap();
        let sum: f64 = (0..size).map(|_| score.sample(random)).sum();
        (sum, f64::from(size))
    });
    score(&sums, 1.0, design.mean)
}

/// Marks of good answers (5, 5, 4, 3) and of bad ones (1, 1, 2, 3).
fn llm_match(random: &mut StdRng, design: &Design, _: &Resamples) -> [Option<bool>; 1] {
    let points = |marks: [f64; 4]| marks.map(|mark| (mark - 1.0) / 4.0);
    let (good, bad) = (points([5.0, 5.0, 4.0, 3.0]), points([1.0, 1.0, 2.0, 3.0]));
    let mean = |points: [f64; 4]| points.iter().sum::<f64>() / 4.0;
    let truth = design.mean * mean(good) + (1.0 - design.mean) * mean(bad);
    let sums = design.clusters(random, |random, size| {
        let rate = design.rate(random);
        let mut mark = || {
            let marks = if random.random_bool(rate) { good } else { bad };
            marks[random.random_range(0..4)]
        };
        let sum: f64 = (0..size).map(|_| mark()).sum();
        (sum, f64::from(size))
    });
    score(&sums, 4.0, truth)
}

/// Two models that give the same answer to three in ten items, and else answer independently at the rate of the
/// cluster.
fn kappa(random: &mut StdRng, design: &Design, _: &Resamples) -> [Option<bool>; 1] {
    const SAME: f64 = 0.3;
    let (p, rho) = (design.mean, design.correlation);
    let both = SAME * p + (1.0 - SAME) * (p * p + rho * p * (1.0 - p));
    let chance = p * p + (1.0 - p) * (1.0 - p);
    let truth = (1.0 - 2.0 * (p - both) - chance) / (1.0 - chance);
    let counts = design.clusters(random, |random, size| {
        let rate = design.rate(random);
        let same = binomial(random, size, SAME);
        let both_same = binomial(random, same, rate);
        let first = binomial(random, size - same, rate);
        let both = binomial(random, first, rate);
        let second = both + binomial(random, size - same - first, rate);
        AgreementCounts {
            all: f64::from(size),
            both: f64::from(both_same + both),
            first: f64::from(both_same + first),
            second: f64::from(both_same + second),
        }
    });
    [clustered_kappa(&counts).map(|kappa| holds(kappa, truth))]
}

#[test]
#[ignore = "takes a minute; prints a table of src/docs/numbers.md"]
fn the_coverage_of_shares() {
    EVEN.print(["share"], share, 2000);
    EVEN.print(["share of questions right every time"], always, 2000);
}

#[test]
#[ignore = "takes a minute; prints a table of src/docs/numbers.md"]
fn the_coverage_of_scores() {
    EVEN.print(["score between 0 and 1"], expected_score, 600);
    EVEN.print(["LLM-Match score"], llm_match, 600);
}

#[test]
#[ignore = "takes a minute; prints a table of src/docs/numbers.md"]
fn the_coverage_of_kappa() {
    EVEN.print(["κ"], kappa, 2000);
}

#[test]
fn extreme_shares_are_covered_when_clumped() {
    let strong = |clusters, size| Design { clusters, size, shape: Shape::Even, mean: 0.98, correlation: 0.4 };
    for design in [strong(25, 8), strong(52, 20), strong(52, 180)] {
        // Half of the degrees of freedom by Satterthwaite give 91.7 % at the worst of 350 cells; C − 1 of them give 83
        // % here.
        let held = coverage(share, &design, 1500)[0].unwrap();
        assert!((91.0..=99.5).contains(&held), "{design:?}: {held}");
    }
}
