//! Intervals of differences, of one model and of six together.

use super::*;
use darkqa_score::comparisons::paired::difference;

/// Share of right replies that a change makes wrong, and of wrong ones that it makes right.
const LOST: f64 = 0.08;
const GAINED: f64 = 0.05;

/// A change of conditions for a number of models, which share the rates of the cluster.
fn change(random: &mut StdRng, design: &Design, models: u32) -> [Option<bool>; 1] {
    let truth = GAINED * (1.0 - design.mean) - LOST * design.mean;
    let mut squares = 0.0;
    let sums = design.clusters(random, |random, size| {
        let rate = design.rate(random);
        let [lost, gained] = [LOST, GAINED].map(|mean| design.rate_about(random, mean));
        let mut item = || {
            let right = binomial(random, models, rate);
            let lost = binomial(random, right, lost);
            let gained = binomial(random, models - right, gained);
            let net = (f64::from(gained) - f64::from(lost)) / f64::from(models);
            squares += net * net;
            net
        };
        let net: f64 = (0..size).map(|_| item()).sum();
        (net, f64::from(size))
    });
    let n = sums.iter().map(|(_, n)| n).sum::<f64>() as usize;
    [Some(holds(difference(&sums, squares, n), truth))]
}

pub(super) fn paired(random: &mut StdRng, design: &Design, _: &Resamples) -> [Option<bool>; 1] {
    change(random, design, 1)
}

pub(super) fn of_six(random: &mut StdRng, design: &Design, _: &Resamples) -> [Option<bool>; 1] {
    change(random, design, 6)
}

#[test]
#[ignore = "takes a minute; prints a table of src/docs/numbers.md"]
fn the_coverage_of_paired_differences() {
    EVEN.print(["paired difference"], paired, 1000);
}

#[test]
#[ignore = "takes a minute; prints a table of src/docs/numbers.md"]
fn coverage_of_differences_of_six_models() {
    EVEN.print(["difference of 6 models together"], of_six, 1000);
}

#[test]
fn undetected_differences_are_not_excluded() {
    // Most runs of so few clusters lose nothing, or all of it in one cluster.
    let design = Design { clusters: 8, size: 6, shape: Shape::Even, mean: 0.9, correlation: 0.4 };
    let held = coverage(paired, &design, 2000)[0].unwrap();
    // 82 % if the two added pairs count as independent ones.
    assert!(held > 94.0, "{held}");
}
