//! Differences of all models together: [`PooledFinding`].
//!
//! The models are fixed: a finding is about these models, not about models in general. Items, grouped in clusters, are the sample.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::choice::ReadingMode;
use super::estimate::Estimate;
use super::grid::Grid;
use super::paired::difference;
use super::pooled_kind::PooledKind;
use super::significance::{Significance, SwapMethod, holm, least_p, swap_test};
use super::subject::{Subject, pooled_models};
use darkqa_ground::types::degradation::Kind;
use darkqa_ground::types::{AxisLevel, EnhancerName, Family, KindReading, View};

/// Difference of two conditions at one level, for all models of the pool together, in the strict reading.
#[derive(Debug, Clone, PartialEq)]
pub struct PooledFinding {
    /// The two sides, and what is counted.
    pub kind: PooledKind,
    /// Question family; `None` for all families together. Findings about false answers have [`Family::Presence`] alone.
    pub family: Option<Family>,
    /// Kind of degradation of the first side, with its light reading; [`KindReading::NONE`] for L0 against no image.
    pub variant: KindReading,
    /// Enhancer of the first side; `None` for raw images.
    pub enhancer: Option<EnhancerName>,
    /// Level of the first side.
    pub level: AxisLevel,
    /// The models, sorted. All findings of one set (kind, variant and enhancer) have the same ones.
    pub models: Vec<String>,
    /// The models without images on the second side, sorted; empty if the finding is not about them. They are the same models
    /// as `models` if these were asked without images too.
    pub blind_models: Vec<String>,
    /// Share of the first side that is counted, accuracy or rate of false answers: mean over the items of the mean over the models.
    pub first: f64,
    /// The same share of the second side.
    pub second: f64,
    /// The first share minus the second. Its `n` is the number of items.
    pub difference: Estimate,
    /// p-value of swapping the two sides in whole clusters, of all models at once.
    pub p: f64,
    /// How the p-value was found.
    pub p_by: SwapMethod,
    /// p-value after Holm's correction over the levels of its set: the same kind, variant, enhancer and family.
    pub holm: f64,
    /// Number of findings in its set.
    pub levels: usize,
    /// Result of the test after correction. A rate of false answers that is shown to grow is worse.
    pub verdict: Significance,
    /// Number of items that every model answered on both sides.
    pub items: usize,
    /// Number of items that some model was asked on both sides, but that are left out because a model has no reply.
    pub dropped: usize,
    /// Number of clusters of the items.
    pub clusters: usize,
    /// The smallest p-value that so many clusters allow, 2 / 2ᶜ.
    pub least_p: f64,
    /// The smallest p-value after correction that the clusters allow; no verdict is possible if it is 0.05 or more.
    pub least_holm: f64,
}

/// The models over which findings are pooled, sorted: those with images, without reference models if there are others; else one
/// reference alone.
#[must_use]
pub fn pool<'g>(grid: &'g Grid<'_>) -> Vec<&'g str> {
    models(grid, View::Image)
}

/// The [`pooled_models`] with images or without.
fn models<'g>(grid: &'g Grid<'_>, view: View) -> Vec<&'g str> {
    let subjects = grid.subjects.iter();
    let asked = subjects.filter(|subject| subject.view == Some(view));
    let models = pooled_models(asked.map(|subject| &*subject.model));
    models.into_iter().collect()
}

/// A kind, variant and enhancer: one set of Holm's correction for each family.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct PooledSet {
    kind: PooledKind,
    variant: KindReading,
    enhancer: Option<EnhancerName>,
}

impl PooledSet {
    /// All sets for which the grid may have both sides.
    fn all(grid: &Grid<'_>) -> BTreeSet<Self> {
        let seeing = grid.subjects.iter();
        // Findings are about levels, and the darkness of pairs is none: it has comparisons of its own.
        let seeing = seeing
            .filter(|subject| subject.view == Some(View::Image) && subject.variant.pair.is_none());
        let sets = seeing.flat_map(|subject| {
            let raw = PooledKind::of_raw(subject.variant.kind);
            let kinds = match subject.enhancer {
                None => raw,
                Some(_) => vec![PooledKind::Enhancer],
            };
            kinds.into_iter().map(|kind| Self {
                kind,
                variant: subject.variant.clone(),
                enhancer: subject.enhancer.clone(),
            })
        });
        sets.collect()
    }

    /// The two subjects of a model at a level, by their indices; `other` is the model of the second side.
    fn sides(
        &self,
        grid: &Grid<'_>,
        model: &str,
        other: &str,
        level: AxisLevel,
    ) -> Option<(usize, usize)> {
        let seeing = |level, variant, enhancer| Subject::seeing(model, level, variant, enhancer);
        let first = seeing(level, &self.variant, self.enhancer.as_ref());
        let second = match self.kind {
            PooledKind::Darkness | PooledKind::Hallucination(_) => {
                seeing(AxisLevel::L0, &self.variant, None)
            }
            PooledKind::Noise => {
                let base = KindReading {
                    kind: self.variant.kind.and_then(Kind::base),
                    reading: None,
                    pair: None,
                    group: self.variant.group.clone(),
                };
                seeing(level, &base, None)
            }
            PooledKind::Enhancer => seeing(level, &self.variant, None),
            PooledKind::Blind => Subject::new(other, None),
        };
        Some((grid.find(&first)?, grid.stand_in(&second)?))
    }

    /// The levels of the first side, sorted.
    fn levels(&self, grid: &Grid<'_>) -> BTreeSet<AxisLevel> {
        let subjects = grid.subjects.iter().filter(|subject| {
            subject.view == Some(View::Image)
                && subject.variant == self.variant
                && subject.enhancer == self.enhancer
        });
        subjects.filter_map(|subject| subject.level).collect()
    }

    /// The models of each pair, first and second side, among those of the pool that have both sides at some level.
    ///
    /// Without images, models are compared with their own replies; only if none of them was asked so, each is compared with
    /// every model without images.
    fn models<'g>(&self, grid: &'g Grid<'_>, levels: &BTreeSet<AxisLevel>) -> Vec<[&'g str; 2]> {
        let pool = pool(grid);
        let own = pool.iter().map(|model| [*model, *model]);
        let asked = |pair: &[&str; 2]| {
            let mut levels = levels.iter();
            levels.any(|level| self.sides(grid, pair[0], pair[1], *level).is_some())
        };
        let own: Vec<[&str; 2]> = own.filter(asked).collect();
        if self.kind != PooledKind::Blind || !own.is_empty() {
            return own;
        }
        let blind = models(grid, View::Blind);
        let pairs = pool
            .iter()
            .flat_map(|model| blind.iter().map(|other| [*model, *other]));
        pairs.filter(asked).collect()
    }
}

/// Replies of all models to one item on both sides.
#[derive(Debug, Clone, Copy)]
struct PooledItem {
    /// Index of the item in the grid.
    index: usize,
    /// Number of replies of each side that are counted: right ones, or false answers; `None` if a model has no reply.
    counted: Option<[u32; 2]>,
}

/// All pooled findings, ordered by kind, variant, enhancer, family and level.
#[must_use]
pub fn pooled(grid: &Grid<'_>) -> Vec<PooledFinding> {
    let sets: Vec<PooledSet> = PooledSet::all(grid).into_iter().collect();
    let findings = sets.into_par_iter().flat_map_iter(|set| of_set(grid, &set));
    findings.collect()
}

/// Levels that a set of findings leaves out, because some of its models were not asked on both sides there and others were.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LevelsLeftOut {
    pub kind: PooledKind,
    pub variant: KindReading,
    pub enhancer: Option<EnhancerName>,
    /// The levels, sorted.
    pub levels: Vec<AxisLevel>,
    /// All levels at which some model was asked on both sides, sorted.
    pub asked: Vec<AxisLevel>,
    /// The models that were not asked on both sides at these levels, sorted.
    pub models: Vec<String>,
}

/// The levels that the findings leave out, by set and by the models that were not asked there.
#[must_use]
pub fn levels_left_out(grid: &Grid<'_>) -> Vec<LevelsLeftOut> {
    let mut all = Vec::new();
    for set in PooledSet::all(grid) {
        let mut levels = set.levels(grid);
        let models = set.models(grid, &levels);
        let mut by_models = BTreeMap::<BTreeSet<&str>, Vec<AxisLevel>>::new();
        levels.retain(|level| {
            let (asked, lacking): (Vec<[&str; 2]>, Vec<[&str; 2]>) = models
                .iter()
                .copied()
                .partition(|[model, other]| set.sides(grid, model, other, *level).is_some());
            if !asked.is_empty() && !lacking.is_empty() {
                let lacking = lacking.into_iter().map(|[model, _]| model);
                by_models.entry(lacking.collect()).or_default().push(*level);
            }
            !asked.is_empty()
        });
        let asked: Vec<AxisLevel> = levels.into_iter().collect();
        all.extend(by_models.into_iter().map(|(models, levels)| LevelsLeftOut {
            kind: set.kind,
            variant: set.variant.clone(),
            enhancer: set.enhancer.clone(),
            levels,
            asked: asked.clone(),
            models: models.into_iter().map(str::to_owned).collect(),
        }));
    }
    all
}

/// The findings of a set, with all families together and with each family.
fn of_set(grid: &Grid<'_>, set: &PooledSet) -> Vec<PooledFinding> {
    let levels = set.levels(grid);
    let models = set.models(grid, &levels);
    if models.is_empty() {
        return Vec::new();
    }
    let at = |level: &AxisLevel| Some((*level, items(grid, set, &models, *level)?));
    let levels: Vec<(AxisLevel, Vec<PooledItem>)> = levels.iter().filter_map(at).collect();
    let groups = match set.kind.only_family() {
        None => grid.groups(),
        only => vec![only],
    };
    let findings = groups.into_iter().flat_map(|family| {
        let levels = levels.iter();
        let of_family = levels
            .filter_map(|(level, items)| finding(grid, set, &models, (*level, items), family));
        corrected(of_family.collect())
    });
    findings.collect()
}

/// The items that some model was asked on both sides; `None` if a model lacks a side.
fn items(
    grid: &Grid<'_>,
    set: &PooledSet,
    models: &[[&str; 2]],
    level: AxisLevel,
) -> Option<Vec<PooledItem>> {
    let pairs = models.iter();
    let pairs = pairs.map(|[model, other]| set.sides(grid, model, other, level));
    let pairs: Vec<(usize, usize)> = pairs.collect::<Option<_>>()?;
    let items = grid.items.iter().enumerate();
    let items = items.filter(|(_, item)| set.kind.is_about(item));
    let items = items.filter_map(|(index, item)| {
        let (mut counted, mut is_asked, mut is_answered) = ([0, 0], false, true);
        for &(first, second) in &pairs {
            let [a, b] = [first, second].map(|subject| grid.result(subject, index));
            is_asked |= a.is_asked() && b.is_asked();
            for (side, result) in [a, b].into_iter().enumerate() {
                match result.reading(ReadingMode::Strict) {
                    None => is_answered = false,
                    Some(chosen) => counted[side] += u32::from(set.kind.counts(item, chosen)),
                }
            }
        }
        let counted = is_answered.then_some(counted);
        is_asked.then_some(PooledItem { index, counted })
    });
    Some(items.collect())
}

/// The finding of a level and a family, before correction; `None` if no item was answered by all models.
fn finding(
    grid: &Grid<'_>,
    set: &PooledSet,
    models: &[[&str; 2]],
    (level, items): (AxisLevel, &[PooledItem]),
    family: Option<&Family>,
) -> Option<PooledFinding> {
    let mut clusters = vec![(0_i64, 0_u32); grid.clusters];
    let (mut counted, mut squares, mut dropped) = ([0_u64; 2], 0, 0);
    let of_family = items
        .iter()
        .map(|item| (&grid.items[item.index], item.counted));
    for (item, answered) in of_family.filter(|(item, _)| item.is_of(family)) {
        let Some([first, second]) = answered else {
            dropped += 1;
            continue;
        };
        let (net, count) = &mut clusters[item.cluster as usize];
        let item_net = i64::from(first) - i64::from(second);
        *net += item_net;
        squares += item_net * item_net;
        *count += 1;
        counted[0] += u64::from(first);
        counted[1] += u64::from(second);
    }
    clusters.retain(|(_, count)| *count > 0);
    let n: usize = clusters.iter().map(|(_, count)| *count as usize).sum();
    if n == 0 {
        return None;
    }
    let nets: Vec<i64> = clusters.iter().map(|(net, _)| *net).collect();
    let pairs = models.len() as f64;
    let sums = clusters.iter();
    let sums = sums.map(|(net, count)| (*net as f64 / pairs, f64::from(*count)));
    let tested = swap_test(&nets);
    let mean = |count: u64| count as f64 / pairs / n as f64;
    let names = |side: usize| {
        let names: BTreeSet<&str> = models.iter().map(|pair| pair[side]).collect();
        names.into_iter().map(str::to_owned).collect()
    };
    Some(PooledFinding {
        kind: set.kind,
        family: family.cloned(),
        variant: set.variant.clone(),
        enhancer: set.enhancer.clone(),
        level,
        models: names(0),
        blind_models: if set.kind == PooledKind::Blind {
            names(1)
        } else {
            Vec::new()
        },
        first: mean(counted[0]),
        second: mean(counted[1]),
        difference: difference(&sums.collect::<Vec<_>>(), squares as f64 / pairs / pairs, n),
        p: tested.p,
        p_by: tested.by,
        holm: 1.0,
        levels: 1,
        verdict: Significance::NotShown,
        items: n,
        dropped,
        clusters: clusters.len(),
        least_p: least_p(clusters.len()),
        least_holm: 1.0,
    })
}

/// The findings of one set with their verdicts, after Holm's correction.
fn corrected(mut set: Vec<PooledFinding>) -> Vec<PooledFinding> {
    let adjusted = |of: fn(&PooledFinding) -> f64| holm(&set.iter().map(of).collect::<Vec<_>>());
    let (corrected, least) = (
        adjusted(|finding| finding.p),
        adjusted(|finding| finding.least_p),
    );
    let levels = set.len();
    for ((finding, holm), least_holm) in set.iter_mut().zip(corrected).zip(least) {
        finding.holm = holm;
        finding.levels = levels;
        finding.least_holm = least_holm;
        let gain = finding.kind.gain(finding.difference.value);
        finding.verdict = Significance::of(gain, holm, least_holm);
    }
    set
}
