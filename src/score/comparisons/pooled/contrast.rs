//! Difference between the losses of two question families: [`FamilyContrast`].

use super::{PooledFamily, PooledFinding, PooledItem, PooledState, SideCounts, items};
use crate::choice::ParsingMode;
use crate::comparisons::paired::bounded;
use crate::comparisons::pooled_kind::PooledKind;
use crate::comparisons::tested::Tested;
use crate::estimate::Estimate;
use crate::grid::Grid;
use crate::statistics::estimate::{degrees_of_freedom, residuals, student, two_sided_tail, unknown_design_effect};
use darkqa_base::types::{AxisLevel, Family, Variant};

/// The two families of a variant whose losses at the darkest level are furthest apart, with a test of the difference.
#[derive(Debug, Clone, PartialEq)]
pub struct FamilyContrast {
    pub variant: Variant,
    /// Darkest level of the variant.
    pub level: AxisLevel,
    /// Family whose interval is furthest on the side of a loss.
    pub most: Family,
    /// Family whose interval is furthest on the other side.
    pub least: Family,
    /// Number of pairs of families that could have been furthest apart.
    pub pairs: usize,
    /// Difference from L0 of `most` minus that of `least`, in the strict parsing, which is the main result. p is
    /// multiplied by the number of pairs of families (Bonferroni, because the data chose the pair).
    pub strict: Tested,
    /// Test in the lenient parsing.
    pub lenient: Tested,
}

impl FamilyContrast {
    /// True if `most` is detected to lose more than `least`, in both parsings.
    #[must_use]
    pub fn is_detected(&self) -> bool {
        [self.strict, self.lenient].iter().all(|test| test.difference.value < 0.0 && test.is_detected())
    }

    pub(crate) fn parsed_mut(&mut self, mode: ParsingMode) -> &mut Tested {
        mode.of([&mut self.strict, &mut self.lenient])
    }

    /// Test in a parsing.
    #[must_use]
    pub fn parsed(&self, mode: ParsingMode) -> &Tested {
        mode.of([&self.strict, &self.lenient])
    }
}

/// Returns the contrast of each variant in which two families were asked at its darkest level; `pooled` are the
/// findings of single levels.
#[must_use]
pub(crate) fn family_contrasts(grid: &Grid<'_>, pooled: &[PooledFinding]) -> Vec<FamilyContrast> {
    grid.variants()
        .into_iter()
        .filter_map(|variant| {
            let losses = pooled.iter().filter(|finding| {
                finding.kind == PooledKind::Darkness && finding.variant == *variant && finding.family.is_some()
            });
            let level = losses.clone().map(|finding| finding.level).max()?;
            let losses: Vec<&PooledFinding> = losses.filter(|finding| finding.level == level).collect();
            let most = losses.iter().min_by(|a, b| {
                let [a, b] = [a, b].map(|loss| loss.strict.tested.difference.high);
                a.total_cmp(&b)
            })?;
            let others = losses.iter().filter(|other| other.family != most.family);
            let least = others.max_by(|a, b| {
                let [a, b] = [a, b].map(|loss| loss.strict.tested.difference.low);
                a.total_cmp(&b)
            })?;
            contrast(grid, [most, least], losses.len() * (losses.len() - 1) / 2)
        })
        .collect()
}

/// Tests the difference between the losses of two families, which are one of `pairs` pairs.
fn contrast(grid: &Grid<'_>, [most, least]: [&PooledFinding; 2], pairs: usize) -> Option<FamilyContrast> {
    let set = PooledFamily { kind: PooledKind::Darkness, variant: most.variant.clone(), enhancer: None, against: None };
    let models: Vec<[&str; 2]> = most.models.iter().map(|model| [&**model; 2]).collect();
    let items = items(grid, &set, &models, most.level)?;
    let [strict, lenient]: [fn(&SideCounts) -> u32; 2] = [|side| side.strict, |side| side.lenient];
    let [strict, lenient] = [strict, lenient].map(|counted| {
        let test = |missing: Option<[Missing; 2]>| {
            let losses = [(most, 0), (least, 1)].map(|(finding, side)| {
                let missing = missing.map(|missing| missing[side]);
                let family = finding.family.as_ref();
                FamilyLoss::new(grid, &items, models.len(), family, counted, missing)
            });
            FamilyLoss::test(&losses, pairs)
        };
        let replied = test(None);
        let is_missing = [most, least].iter().any(|finding| finding.missing > 0);
        if !is_missing {
            return replied;
        }
        let bounds = [[Missing::Lowest, Missing::Highest], [Missing::Highest, Missing::Lowest]];
        let tests = bounds.map(|missing| test(Some(missing)));
        let (difference, p) = bounded((replied.difference, replied.p), tests.map(|bound| (bound.difference, bound.p)));
        Tested::new(difference, p)
    });
    Some(FamilyContrast {
        variant: most.variant.clone(),
        level: most.level,
        most: most.family.clone()?,
        least: least.family.clone()?,
        pairs,
        strict,
        lenient,
    })
}

/// Differences of items with missing replies that a bound assumes.
#[derive(Debug, Clone, Copy)]
enum Missing {
    Lowest,
    Highest,
}

/// Pairs that are added to the sample of each family, as to that of a single difference.
const ADDED: f64 = 2.0;

/// Loss of a family with the residuals of all clusters of the grid.
struct FamilyLoss {
    value: f64,
    n: usize,
    /// Residual of each cluster, divided by the number of pairs; `None` without an item of the family.
    residuals: Vec<Option<f64>>,
    /// Variance of the added pairs.
    added: f64,
}

impl FamilyLoss {
    fn new(
        grid: &Grid<'_>,
        items: &[PooledItem],
        models: usize,
        family: Option<&Family>,
        counted: fn(&SideCounts) -> u32,
        missing: Option<Missing>,
    ) -> Self {
        let mut clusters = vec![(0.0, 0.0); grid.clusters];
        for pooled in items {
            let item = &grid.items[pooled.index];
            let bounds = pooled.net_bounds(counted).filter(|_| item.is_in_family(family));
            let net = match (bounds, missing) {
                (Some([net, _]), _) if pooled.state == PooledState::Answered => net,
                (Some([net, _]), Some(Missing::Lowest)) | (Some([_, net]), Some(Missing::Highest)) => net,
                _ => continue,
            };
            let (sum, count) = &mut clusters[item.cluster as usize];
            *sum += net as f64 / models as f64;
            *count += 1.0;
        }
        let n: f64 = clusters.iter().map(|(_, count)| count).sum();
        let value = clusters.iter().map(|(sum, _)| sum).sum::<f64>() / n;
        let scale = n + ADDED;
        // `residuals` skips clusters without an item.
        let mut found = residuals(&clusters, value).into_iter();
        let all = clusters.iter().map(|(_, count)| {
            let residual = (*count > 0.0).then(|| found.next()).flatten()?;
            Some(residual / scale)
        });
        Self {
            value,
            n: n as usize,
            residuals: all.collect(),
            added: ADDED * unknown_design_effect(&clusters) / (scale * scale),
        }
    }

    /// Tests the difference of two losses by Student's t, with the variance between clusters. A cluster with items of
    /// both families counts once, with the difference of its residuals.
    fn test([most, least]: &[Self; 2], pairs: usize) -> Tested {
        let together: Vec<f64> = most
            .residuals
            .iter()
            .zip(&least.residuals)
            .filter(|(a, b)| a.is_some() || b.is_some())
            .map(|(a, b)| a.unwrap_or(0.0) - b.unwrap_or(0.0))
            .collect();
        let squares: f64 = together.iter().map(|residual| residual * residual).sum();
        let error = (squares + most.added + least.added).sqrt();
        let [value, center] = [[0.0; 2], [ADDED; 2]].map(|[of_most, of_least]| {
            let [n_most, n_least] = [most.n as f64, least.n as f64];
            most.value * n_most / (n_most + of_most) - least.value * n_least / (n_least + of_least)
        });
        let n = most.n + least.n;
        if !error.is_finite() || together.len() < 2 {
            return Tested::new(Estimate::around(value, [-2.0, 2.0], n), 1.0);
        }
        let degrees = degrees_of_freedom(&together);
        let half = student(degrees) * error;
        Tested::new(
            Estimate::around(value, [center - half, center + half], n),
            (pairs as f64 * two_sided_tail(center.abs() / error, degrees)).min(1.0),
        )
    }
}
