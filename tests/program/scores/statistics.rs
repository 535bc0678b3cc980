//! The statistics, held to simulated runs whose truth is known.
//!
//! Clusters have a right-rate of their own (beta with intraclass correlation ρ), so that their questions stand and fall
//! together. The bounds are those of the claim: 95 % intervals hold the truth 93 to 97.5 times in a hundred, and tests
//! reject what is true at most 5 times. Draws are fixed, so that no run of these tests differs from another.

#![allow(clippy::float_cmp)]
#![expect(clippy::print_stdout, reason = "the measured rates, for whoever asks with --nocapture")]

use std::fmt::Write as _;

use crate::support::made::record;
use crate::support::table::check_rows;
use darkqa_base::types::{
    AxisLevel, Condition, Degradation, EnhancerName, Family, ParsedAnswer, Record, Severity, Variant,
};
use darkqa_eval::Kind;
use darkqa_score::accuracies::curves;
use darkqa_score::bootstrap::Resamples;
use darkqa_score::choice::ParsingMode;
use darkqa_score::cluster::Clusters;
use darkqa_score::cluster::FrameTies;
use darkqa_score::comparisons::paired::PairedComparison;
use darkqa_score::estimate::ClusterCount;
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::grid::Grid;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::open::AnswerOutcome;
use darkqa_score::open::Baseline;
use darkqa_score::open::Group;
use darkqa_score::open::OpenSummary;
use darkqa_score::open::QuestionGroups;
use darkqa_score::open::ScoredAnswer;
use darkqa_score::open::open_summary;
use rand::rngs::StdRng;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::{Beta, Distribution as _};

/// The only model.
const MODEL: &str = "m";

/// The right-rate of a cluster about a mean, with an intraclass correlation.
fn rate(random: &mut StdRng, mean: f64, correlation: f64) -> f64 {
    if correlation == 0.0 || mean <= 0.0 || mean >= 1.0 {
        return mean;
    }
    let scale = (1.0 - correlation) / correlation;
    Beta::new(mean * scale, (1.0 - mean) * scale).unwrap().sample(random)
}

/// How often something holds, in percent.
fn percent(times: usize, mut holds: impl FnMut() -> bool) -> f64 {
    100.0 * (0..times).filter(|_| holds()).count() as f64 / times as f64
}

/// The untouched frame, or one with noise.
fn at(severity: Option<Severity>) -> Condition {
    let noisy = |severity| Degradation::new(Kind::Sensor, severity, None).unwrap();
    Condition::raw(severity.map(noisy))
}

fn clusters_of(records: &[Record]) -> Clusters {
    let asked = records.iter().map(|record| (&record.question, &record.detail.frame));
    Clusters::new(asked, &FrameTies::default())
}

/// Number of questions about each frame.
fn sizes(random: &mut StdRng, frames: usize, least: usize, most: usize) -> Vec<usize> {
    (0..frames).map(|_| random.random_range(least..=most)).collect()
}

#[test]
fn intervals_of_shares_hold_the_truth() {
    let mut random = StdRng::seed_from_u64(8);
    let (mut table, mut within) = (String::new(), true);
    let rows = [(24, 4, 12), (48, 2, 6), (200, 2, 6)];
    check_rows(rows, |(frames, least, most)| {
        for mean in [0.33, 0.6, 0.9] {
            for correlation in [0.0, 0.2] {
                let held = percent(4000, || {
                    let sizes = sizes(&mut random, frames, least, most);
                    let counts: Vec<ClusterCount> = sizes
                        .into_iter()
                        .map(|replies| {
                            let rate = rate(&mut random, mean, correlation);
                            let right = (0..replies).filter(|_| random.random_bool(rate)).count();
                            ClusterCount { right: right as u32, replies: replies as u32 }
                        })
                        .collect();
                    let estimate = Estimate::clustered(&counts).unwrap();
                    (estimate.low..=estimate.high).contains(&mean)
                });
                let _ = writeln!(table, "{frames} frames, p {mean}, ρ {correlation}: {held:.1} %");
                within &= (93.0..=97.5).contains(&held);
            }
        }
    });
    println!("{table}");
    assert!(within, "{table}");
}

/// Marks of good answers and of bad ones.
type Marks = ([i64; 4], [i64; 4]);

fn points(marks: [i64; 4]) -> f64 {
    marks.iter().map(|mark| (mark - 1) as f64 / 4.0).sum::<f64>() / 4.0
}

/// Open answers about walks on lit and on dark frames: good with a rate of the walk's own; in the dark three in ten are
/// bad in any case.
fn walks(random: &mut StdRng, walks: usize, (good, bad): Marks, mean: f64, rho: f64) -> OpenSummary {
    let (mut answers, mut topics) = (Vec::new(), Vec::new());
    for walk in 0..walks {
        let rate = rate(random, mean, rho);
        for _ in 0..random.random_range(5..=13) {
            let mut mark = |good_one: bool| {
                let marks = if good_one { good } else { bad };
                marks[random.random_range(0..4)]
            };
            let question = topics.len();
            let (lit, dark) = (mark(true), mark(false));
            let (is_good, kept) = (random.random_bool(rate), random.random_bool(0.7));
            let lit = if is_good { lit } else { bad[random.random_range(0..4)] };
            for (level, mark) in [(None, lit), (Some(Severity::L4), if kept { lit } else { dark })] {
                answers.push(ScoredAnswer {
                    subject: ModelInCondition::new(MODEL, Some(&at(level))),
                    question,
                    outcome: AnswerOutcome::Marked(mark),
                    cut: false,
                });
            }
            topics.push(QuestionGroups { episode: walk.to_string(), category: String::new(), split: String::new() });
        }
    }
    open_summary(&answers, &topics)
}

#[test]
fn intervals_of_open_scores_hold_truth() {
    // Give or take 2.2 %.
    const RUNS: usize = 400;
    let mut random = StdRng::seed_from_u64(11);
    let (mut table, mut within) = (String::new(), true);
    let polar = ([5; 4], [1; 4]);
    let graded = ([5, 5, 4, 3], [1, 1, 2, 3]);
    check_rows([("1 or 5", polar), ("1 to 5", graded)], |(name, marks)| {
        for count in [16, 32, 63] {
            for (mean, rho) in [(0.5, 0.0), (0.75, 0.1), (0.9, 0.1)] {
                let (good, bad) = (points(marks.0), points(marks.1));
                let truth = mean * good + (1.0 - mean) * bad;
                let drop = -0.3 * (truth - bad);
                let (mut scores, mut drops) = (0, 0);
                for _ in 0..RUNS {
                    let summary = walks(&mut random, count, marks, mean, rho);
                    let dark = ModelInCondition::new(MODEL, Some(&at(Some(Severity::L4))));
                    let lit = ModelInCondition::new(MODEL, Some(&at(None)));
                    let score = summary.cell(&lit, &Group::All).unwrap().score.unwrap();
                    let change = summary.change(&dark, Baseline::Clean, &Group::All).unwrap();
                    scores += usize::from((score.low..=score.high).contains(&truth));
                    let change = change.difference;
                    drops += usize::from((change.low..=change.high).contains(&drop));
                }
                let share = |held: usize| 100.0 * held as f64 / RUNS as f64;
                let (scores, drops) = (share(scores), share(drops));
                let _ = writeln!(
                    table,
                    "marks {name}, {count} walks, mean {mean}, ρ {rho}: score {scores:.1} %, drop {drops:.1} %"
                );
                // With few walks the intervals are wider, on purpose.
                within &= [scores, drops].iter().all(|held| (93.0..=99.0).contains(held));
            }
        }
    });
    println!("{table}");
    assert!(within, "{table}");
}

/// Two subjects on the same items, with these chances of (first alone, second alone) right in a cluster.
fn pair(random: &mut StdRng, sizes: &[usize], first: f64, second: f64, correlation: f64) -> Vec<Record> {
    let raw = at(Some(Severity::L3));
    let mut mended = raw.clone();
    mended.enhancer = Some(EnhancerName::new("e").unwrap());
    let mut records = Vec::new();
    for (frame, size) in sizes.iter().enumerate() {
        // Whether the two differ, and in whose favour, goes by the frame.
        let differ = rate(random, first + second, correlation);
        let favour = rate(random, first / (first + second), correlation);
        for question in 0..*size {
            let question = frame * 100 + question;
            let (a, b) = if random.random_bool(differ) {
                let first = random.random_bool(favour);
                (first, !first)
            } else {
                let both = random.random_bool(0.6);
                (both, both)
            };
            records.push(record(MODEL, &mended, (question, frame), a));
            records.push(record(MODEL, &raw, (question, frame), b));
        }
    }
    records
}

fn paired(records: &[Record]) -> PairedComparison {
    let clusters = clusters_of(records);
    let trials = records.iter().cloned().collect();
    let grid = Grid::new(&trials, &clusters);
    let raw = grid.subjects.iter().position(|s| s.enhancer.is_none()).unwrap();
    PairedComparison::new(&grid, 1 - raw, raw, None, ParsingMode::Strict).unwrap()
}

#[test]
fn intervals_of_differences_hold_the_truth() {
    let mut random = StdRng::seed_from_u64(9);
    let mut table = String::new();
    check_rows([(24, 4, 12), (48, 2, 6)], |(frames, least, most)| {
        for (first, second) in [(0.05, 0.05), (0.1, 0.02), (0.3, 0.1)] {
            for correlation in [0.0, 0.1] {
                let held = percent(400, || {
                    let sizes = sizes(&mut random, frames, least, most);
                    let records = pair(&mut random, &sizes, first, second, correlation);
                    let made = paired(&records).tested.difference;
                    (made.low..=made.high).contains(&(first - second))
                });
                let _ = writeln!(table, "{frames} frames, {first} − {second}, ρ {correlation}: {held:.1} %");
                // Four hundred runs: give or take 2.2 %. Where the difference is 0, the interval is never without it
                // while the exact test of few changed answers does not reject.
                let most = if first > second { 98.0 } else { 99.5 };
                assert!((92.5..=most).contains(&held), "{table}");
            }
        }
    });
    println!("{table}");
}

#[test]
fn tests_keep_size_and_power() {
    let mut random = StdRng::seed_from_u64(10);
    let mut rejected = |first: f64, second: f64, correlation: f64| {
        let (mut swapped, mut plain) = (0, 0);
        for _ in 0..1000 {
            let sizes = sizes(&mut random, 48, 2, 6);
            let records = pair(&mut random, &sizes, first, second, correlation);
            let paired = paired(&records);
            swapped += usize::from(paired.tested.p < 0.05);
            plain += usize::from(paired.mcnemar < 0.05);
        }
        (swapped, plain)
    };
    let independent = rejected(0.1, 0.1, 0.0);
    let together = rejected(0.1, 0.1, 0.4);
    let real = rejected(0.2, 0.05, 0.0);
    println!("of 1000, by swaps and by McNemar: independent {independent:?}, together {together:?}, real {real:?}");
    // Give or take 1.4 %.
    assert!(independent.0 <= 64 && independent.1 <= 64, "{independent:?}");
    assert!(together.0 <= 64, "{together:?}");
    assert!(together.1 > 80, "McNemar's test does not hold here, or this tests nothing: {together:?}");
    assert!(real.0 > 900, "{real:?}");
}

/// The true accuracy at a drop: from 0.9 in the light to chance, half-way at 6.4 EV.
fn psychometric(drop: f64) -> f64 {
    1.0 / 3.0 + (0.9 - 1.0 / 3.0) / (1.0 + ((drop - 6.4) / 0.8).exp())
}

#[test]
fn thresholds_are_recovered() {
    let mut random = StdRng::seed_from_u64(11);
    // What the estimator aims at: the curve of straight lines between the levels.
    let levels = Severity::LADDER.map(|severity| AxisLevel::new(Kind::Sensor, severity));
    let drops: Vec<f64> = std::iter::once(AxisLevel::L0).chain(levels).map(AxisLevel::value).collect();
    let middle = f64::midpoint(psychometric(0.0), 1.0 / 3.0);
    let after = drops.iter().position(|drop| psychometric(*drop) < middle).unwrap();
    let (near, far) = (drops[after - 1], drops[after]);
    let (above, below) = (psychometric(near), psychometric(far));
    let truth = near + (above - middle) / (above - below) * (far - near);
    assert!((truth - 6.4).abs() < 0.1, "{truth}");
    let true_area = drops
        .windows(2)
        .map(|drop| {
            let mean = f64::midpoint(psychometric(drop[0]), psychometric(drop[1]));
            (drop[1] - drop[0]) * mean
        })
        .sum::<f64>()
        / 9.0;
    let (mut sum, mut areas, times) = (0.0, 0, 400);
    let held = percent(times, || {
        let sizes = sizes(&mut random, 60, 3, 7);
        let mut records = Vec::new();
        for (frame, size) in sizes.iter().enumerate() {
            let luck = rate(&mut random, 0.5, 0.1) - 0.5;
            for level in std::iter::once(None).chain(Severity::LADDER.map(Some)) {
                let condition = at(level);
                let drop = condition.level().value();
                let rate = (psychometric(drop) + 0.2 * luck).clamp(0.0, 1.0);
                for question in 0..*size {
                    let right = random.random_bool(rate);
                    records.push(record(MODEL, &condition, (frame * 100 + question, frame), right));
                }
            }
        }
        let clusters = clusters_of(&records);
        let trials = records.iter().cloned().collect();
        let grid = Grid::new(&trials, &clusters);
        let made = curves(&grid, &Resamples::new(clusters.count()), None, &[]);
        let threshold = made[0].summary.threshold.unwrap();
        sum += threshold.value;
        let area = made[0].summary.area.unwrap();
        areas += usize::from((area.low..=area.high).contains(&true_area));
        (threshold.low..=threshold.high).contains(&truth)
    });
    let mean = sum / times as f64;
    let areas = 100.0 * areas as f64 / times as f64;
    println!("true {truth:.3} EV, mean {mean:.3} EV, held {held:.1} %; areas held {areas:.1} %");
    assert!((92.0..=98.0).contains(&areas), "{areas}");
    assert!((mean - truth).abs() < 0.08, "{mean} instead of {truth}");
    assert!((92.0..=98.0).contains(&held), "{held}");
}

#[test]
fn made_set_gives_papers_arithmetic() {
    // Presence: of 4 truths "no" one is answered "yes"; of 5 truths "yes" three are answered "no", one cannot be read.
    // Colour: of 8 replies 6 are "black", of which 2 are true.
    let mut records = Vec::new();
    let mut add = |family: Family, choices: &[&str], truth: usize, chosen: Option<usize>| {
        let number = records.len();
        let mut made = record(MODEL, &at(None), (number, number), chosen == Some(truth));
        made.detail.family = family;
        made.detail.choices = choices.iter().map(|&text| text.to_owned()).collect();
        made.detail.truth = Some(truth);
        made.detail.strict = Some(ParsedAnswer { chosen, why: None });
        records.push(made);
    };
    for chosen in [0, 1, 1, 1] {
        add(Family::Presence, &["yes", "no"], 1, Some(chosen));
    }
    for chosen in [Some(0), Some(1), Some(1), Some(1), None] {
        add(Family::Presence, &["yes", "no"], 0, chosen);
    }
    for (truth, chosen) in [(0, 0), (0, 0), (1, 0), (1, 0), (2, 0), (2, 0), (1, 1), (2, 1)] {
        add(Family::Color, &["black", "red", "blue"], truth, Some(chosen));
    }
    let offers = records.iter().map(|record| darkqa_score::accuracies::OfferedChoices {
        family: record.detail.family.clone(),
        choices: record.detail.choices.len(),
        orders: 1,
    });
    let trials = records.iter().cloned().collect();
    let findings = Findings::new(&trials, &FrameTies::default(), offers.collect::<Vec<_>>(), &[]);
    let rates = &findings.hallucinations[0];
    assert_eq!(rates.false_positive.unwrap().value, 0.25);
    assert_eq!(rates.false_negative.unwrap().value, 0.6);
    let colours = findings.confusions.iter().find(|c| c.family == Family::Color).unwrap();
    let collapse = colours.collapse.as_ref().unwrap();
    assert_eq!((&*collapse.top, collapse.share.value, collapse.truth), ("black", 0.75, 0.25));
    assert!((collapse.entropy - 0.811_278_124_459_132_8).abs() < 1e-12);
    // Chance: 9 questions of two choices and 8 of three, 9/2 + 8/3 of 17, as a fraction 43/102.
    let chance = findings.summary.cells.iter().find(|cell| cell.subject.view.is_none() && cell.family.is_none());
    assert!((chance.unwrap().accuracy.unwrap().value - 43.0 / 102.0).abs() < 1e-15);
    assert_eq!(findings.grid.subjects[0].variant, Variant::NONE);
}
