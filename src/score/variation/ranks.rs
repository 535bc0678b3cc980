//! Agreement of the ranks of models over the levels of a facet: [`rank_agreement`].

use std::collections::{BTreeMap, BTreeSet};

use super::observation::{Facet, Observation};
use crate::bootstrap::Resamples;
use crate::estimate::Estimate;

/// Accuracies that differ by less are tied, because they differ by rounding alone.
const TIED: f64 = 1e-9;

/// Kendall's W of the ranks of models by accuracy, one ranking per level of a facet: 1 if all levels rank the models
/// alike, 0 if the rankings have nothing in common (Kendall and Babington Smith 1939, Ann. Math. Stat. 10:275; ties are
/// corrected as in Siegel and Castellan 1988, Nonparametric Statistics, equation 9.18b).
///
/// `models` has the observations of each model; levels that a model lacks are left out. `None` with fewer than two
/// levels or models, or if all models are tied under every level.
///
/// The interval holds for other scenes under the same levels. Its lower end is that of the cluster bootstrap over scenes
/// ([`Resamples`]). Noise changes ranks of similar models, so that W and its draws are too small. The upper end is
/// therefore 1 unless two levels are shown to rank a pair of models in opposite orders; then it is the larger of that of
/// the bootstrap and its lower end reflected about W.
#[must_use]
pub fn rank_agreement(models: &[&[Observation]], facet: Facet) -> Option<Estimate> {
    let scenes: BTreeSet<u32> = models.iter().copied().flatten().map(|observation| observation.scene).collect();
    let scenes: BTreeMap<u32, usize> = scenes.into_iter().zip(0..).collect();
    let levels = models
        .iter()
        .map(|model| model.iter().map(|observation| observation.level(facet)).collect::<BTreeSet<u16>>())
        .reduce(|all, levels| &all & &levels)?;
    let draws = Resamples::new(scenes.len());
    // Accuracy in the sample, then in each draw, by level and model.
    let mut accuracies = Vec::new();
    for level in &levels {
        let by_model = models.iter().map(|model| {
            let mut sums = vec![0.0_f32; scenes.len()];
            let mut counts = vec![0.0_f32; scenes.len()];
            for observation in model.iter().filter(|observation| observation.level(facet) == *level) {
                let scene = scenes[&observation.scene];
                sums[scene] += observation.value as f32;
                counts[scene] += 1.0;
            }
            let sample = [&sums, &counts].map(|numbers| numbers.iter().copied().map(f64::from).sum::<f64>());
            let drawn = draws.sums(&sums).into_iter().zip(draws.sums(&counts));
            std::iter::once((sample[0], sample[1])).chain(drawn).map(|(sum, count)| sum / count).collect::<Vec<f64>>()
        });
        accuracies.push(by_model.collect::<Vec<_>>());
    }
    let agreement = |draw: usize| {
        let ranks = accuracies.iter().map(|level| ranks(&level.iter().map(|model| model[draw]).collect::<Vec<f64>>()));
        kendalls_w(&ranks.collect::<Vec<_>>())
    };
    let value = agreement(0)?;
    let drawn = (1..=draws.all().count()).filter_map(agreement).collect();
    let [low, high] = draws.interval(drawn);
    let high = if shows_reversal(&accuracies, &draws) { high.max(2.0 * value - low) } else { 1.0 };
    let n = models.iter().map(|model| model.len()).sum();
    Some(Estimate::around(value, [low, high.min(1.0)], n))
}

/// True if two models are shown to have one order under one level and the other under another: the interval of their
/// difference is above 0 under one and below 0 under the other. `accuracies` has, by level and model, the accuracy in the
/// sample and then in each draw.
fn shows_reversal(accuracies: &[Vec<Vec<f64>>], draws: &Resamples) -> bool {
    let models = accuracies.first().map_or(0, Vec::len);
    let mut pairs = (0..models).flat_map(|first| (0..first).map(move |second| (first, second)));
    pairs.any(|(first, second)| {
        let intervals: Vec<[f64; 2]> = accuracies
            .iter()
            .map(|level| {
                let drawn = level[first].iter().zip(&level[second]).skip(1).map(|(first, second)| first - second);
                draws.interval(drawn.filter(|difference| !difference.is_nan()).collect())
            })
            .collect();
        intervals.iter().any(|[low, _]| *low > 0.0) && intervals.iter().any(|[_, high]| *high < 0.0)
    })
}

/// Rank of each number from 1, the smallest first; tied numbers have their mean rank.
fn ranks(numbers: &[f64]) -> Vec<f64> {
    numbers
        .iter()
        .map(|number| {
            let below = numbers.iter().filter(|other| **other < number - TIED).count();
            let tied = numbers.iter().filter(|other| (**other - number).abs() <= TIED).count();
            below as f64 + f64::midpoint(tied as f64, 1.0)
        })
        .collect()
}

/// Kendall's W of rankings of the same objects, corrected for ties; `None` if it is not defined.
fn kendalls_w(rankings: &[Vec<f64>]) -> Option<f64> {
    let m = rankings.len() as f64;
    let n = rankings.first()?.len();
    if rankings.len() < 2 || n < 2 || rankings.iter().flatten().any(|rank| rank.is_nan()) {
        return None;
    }
    let mean = f64::midpoint(n as f64, 1.0);
    let between: f64 =
        (0..n).map(|object| (rankings.iter().map(|ranks| ranks[object] - mean).sum::<f64>()).powi(2)).sum();
    // The sum of the squares of a ranking is (n³ − n) / 12 without ties, and Σ (t³ − t) / 12 less with them.
    let within: f64 = rankings.iter().flatten().map(|rank| (rank - mean).powi(2)).sum();
    (within > 0.0).then(|| between / (m * within))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_have_their_mean_rank() {
        assert_eq!(ranks(&[0.5, 0.2, 0.5, 0.9]), [2.5, 1.0, 2.5, 4.0]);
    }
}
