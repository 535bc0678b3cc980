//! How often each interval holds the truth, and how often the pooled test rejects, in simulated runs whose truth is known.
//!
//! The short tests run always. The long ones print the tables from which `src/docs/numbers.md` is written:
//! `cargo test --test program coverage:: -- --ignored --nocapture`. Draws are fixed, so that no run differs from another.

#![expect(
    clippy::print_stdout,
    reason = "the long tests print the tables of the documentation"
)]

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::support::made::record;
use darkqa_eval::Kind;
use darkqa_eval::internals::score::{
    AgreementCounts, ClusterCount, Clusters, Estimate, Grid, LevelCounts, PairedComparison,
    PooledKind, Resamples, Significance, clustered_kappa, difference, pooled,
};
use darkqa_eval::score::choice::ReadingMode;
use darkqa_eval::types::{AnswerReading, AxisLevel, Condition, Degradation, Record, Severity};
use rand::rngs::StdRng;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::{Beta, Binomial, Distribution as _, StandardNormal};
use rayon::prelude::*;

/// A simulated design: clusters of equal size, the true share, and the intraclass correlation.
#[derive(Debug, Clone, Copy)]
struct Design {
    clusters: usize,
    size: u32,
    mean: f64,
    correlation: f64,
}

impl Design {
    /// The right-rate of a cluster about a mean.
    fn rate_about(&self, random: &mut StdRng, mean: f64) -> f64 {
        if self.correlation == 0.0 {
            return mean;
        }
        let scale = (1.0 - self.correlation) / self.correlation;
        let beta = Beta::new(mean * scale, (1.0 - mean) * scale).unwrap();
        beta.sample(random).clamp(0.0, 1.0)
    }

    fn rate(&self, random: &mut StdRng) -> f64 {
        self.rate_about(random, self.mean)
    }

    fn clusters<T>(&self, mut of: impl FnMut() -> T) -> Vec<T> {
        (0..self.clusters).map(|_| of()).collect()
    }
}

fn binomial(random: &mut StdRng, n: u32, p: f64) -> u32 {
    Binomial::new(u64::from(n), p).unwrap().sample(random) as u32
}

fn holds(estimate: Estimate, truth: f64) -> bool {
    (estimate.low..=estimate.high).contains(&truth)
}

/// One simulated run: whether an interval holds the truth; `None` if the run has no interval.
type Simulation = fn(&mut StdRng, &Design, &Resamples) -> Option<bool>;

fn share(random: &mut StdRng, design: &Design, _: &Resamples) -> Option<bool> {
    let counts = design.clusters(|| {
        let rate = design.rate(random);
        let right = binomial(random, design.size, rate);
        ClusterCount {
            right,
            replies: design.size,
        }
    });
    Some(holds(Estimate::clustered(&counts)?, design.mean))
}

/// Share of questions that are right in three independent repeats.
fn always(random: &mut StdRng, design: &Design, _: &Resamples) -> Option<bool> {
    let truth = if design.correlation == 0.0 {
        design.mean.powi(3)
    } else {
        let scale = (1.0 - design.correlation) / design.correlation;
        let moment = |i: f64| (design.mean * scale + i) / (scale + i);
        moment(0.0) * moment(1.0) * moment(2.0)
    };
    let counts = design.clusters(|| {
        let rate = design.rate(random).powi(3);
        let right = binomial(random, design.size, rate);
        ClusterCount {
            right,
            replies: design.size,
        }
    });
    Some(holds(Estimate::clustered(&counts)?, truth))
}

/// Scores between 0 and 1 that are not all 0 or 1, as expected scores are.
fn expected_score(random: &mut StdRng, design: &Design, _: &Resamples) -> Option<bool> {
    let sums = design.clusters(|| {
        let rate = design.rate(random).clamp(1e-6, 1.0 - 1e-6);
        let score = Beta::new(4.0 * rate, 4.0 * (1.0 - rate)).unwrap();
        let sum: f64 = (0..design.size).map(|_| score.sample(random)).sum();
        (sum, f64::from(design.size))
    });
    let n = design.clusters * design.size as usize;
    Some(holds(Estimate::scored(&sums, 1.0, n)?, design.mean))
}

/// Marks of good answers (5, 5, 4, 3) and of bad ones (1, 1, 2, 3).
fn llm_match(random: &mut StdRng, design: &Design, _: &Resamples) -> Option<bool> {
    let points = |marks: [f64; 4]| marks.map(|mark| (mark - 1.0) / 4.0);
    let (good, bad) = (points([5.0, 5.0, 4.0, 3.0]), points([1.0, 1.0, 2.0, 3.0]));
    let mean = |points: [f64; 4]| points.iter().sum::<f64>() / 4.0;
    let truth = design.mean * mean(good) + (1.0 - design.mean) * mean(bad);
    let sums = design.clusters(|| {
        let rate = design.rate(random);
        let mut mark = || {
            let marks = if random.random_bool(rate) { good } else { bad };
            marks[random.random_range(0..4)]
        };
        let sum: f64 = (0..design.size).map(|_| mark()).sum();
        (sum, f64::from(design.size))
    });
    let n = design.clusters * design.size as usize;
    Some(holds(Estimate::scored(&sums, 4.0, n)?, truth))
}

/// Share of right replies that a change makes wrong, and of wrong ones that it makes right.
const LOST: f64 = 0.08;
const GAINED: f64 = 0.05;

/// A change of conditions for a number of models, which share the rates of the cluster.
#[expect(
    clippy::unnecessary_wraps,
    reason = "other simulations may have no interval"
)]
fn change(random: &mut StdRng, design: &Design, models: u32) -> Option<bool> {
    let truth = GAINED * (1.0 - design.mean) - LOST * design.mean;
    let mut squares = 0.0;
    let sums = design.clusters(|| {
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
        let net: f64 = (0..design.size).map(|_| item()).sum();
        (net, f64::from(design.size))
    });
    let n = design.clusters * design.size as usize;
    Some(holds(difference(&sums, squares, n), truth))
}

fn paired_difference(random: &mut StdRng, design: &Design, _: &Resamples) -> Option<bool> {
    change(random, design, 1)
}

fn pooled_difference(random: &mut StdRng, design: &Design, _: &Resamples) -> Option<bool> {
    change(random, design, 6)
}

/// Two models that give the same answer to three in ten items, and else answer independently at the rate of the cluster.
fn kappa(random: &mut StdRng, design: &Design, _: &Resamples) -> Option<bool> {
    const SAME: f64 = 0.3;
    let (p, rho) = (design.mean, design.correlation);
    let both = SAME * p + (1.0 - SAME) * (p * p + rho * p * (1.0 - p));
    let chance = p * p + (1.0 - p) * (1.0 - p);
    let truth = (1.0 - 2.0 * (p - both) - chance) / (1.0 - chance);
    let counts = design.clusters(|| {
        let rate = design.rate(random);
        let same = binomial(random, design.size, SAME);
        let both_same = binomial(random, same, rate);
        let first = binomial(random, design.size - same, rate);
        let both = binomial(random, first, rate);
        let second = both + binomial(random, design.size - same - first, rate);
        AgreementCounts {
            all: f64::from(design.size),
            both: f64::from(both_same + both),
            first: f64::from(both_same + first),
            second: f64::from(both_same + second),
        }
    });
    Some(holds(clustered_kappa(&counts)?, truth))
}

/// Guessing among three choices.
const CHANCE: f64 = 1.0 / 3.0;

/// L0 and the levels of the paper.
fn levels() -> Vec<AxisLevel> {
    let dark = Severity::LADDER.map(|severity| AxisLevel::new(Kind::Sensor, severity));
    std::iter::once(AxisLevel::L0).chain(dark).collect()
}

/// Right-rate of a cluster at each level, from its luck in standard deviations: half-way to chance at 6.4 EV.
fn curve(design: &Design, luck: f64) -> Vec<f64> {
    // The intraclass correlation of logits, whose own variance is π² / 3.
    let spread =
        std::f64::consts::PI.powi(2) / 3.0 * design.correlation / (1.0 - design.correlation);
    let rate = |level: AxisLevel| {
        let p = CHANCE + (design.mean - CHANCE) / (1.0 + ((level.value() - 6.4) / 0.8).exp());
        let logit = (p / (1.0 - p)).ln() + spread.sqrt() * luck;
        1.0 / (1.0 + (-logit).exp())
    };
    levels().into_iter().map(rate).collect()
}

/// True threshold and area of the curve of straight lines between the levels.
fn true_curve(design: &Design) -> (f64, f64) {
    let mut means = [0.0; 6];
    let mut weights = 0.0;
    for step in -600_i32..=600 {
        let luck = f64::from(step) / 100.0;
        let weight = (-luck * luck / 2.0).exp();
        weights += weight;
        for (mean, rate) in means.iter_mut().zip(curve(design, luck)) {
            *mean += weight * rate;
        }
    }
    for mean in &mut means {
        *mean /= weights;
    }
    let drops: Vec<f64> = levels().into_iter().map(AxisLevel::value).collect();
    let segments = drops.windows(2).zip(means.windows(2));
    let area = segments
        .clone()
        .map(|(d, m)| (d[1] - d[0]) * f64::midpoint(m[0], m[1]))
        .sum::<f64>()
        / 9.0;
    let middle = f64::midpoint(means[0], CHANCE);
    let crossing = segments.into_iter().find(|(_, m)| m[1] <= middle);
    let threshold = crossing.map_or(f64::INFINITY, |(d, m)| {
        d[0] + (m[0] - middle) / (m[0] - m[1]) * (d[1] - d[0])
    });
    (threshold, area)
}

fn level_counts(random: &mut StdRng, design: &Design) -> LevelCounts {
    let blank = ClusterCount {
        right: 0,
        replies: design.size,
    };
    let mut counts = vec![vec![blank; design.clusters]; 6];
    for cluster in 0..design.clusters {
        let luck: f64 = StandardNormal.sample(random);
        for (counts, rate) in counts.iter_mut().zip(curve(design, luck)) {
            counts[cluster].right = binomial(random, design.size, rate);
        }
    }
    LevelCounts {
        levels: levels(),
        counts,
        guesses: vec![design.size as f32 / 3.0; design.clusters],
    }
}

fn area(random: &mut StdRng, design: &Design, draws: &Resamples) -> Option<bool> {
    let summary = level_counts(random, design).summary(draws)?;
    Some(holds(summary.area?, true_curve(design).1))
}

fn threshold(random: &mut StdRng, design: &Design, draws: &Resamples) -> Option<bool> {
    let threshold = level_counts(random, design)
        .summary(draws)?
        .threshold
        .ok()?;
    Some((threshold.low..=threshold.high).contains(&true_curve(design).0))
}

const SIZES: [(usize, u32); 5] = [(8, 6), (12, 12), (25, 8), (52, 20), (52, 180)];
const MEANS: [f64; 4] = [0.5, 0.75, 0.9, 0.98];
const CORRELATIONS: [f64; 4] = [0.0, 0.1, 0.2, 0.4];

/// How often an interval holds the truth in a design, in percent; `None` if fewer than half of the runs have the interval.
fn coverage(simulate: Simulation, design: &Design, runs: usize) -> Option<f64> {
    let seed = (design.clusters as u64) << 40
        | u64::from(design.size) << 24
        | ((1000.0 * design.mean) as u64) << 12
        | (1000.0 * design.correlation) as u64;
    let mut random = StdRng::seed_from_u64(seed);
    let draws = Resamples::new(design.clusters);
    let outcomes = (0..runs).filter_map(|_| simulate(&mut random, design, &draws));
    let outcomes: Vec<bool> = outcomes.collect();
    let held = outcomes.iter().filter(|held| **held).count();
    (2 * outcomes.len() > runs).then(|| 100.0 * held as f64 / outcomes.len() as f64)
}

/// The coverage of an interval in every design.
fn grid(simulate: Simulation, runs: usize) -> Vec<(Design, f64)> {
    let mut designs = Vec::new();
    for (clusters, size) in SIZES {
        for correlation in CORRELATIONS {
            designs.extend(MEANS.map(|mean| Design {
                clusters,
                size,
                mean,
                correlation,
            }));
        }
    }
    let designs = designs.into_par_iter();
    let covered = designs.filter_map(|design| Some((design, coverage(simulate, &design, runs)?)));
    covered.collect()
}

#[test]
#[ignore = "takes minutes; prints the tables of src/docs/numbers.md"]
fn the_coverage_of_every_interval() {
    let simulations: [(&str, Simulation, usize); 9] = [
        ("share", share, 2000),
        ("right every time", always, 2000),
        ("expected score", expected_score, 600),
        ("LLM-Match score", llm_match, 600),
        ("paired difference", paired_difference, 1000),
        ("pooled difference, 6 models", pooled_difference, 1000),
        ("area", area, 600),
        ("threshold", threshold, 600),
        ("κ", kappa, 2000),
    ];
    let (mut summary, mut details) = (String::new(), String::new());
    for (name, simulate, runs) in simulations {
        let cells = grid(simulate, runs);
        let mut sorted: Vec<f64> = cells.iter().map(|(_, held)| *held).collect();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let mean = sorted.iter().sum::<f64>() / n as f64;
        let low = sorted.iter().filter(|held| **held < 93.0).count();
        let fifth = sorted[n / 20];
        let _ = writeln!(
            summary,
            "| {name} | {n} × {runs} | {mean:.1} | {:.1} | {fifth:.1} | {low} |",
            sorted[0]
        );
        for (clusters, size) in SIZES {
            let _ = write!(details, "| {name} | {clusters} × {size} |");
            for correlation in CORRELATIONS {
                let at = MEANS.map(|mean| {
                    let cell = cells.iter().find(|(design, _)| {
                        (design.clusters, design.size) == (clusters, size)
                            && design.correlation.to_bits() == correlation.to_bits()
                            && design.mean.to_bits() == mean.to_bits()
                    });
                    cell.map_or("–".to_owned(), |(_, held)| format!("{held:.0}"))
                });
                let _ = write!(details, " {} |", at.join(" "));
            }
            details += "\n";
        }
        println!("{name} done");
    }
    println!(
        "\n| interval | cells × runs | mean | least | 5th percentile | cells < 93 |\n|---|---|---|---|---|---|\n{summary}"
    );
    println!(
        "Each cell: p {MEANS:?}\n\n| interval | clusters × size | ICC 0 | 0.1 | 0.2 | 0.4 |\n|---|---|---|---|---|---|\n{details}"
    );
}

/// How often the pooled test and the interval are right, in percent of the runs.
#[derive(Debug, Default)]
struct PooledRates {
    /// Share of runs in which the pooled test rejects at p < 0.05.
    rejected: f64,
    /// The same for the test of one model.
    rejected_by_one: f64,
    /// Share of runs in which the interval holds the truth.
    held: f64,
}

/// Six models in the same clusters, on items of different difficulty. In the dark each model is right less often by `effect`, and
/// each condition has a scene effect with a standard deviation in logits.
fn pooled_rates(
    clusters: usize,
    size: usize,
    scene_effect: f64,
    effect: f64,
    runs: usize,
) -> PooledRates {
    const MODELS: usize = 6;
    let noisy = |kind| Condition::raw(Some(Degradation::new(kind, Severity::L3, None).unwrap()));
    let conditions = [noisy(Kind::Sensor), noisy(Kind::Exposure)];
    let mut records: Vec<Record> = Vec::new();
    for model in 0..MODELS {
        for condition in &conditions {
            for item in 0..clusters * size {
                let place = (item, item / size);
                records.push(record(&format!("m{model}"), condition, place, true));
            }
        }
    }
    let asked = records
        .iter()
        .map(|record| (&record.question, &record.detail.frame));
    let units = Clusters::new(asked, &BTreeMap::new());
    let mut random = StdRng::seed_from_u64(
        clusters as u64
            + 1000 * (100.0 * scene_effect) as u64
            + 1_000_000 * (100.0 * effect) as u64,
    );
    let mut rates = PooledRates::default();
    for _ in 0..runs {
        answer(
            &mut random,
            &mut records,
            (clusters, size),
            scene_effect,
            effect,
        );
        let grid = Grid::new(&records, &units);
        let findings = pooled(&grid);
        let all = |finding: &&_| {
            let finding: &darkqa_eval::internals::score::PooledFinding = finding;
            finding.kind == PooledKind::Noise && finding.family.is_none()
        };
        let finding = findings.iter().find(all).unwrap();
        // The subjects are sorted: exposure drop of the first model, then its noise.
        let one = PairedComparison::new(&grid, 1, 0, None, ReadingMode::Strict).unwrap();
        rates.rejected += f64::from(u8::from(finding.p < 0.05));
        rates.rejected_by_one += f64::from(u8::from(one.p < 0.05));
        rates.held += f64::from(u8::from(holds(finding.difference, -effect)));
        assert_eq!(finding.verdict.is_shown(), finding.p < 0.05);
        assert_ne!(finding.verdict, Significance::TooFewClusters);
    }
    let percent = 100.0 / runs as f64;
    for rate in [
        &mut rates.rejected,
        &mut rates.rejected_by_one,
        &mut rates.held,
    ] {
        *rate *= percent;
    }
    rates
}

/// Replaces the answers of all records; those of noise come first for each model.
fn answer(
    random: &mut StdRng,
    records: &mut [Record],
    (clusters, size): (usize, usize),
    scene_effect: f64,
    effect: f64,
) {
    let items = clusters * size;
    let mut normal = |spread: f64| {
        let drawn: f64 = StandardNormal.sample(random);
        spread * drawn
    };
    let shifts: Vec<[f64; 2]> = (0..clusters)
        .map(|_| [normal(scene_effect), normal(scene_effect)])
        .collect();
    let scenes: Vec<f64> = (0..clusters).map(|_| normal(0.5)).collect();
    let difficulties: Vec<f64> = (0..items).map(|_| normal(0.8)).collect();
    for (index, record) in records.iter_mut().enumerate() {
        let (item, side) = (index % items, index / items % 2);
        let logit = 1.0 + scenes[item / size] + difficulties[item] + shifts[item / size][side];
        let p = 1.0 / (1.0 + (-logit).exp()) - if side == 0 { effect } else { 0.0 };
        let right = random.random_bool(p.clamp(0.0, 1.0));
        let chosen = Some(usize::from(!right));
        record.detail.strict = Some(AnswerReading { chosen, why: None });
    }
}

#[test]
#[ignore = "takes minutes; prints a table of src/docs/numbers.md"]
fn the_size_and_power_of_the_pooled_test() {
    println!(
        "\n| clusters × questions | scene effect in logits | effect in points | rejected, 6 models pooled | rejected, one model | interval holds the truth |\n|---|---|---|---|---|---|"
    );
    let mut designs = Vec::new();
    for (clusters, size) in [(8, 12), (25, 8), (64, 18)] {
        for scene_effect in [0.0, 0.5] {
            designs.extend([0.0, 0.06].map(|effect| (clusters, size, scene_effect, effect)));
        }
    }
    let rates: Vec<(_, PooledRates)> = designs
        .into_par_iter()
        .map(|(clusters, size, scene_effect, effect)| {
            let rates = pooled_rates(clusters, size, scene_effect, effect, 1000);
            ((clusters, size, scene_effect, effect), rates)
        })
        .collect();
    for ((clusters, size, scene_effect, effect), rates) in rates {
        println!(
            "| {clusters} × {size} | {scene_effect} | {:.0} | {:.1} | {:.1} | {:.1} |",
            100.0 * effect,
            rates.rejected,
            rates.rejected_by_one,
            rates.held
        );
    }
}

#[test]
fn the_pooled_test_keeps_its_size_and_finds_more_than_one_model() {
    let none = pooled_rates(25, 8, 0.5, 0.0, 250);
    // 5 %, give or take 2.8 % (two standard errors).
    assert!(none.rejected < 7.8 && none.held > 92.0, "{none:?}");
    let real = pooled_rates(25, 8, 0.0, 0.06, 100);
    assert!(
        real.rejected > 75.0 && real.rejected_by_one < 45.0,
        "{real:?}"
    );
}

#[test]
fn intervals_near_all_right_hold_the_truth_under_strong_clumps() {
    let strong = |clusters, size| Design {
        clusters,
        size,
        mean: 0.98,
        correlation: 0.4,
    };
    for design in [strong(25, 8), strong(52, 20), strong(52, 180)] {
        // Half of the degrees of freedom by Satterthwaite give 91.7 % at the worst of 350 cells; C − 1 of them give 83 % here.
        let held = coverage(share, &design, 1500).unwrap();
        assert!((91.0..=99.5).contains(&held), "{design:?}: {held}");
    }
}
