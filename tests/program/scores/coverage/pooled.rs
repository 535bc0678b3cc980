//! The test of all models together, and its interval.

use super::*;
use crate::support::made::record;
use darkqa_base::types::{Condition, Degradation, ParsedAnswer, Record, Severity};
use darkqa_eval::Kind;
use darkqa_score::choice::ParsingMode;
use darkqa_score::cluster::Clusters;
use darkqa_score::cluster::FrameTies;
use darkqa_score::comparisons::paired::PairedComparison;
use darkqa_score::comparisons::{PooledKind, pooled};
use darkqa_score::grid::Grid;
use darkqa_score::significance::Verdict;

/// Clusters, the standard deviation of a scene's effect in logits, and the share of right replies that is lost in the
/// dark.
struct PooledDesign {
    clusters: usize,
    size: u32,
    shape: Shape,
    scene_effect: f64,
    effect: f64,
}

impl PooledDesign {
    fn seed(&self) -> u64 {
        let third = u64::from(self.shape == Shape::Third);
        self.clusters as u64
            + 1000 * (100.0 * self.scene_effect) as u64
            + 1_000_000 * (100.0 * self.effect) as u64
            + 1_000_000_000 * third
    }

    /// The cluster of each question.
    fn clusters(&self, random: &mut StdRng) -> Vec<usize> {
        let design =
            Design { clusters: self.clusters, size: self.size, shape: self.shape, mean: 0.5, correlation: 0.0 };
        let sizes = design.sizes(random).into_iter().enumerate();
        let of = |(cluster, size)| std::iter::repeat_n(cluster, size as usize);
        sizes.flat_map(of).collect()
    }
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

/// Six models in the same clusters, on items of different difficulty. In the dark each model is right less often by
/// `effect`, and each condition has a scene effect with a standard deviation in logits.
fn pooled_rates(design: &PooledDesign, runs: usize) -> PooledRates {
    const MODELS: usize = 6;
    let mut random = StdRng::seed_from_u64(design.seed());
    let clusters = design.clusters(&mut random);
    let noisy = |kind| Condition::raw(Some(Degradation::new(kind, Severity::L3, None).unwrap()));
    let conditions = [noisy(Kind::Sensor), noisy(Kind::Exposure)];
    let mut records: Vec<Record> = Vec::new();
    for model in 0..MODELS {
        for condition in &conditions {
            for place in clusters.iter().copied().enumerate() {
                records.push(record(&format!("m{model}"), condition, place, true));
            }
        }
    }
    let asked = records.iter().map(|record| (&record.question, &record.detail.frame));
    let units = Clusters::new(asked, &FrameTies::default());
    let mut rates = PooledRates::default();
    for _ in 0..runs {
        answer(&mut random, &mut records, &clusters, design);
        let trials = records.iter().cloned().collect();
        let grid = Grid::new(&trials, &units);
        let (findings, _) = pooled(&grid);
        let all = |finding: &&_| {
            let finding: &darkqa_score::comparisons::PooledFinding = finding;
            finding.kind == PooledKind::Noise && finding.family.is_none()
        };
        let finding = findings.iter().find(all).unwrap();
        // The subjects are sorted: exposure drop of the first model, then its noise.
        let one = PairedComparison::new(&grid, 1, 0, None, ParsingMode::Strict).unwrap();
        rates.rejected += f64::from(u8::from(finding.strict.tested.p < 0.05));
        rates.rejected_by_one += f64::from(u8::from(one.tested.p < 0.05));
        rates.held += f64::from(u8::from(holds(finding.strict.tested.difference, -design.effect)));
        assert_eq!(finding.strict.tested.verdict.is_shown(), finding.strict.tested.p < 0.05);
        assert_ne!(finding.strict.tested.verdict, Verdict::TooFewClusters);
    }
    let percent = 100.0 / runs as f64;
    for rate in [&mut rates.rejected, &mut rates.rejected_by_one, &mut rates.held] {
        *rate *= percent;
    }
    rates
}

/// Replaces the answers of all records; those of noise come first for each model.
fn answer(random: &mut StdRng, records: &mut [Record], clusters: &[usize], design: &PooledDesign) {
    let (items, scene_effect, effect) = (clusters.len(), design.scene_effect, design.effect);
    let mut normal = |spread: f64| {
        let drawn: f64 = StandardNormal.sample(random);
        spread * drawn
    };
    let shifts: Vec<[f64; 2]> = (0..design.clusters).map(|_| [normal(scene_effect), normal(scene_effect)]).collect();
    let scenes: Vec<f64> = (0..design.clusters).map(|_| normal(0.5)).collect();
    let difficulties: Vec<f64> = (0..items).map(|_| normal(0.8)).collect();
    for (index, record) in records.iter_mut().enumerate() {
        let (item, side) = (index % items, index / items % 2);
        let logit = 1.0 + scenes[clusters[item]] + difficulties[item] + shifts[clusters[item]][side];
        let p = 1.0 / (1.0 + (-logit).exp()) - if side == 0 { effect } else { 0.0 };
        let right = random.random_bool(p.clamp(0.0, 1.0));
        let chosen = Some(usize::from(!right));
        record.detail.strict = Some(ParsedAnswer { chosen, why: None });
    }
}

#[test]
#[ignore = "takes minutes; prints a table of src/docs/numbers.md"]
fn size_and_power_of_pooled_test() {
    println!(
        "\n| clusters × questions | scene effect in logits | effect in points | rejected, 6 models pooled | rejected, one model | interval holds the truth |\n|---|---|---|---|---|---|"
    );
    let even = [(8, 12), (25, 8), (64, 18)].map(|size| (size, Shape::Even));
    let third = [(8, 8), (25, 8), (52, 8)].map(|size| (size, Shape::Third));
    let mut designs = Vec::new();
    for ((clusters, size), shape) in even.into_iter().chain(third) {
        for scene_effect in [0.0, 0.5] {
            designs.extend([0.0, 0.06].map(|effect| PooledDesign { clusters, size, shape, scene_effect, effect }));
        }
    }
    let rates: Vec<PooledRates> = designs.par_iter().map(|design| pooled_rates(design, 1000)).collect();
    for (design, rates) in designs.iter().zip(rates) {
        println!(
            "| {} × {}, {:?} | {} | {:.0} | {:.1} | {:.1} | {:.1} |",
            design.clusters,
            design.size,
            design.shape,
            design.scene_effect,
            100.0 * design.effect,
            rates.rejected,
            rates.rejected_by_one,
            rates.held
        );
    }
}

#[test]
fn pooled_test_beats_single_models() {
    let design =
        |scene_effect, effect| PooledDesign { clusters: 25, size: 8, shape: Shape::Even, scene_effect, effect };
    let none = pooled_rates(&design(0.5, 0.0), 250);
    // 5 %, give or take 2.8 % (two standard errors).
    assert!(none.rejected < 7.8 && none.held > 92.0, "{none:?}");
    let real = pooled_rates(&design(0.0, 0.06), 100);
    assert!(real.rejected > 75.0 && real.rejected_by_one < 45.0, "{real:?}");
}
