//! Intervals of few clusters: scenes that react differently to the light, one scene with most of the replies, and an
//! enhancer that ruins one scene in ten.

use super::curves::curve_of;
use super::shares::share;
use super::*;
use darkqa_score::comparisons::paired::difference;

/// Share of replies that are the same in two conditions with equal rates.
const KEPT: f64 = 0.7;

/// The net number of replies that a change of conditions makes right, and the number that it changes. `rates` are those
/// after and before.
fn changed(random: &mut StdRng, replies: u32, rates: [f64; 2]) -> (f64, f64) {
    let (mut net, mut changes) = (0.0, 0.0);
    for _ in 0..replies {
        let before = random.random_range(0.0..1.0);
        let after = if random.random_bool(KEPT) { before } else { random.random_range(0.0..1.0) };
        let [after, before] = [after < rates[0], before < rates[1]];
        net += f64::from(u8::from(after)) - f64::from(u8::from(before));
        changes += f64::from(u8::from(after != before));
    }
    (net, changes)
}

/// Whether the interval of a difference without an effect contains 0. `rates` draws the rates of a cluster.
fn without_effect(
    random: &mut StdRng,
    design: &Design,
    mut rates: impl FnMut(&mut StdRng) -> [f64; 2],
) -> [Option<bool>; 1] {
    let (mut squares, mut pairs) = (0.0, 0);
    let sums = design.clusters(random, |random, replies| {
        let rates = rates(random);
        let (net, changes) = changed(random, replies, rates);
        squares += changes;
        pairs += replies as usize;
        (net, f64::from(replies))
    });
    [Some(holds(difference(&sums, squares, pairs), 0.0))]
}

/// Two conditions to which scenes react differently: normal shifts of their logits with the intraclass correlation of
/// the design.
fn reacting(random: &mut StdRng, design: &Design, _: &Resamples) -> [Option<bool>; 1] {
    let variance = std::f64::consts::PI.powi(2) / 3.0;
    let spread = (variance * design.correlation / (1.0 - design.correlation)).sqrt();
    without_effect(random, design, |random| {
        [0, 1].map(|_| {
            let luck: f64 = StandardNormal.sample(random);
            let logit = (design.mean / (1.0 - design.mean)).ln() + spread * luck;
            1.0 / (1.0 + (-logit).exp())
        })
    })
}

/// An enhancer that gains 3 points in nine scenes of ten, and loses 27 in one.
fn ruined(random: &mut StdRng, design: &Design, _: &Resamples) -> [Option<bool>; 1] {
    const GAIN: f64 = 0.03;
    without_effect(random, design, |random| {
        let change = if random.random_bool(0.1) { -9.0 * GAIN } else { GAIN };
        [design.mean + change, design.mean]
    })
}

/// Designs of few scenes with many questions, and accuracies of a model that sees something.
fn few(shape: Shape, clusters: &[(usize, u32)]) -> Designs<'_> {
    Designs { shape, clusters, means: &[0.5, 0.75, 0.9] }
}

const FEW: [(usize, u32); 9] = [(2, 40), (3, 40), (4, 40), (5, 40), (6, 40), (7, 40), (8, 40), (12, 40), (20, 40)];

#[test]
#[ignore = "takes a minute; prints a table of src/docs/numbers.md"]
fn the_coverage_of_few_scenes() {
    let few = few(Shape::Even, &FEW);
    few.print(["share, few scenes"], share, 1000);
    few.print(["paired difference, few scenes"], reacting, 1000);
    few.print(["area, few scenes", "threshold, few scenes"], curve_of, 1000);
}

#[test]
#[ignore = "takes a minute; prints a table of src/docs/numbers.md"]
fn the_coverage_of_one_scene_with_most_replies() {
    let clusters = [(5, 12), (8, 12), (20, 12), (42, 12)];
    let most = few(Shape::Most, &clusters);
    most.print(["share"], share, 1000);
    most.print(["paired difference"], reacting, 1000);
    most.print(["area", "threshold"], curve_of, 300);
}

#[test]
#[ignore = "takes a minute; prints a table of src/docs/numbers.md"]
fn the_coverage_of_one_ruined_scene_in_ten() {
    let clusters = [(5, 40), (8, 40), (12, 40), (20, 40), (30, 40), (42, 40)];
    let designs = Designs { means: &[0.7], ..few(Shape::Even, &clusters) };
    designs.print(["an enhancer that ruins one scene in ten"], ruined, 1000);
}

fn design(shape: Shape, clusters: usize, size: u32, correlation: f64) -> Design {
    Design { clusters, size, shape, mean: 0.75, correlation }
}

/// How often an interval holds the truth, in percent.
fn held(simulate: Simulation<1>, design: &Design) -> f64 {
    coverage(simulate, design, 1000)[0].unwrap()
}

#[test]
fn two_to_seven_scenes_are_covered() {
    for clusters in 2..=7 {
        for correlation in [0.1, 0.2] {
            let design = design(Shape::Even, clusters, 40, correlation);
            let found = [share, reacting].map(|simulate| held(simulate, &design));
            // With two scenes and Student's t alone, 86 % of the shares.
            assert!(found.iter().all(|held| *held > 93.0), "{design:?}: {found:?}");
        }
    }
}

#[test]
fn thresholds_of_five_to_seven_scenes_are_covered() {
    for clusters in 5..=7 {
        let design = design(Shape::Even, clusters, 40, 0.2);
        let [_, threshold] = coverage(curve_of, &design, 300);
        // With the percentiles of the bootstrap alone, 92 % of 5 scenes.
        assert!(threshold.unwrap() > 93.0, "{design:?}: {threshold:?}");
    }
}

#[test]
fn one_scene_with_most_replies_is_covered() {
    for clusters in [8, 20, 42] {
        let design = design(Shape::Most, clusters, 12, 0.1);
        let found = [share, reacting].map(|simulate| held(simulate, &design));
        // 70 to 76 % with the variance of the clusters alone.
        assert!(found.iter().all(|held| *held > 93.0), "{design:?}: {found:?}");
    }
}

#[test]
fn rarely_ruined_scenes_are_covered() {
    for (clusters, least) in [(5, 95.0), (8, 95.0), (12, 94.0), (20, 92.0)] {
        let found = held(ruined, &design(Shape::Even, clusters, 40, 0.0));
        // With the variance of the clusters alone, 90 % of 8 and 12 scenes. Of 20 scenes, 12 % of samples have no
        // ruined one.
        assert!(found > least, "{clusters}: {found}");
    }
}
