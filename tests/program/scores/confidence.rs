//! Confidence and accuracy, held to simulated models whose calibration is known.
//!
//! Draws are fixed, so that no run of these tests differs from another.

#![expect(clippy::print_stdout, reason = "the measured rates, for whoever asks with --nocapture")]

use crate::support::made::record;
use darkqa_base::types::{Condition, OptionProbabilities, Record};
use darkqa_score::bootstrap::Resamples;
use darkqa_score::calibration::Calibration;
use darkqa_score::calibration::calibrations;
use darkqa_score::cluster::Clusters;
use darkqa_score::cluster::FrameTies;
use darkqa_score::estimate::Estimate;
use darkqa_score::grid::Grid;
use rand::rngs::StdRng;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::{Beta, Distribution as _};

/// Number of choices of every question.
const CHOICES: usize = 4;

/// How likely a model is right, from its confidence.
type Truth = fn(f64) -> f64;

fn calibrated(confidence: f64) -> f64 {
    confidence
}

/// Right 15 points less often than its confidence says, but never less than a guess.
fn overconfident(confidence: f64) -> f64 {
    (confidence - 0.15).max(0.25)
}

/// Right in six of ten whatever it says.
fn noise(_: f64) -> f64 {
    0.6
}

/// A reply of this confidence: the choice that it names is the true one, or another.
fn reply(condition: &Condition, place: (usize, usize), confidence: f64, right: bool) -> Record {
    let mut record = record("m", condition, place, right);
    let detail = &mut record.detail;
    detail.choices = (0..CHOICES).map(|index| format!("choice {index}")).collect();
    let rest = (1.0 - confidence) / (CHOICES - 1) as f64;
    let mut p = vec![rest; CHOICES];
    p[usize::from(!right)] = confidence;
    detail.options = Some(OptionProbabilities { p, mass: 1.0, bound: 0.0, token: "A".to_owned(), reasoned: false });
    record
}

/// The replies of a model to `size` questions about each of `frames` frames: confidences between a guess and 1.
fn replies(random: &mut StdRng, frames: usize, size: usize, truth: Truth) -> Vec<Record> {
    let confidences = Beta::new(2.0, 2.0).unwrap();
    let condition = Condition::raw(None);
    let mut records = Vec::new();
    for frame in 0..frames {
        for question in 0..size {
            let confidence = 0.25 + 0.75 * confidences.sample(random);
            let right = random.random_bool(truth(confidence));
            let place = (frame * 100 + question, frame);
            records.push(reply(&condition, place, confidence, right));
        }
    }
    records
}

fn of(records: &[Record], draws: &Resamples) -> Calibration {
    let asked = records.iter().map(|record| (&record.question, &record.detail.frame));
    let clusters = Clusters::new(asked, &FrameTies::default());
    let trials = records.iter().cloned().collect();
    let mut found = calibrations(&Grid::new(&trials, &clusters), draws);
    assert_eq!(found.len(), 1);
    found.remove(0)
}

/// Calibrations of `runs` simulated runs.
fn simulated(seed: u64, runs: usize, (frames, size): (usize, usize), truth: Truth) -> Vec<Calibration> {
    let mut random = StdRng::seed_from_u64(seed);
    let draws = Resamples::new(frames);
    (0..runs).map(|_| of(&replies(&mut random, frames, size, truth), &draws)).collect()
}

/// How often an interval holds a number, in percent.
fn held(found: &[Calibration], number: f64, of: fn(&Calibration) -> Option<Estimate>) -> f64 {
    let holds = |estimate: Estimate| (estimate.low..=estimate.high).contains(&number);
    let times = found.iter().filter_map(of).filter(|estimate| holds(*estimate));
    100.0 * times.count() as f64 / found.len() as f64
}

fn mean(found: &[Calibration], of: fn(&Calibration) -> f64) -> f64 {
    found.iter().map(of).sum::<f64>() / found.len() as f64
}

/// The error that is still found where there is none, by number of replies. Without the correction it would be 0.10 and
/// 0.087.
#[test]
fn perfect_model_is_calibrated() {
    for (frames, size, most) in [(25, 4, 0.045), (100, 4, 0.028)] {
        let found = simulated(3, 100, (frames, size), calibrated);
        let error = mean(&found, |row| row.error.unwrap().value);
        let (zero, gap) =
            (held(&found, 0.0, |row| row.error), held(&found, 0.0, |row| Some(row.overconfidence.difference)));
        println!("{} replies: error {error:.4}, 0 held {zero} %, gap {gap} %", frames * size);
        assert!(error < most, "{error}");
        assert!(zero >= 93.0, "{zero}");
        assert!((89.0..=100.0).contains(&gap), "{gap}");
    }
}

/// The truth of the simulated model by its definition, over many replies.
fn truth_of(number: impl Fn(f64) -> f64) -> f64 {
    let mut random = StdRng::seed_from_u64(5);
    let confidences = Beta::new(2.0, 2.0).unwrap();
    let times = 400_000;
    let sum: f64 = (0..times).map(|_| number(0.25 + 0.75 * confidences.sample(&mut random))).sum();
    sum / f64::from(times)
}

#[test]
fn intervals_hold_truth_of_overconfident_model() {
    let error = truth_of(|c| (c - overconfident(c)).powi(2)).sqrt();
    let gap = truth_of(|c| c - overconfident(c));
    let brier = truth_of(|c| {
        let (right, rest) = (overconfident(c), (1.0 - c) / 3.0);
        let squares = c * c + 3.0 * rest * rest;
        squares + 1.0 - 2.0 * (right * c + (1.0 - right) * rest)
    });
    for (frames, size) in [(48, 5), (100, 5)] {
        let found = simulated(4, 200, (frames, size), overconfident);
        let rates = [
            held(&found, error, |row| row.error),
            held(&found, gap, |row| Some(row.overconfidence.difference)),
            held(&found, 0.625, |row| Some(row.confidence)),
            held(&found, brier, |row| Some(row.brier)),
        ];
        let middle = mean(&found, |row| row.error.unwrap().value);
        println!("{frames} frames: error {error:.4}, found {middle:.4}; held {rates:?}");
        assert!((middle - error).abs() < 0.01, "{middle} for {error}");
        // Two hundred runs: give or take 3 %.
        for rate in rates {
            assert!((92.0..=99.0).contains(&rate), "{rates:?}");
        }
    }
}

/// A model whose confidence says nothing of its answers.
#[test]
fn confidence_that_is_noise_tells_nothing() {
    let found = simulated(6, 60, (120, 5), noise);
    let chance = held(&found, 0.5, |row| row.auroc.map(|auc| auc.estimate));
    println!("AUROC of 0.5 held {chance} %");
    assert!((88.0..=100.0).contains(&chance), "{chance}");
    for row in &found {
        // Leaving out the least confident replies helps nothing.
        assert!((row.risk.at_50 - row.risk.at_100).abs() < 0.12, "{:?}", row.risk);
    }
    // It is off by the spread of what it says: 0.17.
    let found_off = found.iter().filter(|row| row.error.unwrap().low > 0.0);
    assert!(found_off.count() >= 54);
    let error = mean(&found, |row| row.error.unwrap().value);
    let truth = truth_of(|c| (c - noise(c)).powi(2)).sqrt();
    assert!((error - truth).abs() < 0.015, "{error} for {truth}");
    // A calibrated one does better.
    let found = simulated(6, 20, (60, 5), calibrated);
    for row in &found {
        assert!(row.auroc.unwrap().estimate.low > 0.5);
        assert!(row.risk.at_50 < row.risk.at_100);
        assert!(row.skill.low > 0.0);
    }
}

#[test]
fn reasoning_replies_are_counted_apart() {
    let mut random = StdRng::seed_from_u64(7);
    let mut records = replies(&mut random, 30, 4, calibrated);
    for record in &mut records[..7] {
        record.detail.options.as_mut().unwrap().reasoned = true;
    }
    for record in &mut records[7..20] {
        record.detail.options = None;
    }
    let draws = Resamples::new(30);
    let found = of(&records, &draws);
    assert_eq!((found.replies, found.reasoned, found.unstated), (100, 7, 13));
    assert!(found.error.is_some());
    // One fewer, and the calibration error is not known.
    records.pop();
    assert!(of(&records, &draws).error.is_none());
}
