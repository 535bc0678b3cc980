//! How far two models agree: [`Agreement`].

use super::bootstrap::Resamples;
use super::choice::ReadingMode;
use super::comparison::{ComparisonKind, pairs};
use super::estimate::Estimate;
use super::grid::{ClusterCount, Grid};
use super::subject::Subject;

/// Agreement of two models in one condition, in the strict reading.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreement {
    pub first: Subject,
    pub second: Subject,
    /// Share of items to which both models gave the same answer.
    pub same: Estimate,
    /// Cohen's κ of being right: 0 if the two err independently, 1 if they err on the same items ("error consistency",
    /// Geirhos et al. 2020, arXiv:2006.16736). `None` if one of them is always right or always wrong.
    pub kappa: Option<Estimate>,
}

/// Counts over the items of a cluster.
#[derive(Debug, Clone, Copy, Default)]
pub struct AgreementCounts {
    /// Number of items to which both models replied.
    pub all: f32,
    /// Number of them that both got right.
    pub both: f32,
    /// Number of them that the first model got right.
    pub first: f32,
    /// Number of them that the second model got right.
    pub second: f32,
}

/// Agreement of every pair of models in every condition.
#[must_use]
pub(crate) fn agreements(grid: &Grid<'_>, draws: &Resamples) -> Vec<Agreement> {
    let pairs = pairs(grid, ComparisonKind::Model).into_iter();
    pairs
        .filter_map(|(first, second)| agreement(grid, draws, first, second))
        .collect()
}

fn agreement(grid: &Grid<'_>, draws: &Resamples, first: usize, second: usize) -> Option<Agreement> {
    let mut same = vec![ClusterCount::default(); grid.clusters];
    let mut counts = vec![AgreementCounts::default(); grid.clusters];
    for (index, item) in grid.items.iter().enumerate() {
        let reading = |subject| grid.result(subject, index).reading(ReadingMode::Strict);
        let (Some(a), Some(b)) = (reading(first), reading(second)) else {
            continue;
        };
        let cluster = item.cluster as usize;
        same[cluster].replies += 1;
        same[cluster].right += u32::from(a.is_some() && a == b);
        let (a, b) = (item.is_right(a), item.is_right(b));
        let one_if = |right: bool| f32::from(u8::from(right));
        let cluster = &mut counts[cluster];
        cluster.all += 1.0;
        cluster.both += one_if(a && b);
        cluster.first += one_if(a);
        cluster.second += one_if(b);
    }
    Some(Agreement {
        first: grid.subjects[first].clone(),
        second: grid.subjects[second].clone(),
        kappa: clustered_kappa(&counts, draws),
        same: Estimate::clustered(&same)?,
    })
}

/// κ of two models with its interval, from the counts of each cluster; `None` if one of them is always right or always wrong.
#[must_use]
pub fn clustered_kappa(counts: &[AgreementCounts], draws: &Resamples) -> Option<Estimate> {
    let total =
        |of: fn(&AgreementCounts) -> f32| counts.iter().map(|counts| f64::from(of(counts))).sum();
    let all: f64 = total(|r| r.all);
    let value = kappa(
        all,
        total(|r| r.both),
        total(|r| r.first),
        total(|r| r.second),
    )?;
    let sums =
        |of: fn(&AgreementCounts) -> f32| draws.sums(&counts.iter().map(of).collect::<Vec<_>>());
    let (drawn, both) = (sums(|r| r.all), sums(|r| r.both));
    let (first, second) = (sums(|r| r.first), sums(|r| r.second));
    let kappas = (0..drawn.len()).filter_map(|i| kappa(drawn[i], both[i], first[i], second[i]));
    let [low, high] = draws.interval(kappas.collect());
    Some(Estimate {
        value,
        low: low.min(value),
        high: high.max(value),
        n: all as usize,
    })
}

/// Cohen's κ of two binary ratings (Cohen 1960, Educ. Psychol. Meas. 20:37); `None` if one of them does not vary.
fn kappa(all: f64, both: f64, first: f64, second: f64) -> Option<f64> {
    let (a, b) = (first / all, second / all);
    let observed = (all - first - second + 2.0 * both) / all;
    let expected = a * b + (1.0 - a) * (1.0 - b);
    let varies = |share: f64| share > 0.0 && share < 1.0;
    (varies(a) && varies(b)).then(|| (observed - expected) / (1.0 - expected))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kappa_is_cohens() {
        // Both right on 20 of 50, both wrong on 15: κ 0.4 (the example of the English Wikipedia's article on Cohen's κ).
        assert!((kappa(50.0, 20.0, 25.0, 30.0).unwrap() - 0.4).abs() < 1e-12);
        assert_eq!(kappa(10.0, 10.0, 10.0, 10.0), None);
        assert!((kappa(4.0, 1.0, 2.0, 2.0).unwrap()).abs() < 1e-12);
    }
}
