//! Simulated replies with known components.
//!
//! A reply is right if a normal number is above a threshold. The number is a sum of independent effects of scene,
//! question, wording and so on, each with a share of a variance of 1. The components of accuracy follow from the
//! probability that two replies which share some effects are both right.

use std::collections::BTreeMap;

use rand::rngs::StdRng;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::{Distribution as _, StandardNormal};
use statrs::distribution::{ContinuousCDF as _, Normal};

use crate::variation::{Design, Observation, Source, random_half};

/// A model whose variance is shared out among the sources, given in the order of [`Source::ALL`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Simulation {
    pub(super) name: &'static str,
    pub(super) design: Design,
    /// Probability that a reply is missing.
    pub(super) missing: f64,
    /// Accuracy of each side.
    pub(super) accuracies: [f64; 2],
    /// Variance of the effects that both sides share, by source.
    pub(super) common: [f64; 10],
    /// Variance of the effects of each side alone, by source. Common and own variances sum to 1.
    pub(super) own: [f64; 10],
}

impl Simulation {
    fn thresholds(&self) -> [f64; 2] {
        self.accuracies.map(|accuracy| Normal::standard().inverse_cdf(accuracy))
    }

    /// Covariance of two replies of sides `a` and `b` that share the effects of some sources.
    fn covariance(&self, a: usize, b: usize, shared: [bool; 10]) -> f64 {
        let correlation: f64 = (0..10)
            .filter(|source| shared[*source])
            .map(|source| self.common[source] + if a == b { self.own[source] } else { 0.0 })
            .sum();
        // P(both right) minus the product is the integral of the bivariate density over the correlation (Plackett 1954,
        // Biometrika 41:351); by Simpson's rule over its arc sine.
        let (h, k) = (self.thresholds()[a], self.thresholds()[b]);
        let density = |angle: f64| (-(h * h + k * k - 2.0 * h * k * angle.sin()) / (2.0 * angle.cos().powi(2))).exp();
        let (end, steps) = (correlation.min(1.0 - 1e-12).asin(), 200);
        let step = end / f64::from(steps);
        let sum: f64 = (0..=steps)
            .map(|i| {
                let weight = if i == 0 || i == steps {
                    1.0
                } else if i % 2 == 1 {
                    4.0
                } else {
                    2.0
                };
                weight * density(step * f64::from(i))
            })
            .sum();
        sum * step / 3.0 / std::f64::consts::TAU
    }

    /// True standard deviations by source, of the replies of the first side or of the differences.
    pub(super) fn truth(&self, is_difference: bool) -> [f64; 10] {
        let covariance = |shared| {
            if is_difference {
                self.covariance(0, 0, shared) + self.covariance(1, 1, shared) - 2.0 * self.covariance(0, 1, shared)
            } else {
                self.covariance(0, 0, shared)
            }
        };
        let shared = |sources: [u8; 10]| sources.map(|is_shared| is_shared > 0);
        let scene = covariance(shared([1, 0, 0, 0, 0, 0, 0, 0, 0, 0]));
        let same_question = covariance(shared([1, 1, 0, 0, 0, 0, 0, 0, 0, 0]));
        let wording = covariance(shared([0, 0, 1, 0, 0, 0, 0, 0, 0, 0]));
        let order = covariance(shared([0, 0, 0, 1, 0, 0, 0, 0, 0, 0]));
        let draw = covariance(shared([0, 0, 0, 0, 1, 0, 0, 0, 0, 0]));
        let with_wording = covariance(shared([1, 1, 1, 0, 0, 1, 0, 0, 0, 0])) - same_question - wording;
        let with_order = covariance(shared([1, 1, 0, 1, 0, 0, 1, 0, 0, 0])) - same_question - order;
        let with_draw = covariance(shared([1, 1, 0, 0, 1, 0, 0, 1, 0, 0])) - same_question - draw;
        let known = same_question + wording + order + draw + with_wording + with_order + with_draw;
        let same_request = covariance(shared([1, 1, 1, 1, 1, 1, 1, 1, 1, 0]));
        let all = covariance([true; 10]);
        let [combination, rest] =
            if self.design.repeats > 1 { [same_request - known, all - same_request] } else { [0.0, all - known] };
        let question = same_question - scene;
        [scene, question, wording, order, draw, with_wording, with_order, with_draw, combination, rest]
            .map(|variance: f64| variance.max(0.0).sqrt())
    }

    /// Simulated replies of both sides, and the true range of each facet on the first side.
    pub(super) fn replies(&self, seed: u64) -> ([Vec<Observation>; 2], [f64; 3]) {
        let mut random = StdRng::seed_from_u64(seed);
        let design = &self.design;
        let mut effects = Effects { simulation: self, drawn: BTreeMap::new() };
        let mut sides = [Vec::new(), Vec::new()];
        let thresholds = self.thresholds();
        let mut all: Vec<[u16; 3]> = Vec::new();
        for wording in 0..design.wordings as u16 {
            for order in 0..design.orders as u16 {
                all.extend((0..design.draws as u16).map(|draw| [wording, order, draw]));
            }
        }
        let levels = [design.wordings, design.orders, design.draws];
        for question in 0..design.questions as u32 {
            let scene = question % design.scenes as u32;
            let half = design.is_half.then(|| random_half(levels, &format!("{seed} {question}")));
            for &[wording, order, draw] in half.as_ref().unwrap_or(&all) {
                for repeat in 0..design.repeats as u16 {
                    let place = Observation { question, scene, wording, order, draw, repeat, value: 0.0 };
                    for (side, observations) in sides.iter_mut().enumerate() {
                        let number = thresholds[side] + effects.sum(&place, side, &mut random);
                        if !random.random_bool(self.missing) {
                            observations.push(Observation { value: f64::from(u8::from(number > 0.0)), ..place });
                        }
                    }
                }
            }
        }
        let ranges = effects.ranges(&all, &mut random);
        (sides, ranges)
    }
}

/// Effects that were drawn, by source, place and side; side 2 has the common ones.
struct Effects<'s> {
    simulation: &'s Simulation,
    drawn: BTreeMap<(usize, u32, [u16; 4], usize), f64>,
}

impl Effects<'_> {
    fn effect(&mut self, source: usize, place: &Observation, side: usize, random: &mut StdRng) -> f64 {
        let Observation { question, scene, wording, order, draw, repeat, .. } = *place;
        let (group, levels) = match Source::ALL[source] {
            Source::Scene => (scene, [0; 4]),
            Source::Question => (question, [0; 4]),
            Source::Facet(facet) => (0, [place.level(facet), 0, 0, 0]),
            Source::QuestionFacet(facet) => (question, [place.level(facet), 0, 0, 0]),
            Source::Combination => (question, [wording, order, draw, 0]),
            Source::Rest => (question, [wording, order, draw, repeat]),
        };
        let simulation = self.simulation;
        let variance = if side == 2 { simulation.common[source] } else { simulation.own[source] };
        if variance == 0.0 {
            return 0.0;
        }
        *self.drawn.entry((source, group, levels, side)).or_insert_with(|| {
            let number: f64 = StandardNormal.sample(random);
            number * variance.sqrt()
        })
    }

    fn sum(&mut self, place: &Observation, side: usize, random: &mut StdRng) -> f64 {
        (0..10).map(|source| self.effect(source, place, side, random) + self.effect(source, place, 2, random)).sum()
    }

    /// Range of the mean accuracy under the levels of each facet, over all scenes, under the drawn levels.
    fn ranges(&mut self, combinations: &[[u16; 3]], random: &mut StdRng) -> [f64; 3] {
        let simulation = self.simulation;
        let spread = 1.0 - (2..5).map(|source| simulation.common[source] + simulation.own[source]).sum::<f64>();
        let threshold = simulation.thresholds()[0];
        let mut sums: [BTreeMap<u16, f64>; 3] = Default::default();
        for levels in combinations {
            let [wording, order, draw] = *levels;
            let place = Observation { question: 0, scene: 0, wording, order, draw, repeat: 0, value: 0.0 };
            let effects: f64 = (2..5)
                .map(|source| self.effect(source, &place, 0, random) + self.effect(source, &place, 2, random))
                .sum();
            let accuracy = Normal::standard().cdf((threshold + effects) / spread.sqrt());
            for (sums, level) in sums.iter_mut().zip(levels) {
                *sums.entry(*level).or_default() += accuracy;
            }
        }
        sums.map(|sums| {
            let combinations_of_level = combinations.len() as f64 / sums.len() as f64;
            let (low, high) =
                sums.into_values().fold((f64::MAX, f64::MIN), |(low, high), sum| (low.min(sum), high.max(sum)));
            (high - low) / combinations_of_level
        })
    }
}

const BASE: Design = Design { scenes: 20, questions: 60, wordings: 3, orders: 3, draws: 2, repeats: 1, is_half: false };

/// Shares of the variance in [`Source::ALL`]: about 3 points between wordings and between orders.
const COMMON: [f64; 10] = [0.08, 0.42, 0.008, 0.008, 0.002, 0.06, 0.05, 0.02, 0.0, 0.15];
const OWN: [f64; 10] = [0.01, 0.10, 0.002, 0.002, 0.001, 0.02, 0.02, 0.01, 0.0, 0.037];

pub(super) const FULL: Simulation =
    Simulation { name: "full", design: BASE, missing: 0.0, accuracies: [0.7, 0.6], common: COMMON, own: OWN };

pub(super) const DESIGNS: [Simulation; 5] = [
    FULL,
    Simulation {
        name: "no wording effect",
        design: BASE,
        missing: 0.0,
        accuracies: [0.7, 0.7],
        common: [0.08, 0.488, 0.0, 0.008, 0.002, 0.0, 0.05, 0.02, 0.0, 0.15],
        own: [0.01, 0.122, 0.0, 0.002, 0.001, 0.0, 0.02, 0.01, 0.0, 0.037],
    },
    Simulation {
        name: "strong wording",
        design: BASE,
        missing: 0.0,
        accuracies: [0.6, 0.6],
        common: [0.08, 0.36, 0.048, 0.008, 0.002, 0.06, 0.05, 0.02, 0.0, 0.15],
        own: [0.01, 0.08, 0.042, 0.002, 0.001, 0.02, 0.02, 0.01, 0.0, 0.037],
    },
    Simulation {
        name: "half, 5 % missing",
        design: Design { is_half: true, ..BASE },
        missing: 0.05,
        accuracies: [0.7, 0.7],
        common: COMMON,
        own: OWN,
    },
    Simulation {
        name: "2 x 2 x 2, 2 repeats",
        design: Design { scenes: 40, questions: 120, wordings: 2, orders: 2, draws: 2, repeats: 2, is_half: false },
        missing: 0.0,
        accuracies: [0.8, 0.8],
        common: [0.08, 0.42, 0.008, 0.008, 0.002, 0.06, 0.05, 0.02, 0.06, 0.07],
        own: [0.01, 0.10, 0.002, 0.002, 0.001, 0.02, 0.02, 0.01, 0.017, 0.04],
    },
];
