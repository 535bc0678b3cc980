//! Agreement of the ranks of models.

#![expect(clippy::print_stdout, reason = "the long tests print coverages")]

use rand::rngs::StdRng;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::{Distribution as _, StandardNormal};

use super::{holds, reply};
use crate::estimate::Estimate;
use crate::variation::{Facet, Observation, rank_agreement};

const MODELS: usize = 4;
const WORDINGS: u16 = 3;

fn agreement(models: &[Vec<Observation>]) -> Option<Estimate> {
    let models: Vec<&[Observation]> = models.iter().map(Vec::as_slice).collect();
    rank_agreement(&models, Facet::Wording)
}

/// Models with these accuracies under each wording.
fn exact(accuracies: &[&[f64]]) -> Vec<Vec<Observation>> {
    let model = |accuracies: &&[f64]| {
        let replies = accuracies.iter().zip(0..).flat_map(|(accuracy, wording)| {
            (0..10).map(move |question| {
                reply(question, [wording, 0, 0], f64::from(u8::from(f64::from(question) + 0.5 < 10.0 * accuracy)))
            })
        });
        replies.collect()
    };
    accuracies.iter().map(model).collect()
}

#[test]
fn kendalls_w_is_that_of_the_ranks() {
    let same = agreement(&exact(&[&[0.2, 0.3, 0.1], &[0.5, 0.6, 0.4], &[0.9, 0.8, 1.0]])).unwrap();
    assert!((same.value - 1.0).abs() < 1e-12 && (same.high - 1.0).abs() < 1e-12);
    // Each model is first, second and third once.
    let none = agreement(&exact(&[&[0.1, 0.5, 0.9], &[0.5, 0.9, 0.1], &[0.9, 0.1, 0.5]])).unwrap();
    assert!(none.value.abs() < 1e-12);
    // Ranks 1, 2.5, 2.5, 4 and 1.5, 1.5, 3, 4: S = Σ (R − 5)² = 22.5, and without ties the denominator would be 20;
    // W = 12 · 22.5 / (2² (4³ − 4) − 2 (6 + 6)) = 1.25 − … of Siegel and Castellan's formula.
    let tied = agreement(&exact(&[&[0.1, 0.2], &[0.5, 0.2], &[0.5, 0.6], &[0.9, 0.9]])).unwrap();
    let deviations = [2.5 - 5.0, 4.0 - 5.0, 5.5 - 5.0, 8.0 - 5.0_f64];
    let sum: f64 = deviations.iter().map(|deviation| deviation * deviation).sum();
    assert!((tied.value - 12.0 * sum / (4.0 * 60.0 - 2.0 * 12.0)).abs() < 1e-12, "{tied:?}");
    // One wording has no other to agree with, and tied models no ranks.
    assert_eq!(agreement(&exact(&[&[0.2], &[0.5]])), None);
    assert_eq!(agreement(&exact(&[&[0.5, 0.5], &[0.5, 0.5]])), None);
}

/// Models whose accuracies are `gap` apart, and differ between the wordings by chance with a standard deviation of
/// `spread`, with the true W.
fn simulated(seed: u64, scenes: u32, gap: f64, spread: f64) -> (Vec<Vec<Observation>>, f64) {
    let mut random = StdRng::seed_from_u64(seed);
    let normal = |random: &mut StdRng| -> f64 { StandardNormal.sample(random) };
    let accuracies: Vec<Vec<f64>> = (0..MODELS)
        .map(|model| (0..WORDINGS).map(|_| 0.5 + gap * model as f64 + spread * normal(&mut random)).collect())
        .collect();
    let exact: Vec<Vec<Observation>> = accuracies
        .iter()
        .map(|model| model.iter().zip(0..).map(|(accuracy, wording)| reply(0, [wording, 0, 0], *accuracy)).collect())
        .collect();
    let mut models = vec![Vec::new(); MODELS];
    for question in 0..3 * scenes {
        let ease = 0.25 * normal(&mut random);
        for (replies, accuracies) in models.iter_mut().zip(&accuracies) {
            for cell in 0..3 * WORDINGS {
                let accuracy = accuracies[usize::from(cell / 3)] + ease;
                let is_right = random.random_range(0.0..1.0) < accuracy;
                let place = reply(question, [cell / 3, cell % 3, 0], f64::from(u8::from(is_right)));
                replies.push(Observation { scene: question % scenes, ..place });
            }
        }
    }
    (models, agreement(&exact).unwrap().value)
}

#[test]
fn intervals_of_w_hold_for_similar_models() {
    // Noise changes their ranks, though all wordings rank them alike.
    let runs = 20;
    let held = (0..runs).filter(|seed| {
        let (models, truth) = simulated(*seed, 20, 0.02, 0.0);
        holds(agreement(&models).unwrap(), truth)
    });
    assert!(held.count() as u64 >= runs - 1);
}

#[test]
#[ignore = "takes a minute; prints the coverage of Kendall's W"]
fn coverage_of_kendalls_w() {
    for scenes in [20, 60] {
        for (gap, spread) in [(0.05, 0.0), (0.02, 0.0), (0.1, 0.0), (0.05, 0.03), (0.05, 0.1), (0.0, 0.05)] {
            let runs = 300;
            let (mut held, mut width, mut bias, mut mean) = (0, 0.0, 0.0, 0.0);
            for seed in 0..runs {
                let (models, truth) = simulated(seed, scenes, gap, spread);
                let found = agreement(&models).unwrap();
                held += u32::from(holds(found, truth));
                width += (found.high - found.low) / runs as f64;
                bias += (found.value - truth) / runs as f64;
                mean += truth / runs as f64;
            }
            let held = 100.0 * f64::from(held) / runs as f64;
            println!(
                "{scenes} scenes, {gap} apart, {spread} between wordings: W {mean:.2}, bias {bias:+.2}, interval holds \
                 {held:.1} %, width {width:.2}"
            );
        }
    }
}
