//! Intervals of thresholds and of areas.

use super::*;
use darkqa_base::types::{AxisLevel, Severity};
use darkqa_eval::Kind;
use darkqa_score::threshold::LevelCounts;

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
    let spread = std::f64::consts::PI.powi(2) / 3.0 * design.correlation / (1.0 - design.correlation);
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
    let area = segments.clone().map(|(d, m)| (d[1] - d[0]) * f64::midpoint(m[0], m[1])).sum::<f64>() / 9.0;
    let middle = f64::midpoint(means[0], CHANCE);
    let crossing = segments.into_iter().find(|(_, m)| m[1] <= middle);
    let threshold = crossing.map_or(f64::INFINITY, |(d, m)| d[0] + (m[0] - middle) / (m[0] - m[1]) * (d[1] - d[0]));
    (threshold, area)
}

fn level_counts(random: &mut StdRng, design: &Design) -> LevelCounts {
    let (mut counts, mut guesses) = (vec![Vec::new(); 6], Vec::new());
    design.clusters(random, |random, replies| {
        let luck: f64 = StandardNormal.sample(random);
        for (counts, rate) in counts.iter_mut().zip(curve(design, luck)) {
            let right = binomial(random, replies, rate);
            counts.push(ClusterCount { right, replies });
        }
        guesses.push(replies as f32 / 3.0);
    });
    LevelCounts { levels: levels(), counts, missing: vec![Vec::new(); 6], guesses, missing_guesses: Vec::new() }
}

/// The area and the threshold of one run.
pub(super) fn curve_of(random: &mut StdRng, design: &Design, draws: &Resamples) -> [Option<bool>; 2] {
    let Some(summary) = level_counts(random, design).summary(draws) else {
        return [None; 2];
    };
    let truth = true_curve(design);
    let threshold = summary.threshold.ok();
    [summary.area.map(|area| holds(area, truth.1)), threshold.map(|found| (found.low..=found.high).contains(&truth.0))]
}

#[test]
#[ignore = "takes minutes; prints a table of src/docs/numbers.md"]
fn the_coverage_of_areas_and_thresholds() {
    EVEN.print(["area", "threshold"], curve_of, 600);
}
