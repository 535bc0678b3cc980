//! Agreement of two models: [`Agreement`].

use super::comparison::{ComparisonKind, pairs};
use crate::choice::ParsingMode;
use crate::estimate::{ClusterCount, Estimate};
use crate::grid::Grid;
use crate::model_in_condition::ModelInCondition;
use crate::statistics::estimate::{degrees_of_freedom, student};

/// Agreement of two models in one condition, in the strict parsing.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreement {
    pub first: ModelInCondition,
    pub second: ModelInCondition,
    /// Share of items to which both models gave the same answer.
    pub same: Estimate,
    /// Cohen's κ of being right: 0 if the two err independently, 1 if they err on the same items ("error consistency",
    /// Geirhos et al. 2020, arXiv:2006.16736). `None` if one of them is right, or wrong, in too few clusters.
    pub kappa: Option<Estimate>,
}

/// Counts over the items of a cluster.
#[derive(Debug, Clone, Copy, Default)]
pub struct AgreementCounts {
    /// Number of items to which both models replied.
    pub all: f64,
    /// Number of these items that both got right.
    pub both: f64,
    /// Number of these items that the first model got right.
    pub first: f64,
    /// Number of these items that the second model got right.
    pub second: f64,
}

impl AgreementCounts {
    /// Counts an item, given whether each model got it right.
    pub(crate) fn add_item(&mut self, [first, second]: [bool; 2]) {
        self.all += 1.0;
        self.both += f64::from(first && second);
        self.first += f64::from(first);
        self.second += f64::from(second);
    }

    /// Counts over the items of all clusters.
    pub(crate) fn total(clusters: &[Self]) -> Self {
        clusters.iter().fold(Self::default(), |sum, counts| Self {
            all: sum.all + counts.all,
            both: sum.both + counts.both,
            first: sum.first + counts.first,
            second: sum.second + counts.second,
        })
    }
}

/// Agreement of each model with itself between two kinds of images of the same scenes: dark photographs against
/// synthetic images, and enhanced against raw images, both for dark photographs and for untouched frames.
#[must_use]
pub(crate) fn light_agreements(grid: &Grid<'_>) -> Vec<Agreement> {
    let untouched = pairs(grid, ComparisonKind::Enhancer)
        .into_iter()
        .filter(|(first, _)| grid.subjects[*first].variant.is_untouched());
    pairs(grid, ComparisonKind::RealSynthetic)
        .into_iter()
        .chain(pairs(grid, ComparisonKind::RealEnhanced))
        .chain(untouched)
        .filter_map(|(first, second)| agreement(grid, first, second))
        .collect()
}

/// Agreement of every pair of models in every condition.
#[must_use]
pub(crate) fn agreements(grid: &Grid<'_>) -> Vec<Agreement> {
    pairs(grid, ComparisonKind::Model)
        .into_iter()
        .filter_map(|(first, second)| agreement(grid, first, second))
        .collect()
}

fn agreement(grid: &Grid<'_>, first: usize, second: usize) -> Option<Agreement> {
    let mut same = vec![ClusterCount::default(); grid.clusters];
    let mut counts = vec![AgreementCounts::default(); grid.clusters];
    for (index, item) in grid.items.iter().enumerate() {
        let [a, b] = grid.results([first, second], index).map(|result| result.parsed(ParsingMode::Strict));
        let (Some(a), Some(b)) = (a, b) else {
            continue;
        };
        let cluster = item.cluster as usize;
        same[cluster].replies += 1;
        same[cluster].right += u32::from(a.is_some() && a == b);
        counts[cluster].add_item([a, b].map(|chosen| item.is_right(chosen)));
    }
    Some(Agreement {
        first: grid.subjects[first].clone(),
        second: grid.subjects[second].clone(),
        kappa: clustered_kappa(&counts),
        same: Estimate::clustered(&same)?,
    })
}

/// Minimum number of clusters in which each model errs, and in which each is right (chosen). With fewer, no interval of
/// κ had its nominal coverage in simulation.
const MIN_CLUSTERS: usize = 8;

/// Estimates κ of two models from the counts of each cluster; `None` if one of them is right, or wrong, in fewer than
/// [`MIN_CLUSTERS`] clusters.
///
/// The variance is that of the linearization of κ in the counts of the clusters, with Student's quantile for the
/// degrees of freedom of the residuals of the clusters.
#[must_use]
pub fn clustered_kappa(counts: &[AgreementCounts]) -> Option<Estimate> {
    let conditions: [fn(&AgreementCounts) -> bool; 4] =
        [|r| r.first > 0.0, |r| r.second > 0.0, |r| r.first < r.all, |r| r.second < r.all];
    let vary = conditions.iter().all(|holds| counts.iter().filter(|r| holds(r)).count() >= MIN_CLUSTERS);
    if !vary {
        return None;
    }
    let total = AgreementCounts::total(counts);
    let all = total.all;
    let both = total.both / all;
    let (a, b) = (total.first / all, total.second / all);
    let value = kappa(both, a, b)?;
    // κ = 2 (both − ab) / (a + b − 2ab).
    let denominator = a + b - 2.0 * a * b;
    let influences: Vec<f64> = counts
        .iter()
        .filter(|counts| counts.all > 0.0)
        .map(|r| {
            let (both, first, second) = (r.both - both * r.all, r.first - a * r.all, r.second - b * r.all);
            let crossed = 2.0 * (b * first + a * second);
            (2.0 * both - crossed - value * (first + second - crossed)) / denominator / all
        })
        .collect();
    let c = influences.len() as f64;
    let variance = c / (c - 1.0) * influences.iter().map(|x| x * x).sum::<f64>();
    let half = student(degrees_of_freedom(&influences)) * variance.sqrt();
    Some(Estimate { value, low: (value - half).max(-1.0), high: (value + half).min(1.0), n: all as usize })
}

/// Cohen's κ of two binary ratings (Cohen 1960, Educ. Psychol. Meas. 20:37), from the shares that both, the first and
/// the second got right; `None` if one of them does not vary.
pub(crate) fn kappa(both: f64, first: f64, second: f64) -> Option<f64> {
    let observed = 1.0 - first - second + 2.0 * both;
    let expected = first * second + (1.0 - first) * (1.0 - second);
    [first, second].iter().all(|share| *share > 0.0 && *share < 1.0).then(|| (observed - expected) / (1.0 - expected))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kappa_is_cohens() {
        // Both right on 20 of 50, both wrong on 15: κ 0.4 (the example of the English Wikipedia's article on Cohen's
        // κ).
        assert!((kappa(0.4, 0.5, 0.6).unwrap() - 0.4).abs() < 1e-12);
        assert_eq!(kappa(1.0, 1.0, 1.0), None);
        assert!((kappa(0.25, 0.5, 0.5).unwrap()).abs() < 1e-12);
    }

    /// A cluster of one item.
    fn item(first: bool, second: bool) -> AgreementCounts {
        let mut counts = AgreementCounts::default();
        counts.add_item([first, second]);
        counts
    }

    #[test]
    fn the_interval_is_that_of_independent_pairs() {
        // One item a cluster: 20, 5, 10 and 15 of 50 are right by both, the first, the second and neither.
        let counts = [
            vec![item(true, true); 20],
            vec![item(true, false); 5],
            vec![item(false, true); 10],
            vec![item(false, false); 15],
        ]
        .concat();
        let estimate = clustered_kappa(&counts).unwrap();
        // The asymptotic standard error of Fleiss, Cohen and Everitt 1969 (Psychol. Bull. 72:323), equation 13, times
        // √(50 / 49).
        let error = 0.126_996_062_931_100_3 * f64::sqrt(50.0 / 49.0);
        let half = estimate.high - estimate.value;
        assert!((estimate.value - 0.4).abs() < 1e-12 && estimate.n == 50);
        let degrees = half / error;
        assert!(degrees > student(49.0) - 1e-9 && degrees < student(30.0), "{degrees}");
        // Errors in seven clusters only are too few for an interval of the first model.
        let few = [vec![item(true, true); 40], vec![item(false, true); 7], vec![item(true, false); 9]].concat();
        assert_eq!(clustered_kappa(&few), None);
    }
}
