//! Differences pooled over models: [`PooledFinding`].
//!
//! The models are fixed: a finding is about these models, not about models in general. The sample consists of items, grouped in clusters.

mod finding;
mod left_out;

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::holm_of;
use super::paired::{ClusterNet, PairedTest};
use super::pooled_kind::PooledKind;
use crate::accuracies::{Coverage, Lacking, shared};
use crate::grid::{Grid, TrialResult};
use crate::model_in_condition::{ModelInCondition, pooled_models};
use crate::significance::{Significance, least_p};
use darkqa_ground::types::degradations::Kind;
use darkqa_ground::types::{AxisLevel, EnhancerName, Family, Variant, View};

use finding::is_severe;

pub use finding::{PooledDifference, PooledFinding};
pub use left_out::ModelsLeftOut;
pub(crate) use left_out::models_left_out;

/// Models that findings are about, sorted: models with images, without people and without reference models. If only reference models ran,
/// one of them.
#[must_use]
pub fn pool<'g>(grid: &'g Grid<'_>) -> Vec<&'g str> {
    models(grid, View::Image)
}

/// [`pooled_models`] with or without images.
fn models<'g>(grid: &'g Grid<'_>, view: View) -> Vec<&'g str> {
    let asked = grid
        .subjects
        .iter()
        .filter(|subject| subject.view == Some(view))
        .map(|subject| &*subject.model);
    pooled_models(grid.listing.without_people(asked))
        .into_iter()
        .collect()
}

/// A kind, variant and enhancer; Holm's correction is applied to each family of such a set.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct PooledSet {
    kind: PooledKind,
    variant: Variant,
    enhancer: Option<EnhancerName>,
}

impl PooledSet {
    /// All sets for which the grid may contain both sides.
    fn all(grid: &Grid<'_>) -> BTreeSet<Self> {
        // Findings are about levels. Image pairs have no level; other comparisons cover them.
        grid.subjects
            .iter()
            .filter(|subject| subject.view == Some(View::Image) && subject.variant.pair.is_none())
            .flat_map(|subject| {
                let kinds = match subject.enhancer {
                    None => PooledKind::for_raw(subject.variant.kind),
                    Some(_) => vec![PooledKind::Enhancer],
                };
                kinds.into_iter().map(|kind| Self {
                    kind,
                    variant: subject.variant.clone(),
                    enhancer: subject.enhancer.clone(),
                })
            })
            .collect()
    }

    /// Indices of the two subjects that are compared at a level; `model` is the model of the first side, `other` that of the second.
    fn sides(
        &self,
        grid: &Grid<'_>,
        model: &str,
        other: &str,
        level: AxisLevel,
    ) -> Option<(usize, usize)> {
        let first =
            ModelInCondition::with_images(model, level, &self.variant, self.enhancer.as_ref());
        let second = match self.kind {
            PooledKind::Darkness | PooledKind::Hallucination(_) => {
                ModelInCondition::with_images(model, AxisLevel::L0, &self.variant, None)
            }
            PooledKind::Noise => {
                let base = Variant {
                    kind: self.variant.kind.and_then(Kind::base),
                    reading: None,
                    pair: None,
                    group: self.variant.group.clone(),
                };
                ModelInCondition::with_images(model, level, &base, None)
            }
            PooledKind::Enhancer => {
                ModelInCondition::with_images(model, level, &self.variant, None)
            }
            PooledKind::Blind => ModelInCondition::new(other, None),
        };
        Some((grid.find(&first)?, grid.find_up_to_group(&second)?))
    }

    /// Levels of the first side, sorted.
    fn levels(&self, grid: &Grid<'_>) -> BTreeSet<AxisLevel> {
        grid.subjects
            .iter()
            .filter(|subject| {
                subject.view == Some(View::Image)
                    && subject.variant == self.variant
                    && subject.enhancer == self.enhancer
            })
            .filter_map(|subject| subject.level)
            .collect()
    }

    /// Models of the set, as pairs of first and second side. Models that answered fewer items than others are listed separately.
    fn models<'g>(&self, grid: &'g Grid<'_>, levels: &BTreeSet<AxisLevel>) -> SetModels<'g> {
        let all = self.asked_models(grid, levels);
        let coverages: Vec<Coverage> = all
            .iter()
            .map(|[model, other]| {
                let sides = levels.iter().filter_map(|level| {
                    let (first, second) = self.sides(grid, model, other, *level)?;
                    Some((*level, vec![first, second]))
                });
                Coverage::new(grid, sides, |item| self.kind.is_about(&grid.items[item]))
            })
            .collect();
        let mut models = SetModels::default();
        let Some(most) = shared(&coverages) else {
            return models;
        };
        for (pair, coverage) in all.into_iter().zip(&coverages) {
            let lacking = coverage.lacking(most);
            if lacking.is_empty() {
                let more: Vec<AxisLevel> = coverage
                    .levels()
                    .filter(|level| !most.levels().any(|known| known == *level))
                    .collect();
                if !more.is_empty() {
                    models.extra_levels.push((pair[0], more));
                }
                models.pooled.push(pair);
            } else {
                models.left_out.push((pair[0], lacking));
            }
        }
        models
    }

    /// Models that were asked on both sides at some level, as pairs of first and second side.
    ///
    /// A model is compared with its own replies without images. Only if no model was asked without images, each is compared with every
    /// blind model.
    fn asked_models<'g>(
        &self,
        grid: &'g Grid<'_>,
        levels: &BTreeSet<AxisLevel>,
    ) -> Vec<[&'g str; 2]> {
        let pool = pool(grid);
        let is_asked = |pair: &[&str; 2]| {
            levels
                .iter()
                .any(|level| self.sides(grid, pair[0], pair[1], *level).is_some())
        };
        let own: Vec<[&str; 2]> = pool
            .iter()
            .map(|model| [*model, *model])
            .filter(is_asked)
            .collect();
        if self.kind != PooledKind::Blind || !own.is_empty() {
            return own;
        }
        let blind = models(grid, View::Blind);
        pool.iter()
            .flat_map(|model| blind.iter().map(|other| [*model, *other]))
            .filter(is_asked)
            .collect()
    }
}

/// Models of a set.
#[derive(Debug, Default)]
struct SetModels<'g> {
    /// Pooled models, as pairs of first and second side.
    pooled: Vec<[&'g str; 2]>,
    /// Models that answered too few items, with the levels and the numbers of items of [`Coverage::lacking`].
    left_out: Vec<(&'g str, Lacking)>,
    /// Pooled models that were asked at more levels than the others, with these levels.
    extra_levels: Vec<(&'g str, Vec<AxisLevel>)>,
}

/// Replies of all models to one item on both sides.
#[derive(Debug, Clone, Copy)]
struct PooledItem {
    /// Index of the item in the grid.
    index: usize,
    /// Replies of each side; `None` if a model has no reply.
    sides: Option<[SideCounts; 2]>,
}

/// Numbers of replies of all models to one item on one side.
#[derive(Debug, Clone, Copy, Default)]
struct SideCounts {
    /// Counted replies in the strict parsing: right replies, or false answers.
    strict: u32,
    /// Counted replies in the lenient parsing.
    lenient: u32,
    /// Replies in which the strict parsing finds a choice.
    read: u32,
}

impl SideCounts {
    fn add(self, other: Self) -> Self {
        Self {
            strict: self.strict + other.strict,
            lenient: self.lenient + other.lenient,
            read: self.read + other.read,
        }
    }
}

/// Returns all pooled findings of single levels, and those averaged over levels, both ordered by kind, variant, enhancer, family and level.
#[must_use]
pub fn pooled(grid: &Grid<'_>) -> (Vec<PooledFinding>, Vec<PooledFinding>) {
    let sets: Vec<PooledSet> = PooledSet::all(grid).into_iter().collect();
    let findings: Vec<PooledFinding> = sets
        .into_par_iter()
        .flat_map_iter(|set| set_findings(grid, &set))
        .collect();
    findings
        .into_iter()
        .partition(|finding| finding.mean_over.is_empty())
}

/// Computes the findings of a set averaged over its darker levels, and over its lighter levels, if it has several of them. An effect that
/// grows with the level is not averaged over the lighter levels.
fn averaged(
    grid: &Grid<'_>,
    set: &PooledSet,
    models: &[[&str; 2]],
    levels: &[(AxisLevel, Vec<PooledItem>)],
) -> Vec<PooledFinding> {
    if !set.kind.is_averaged() {
        return Vec::new();
    }
    let halves = [true, false].map(|severe| {
        let half: Vec<&(AxisLevel, Vec<PooledItem>)> = levels
            .iter()
            .filter(|(level, _)| is_severe(*level, set.variant.kind) == severe)
            .collect();
        let is_tested = severe || !set.kind.grows_with_the_level();
        if half.len() < 2 || !is_tested {
            return None;
        }
        let mean_over: Vec<AxisLevel> = half.iter().map(|(level, _)| *level).collect();
        let mut sums = BTreeMap::<usize, Option<[SideCounts; 2]>>::new();
        for item in half.iter().flat_map(|(_, items)| items) {
            let sum = sums
                .entry(item.index)
                .or_insert_with(|| Some([SideCounts::default(); 2]));
            *sum = sum.zip(item.sides).map(|(sum, sides)| {
                let [first, second] = sum;
                [first.add(sides[0]), second.add(sides[1])]
            });
        }
        // Only items answered at every level count.
        let mut asked = BTreeMap::<usize, usize>::new();
        for item in half.iter().flat_map(|(_, items)| items) {
            *asked.entry(item.index).or_default() += 1;
        }
        let items: Vec<PooledItem> = sums
            .into_iter()
            .map(|(index, sides)| PooledItem {
                index,
                sides: sides.filter(|_| asked[&index] == half.len()),
            })
            .collect();
        let level = *mean_over.last()?;
        let pool = PoolOfLevels {
            models,
            levels: half.len(),
        };
        let found = finding(grid, set, pool, level, &items, None)?;
        Some(PooledFinding { mean_over, ..found })
    });
    halves
        .into_iter()
        .flatten()
        .flat_map(|one| corrected(vec![one]))
        .collect()
}

/// Models of a finding, and the number of levels that it averages over.
#[derive(Debug, Clone, Copy)]
struct PoolOfLevels<'m> {
    models: &'m [[&'m str; 2]],
    levels: usize,
}

/// Computes the findings of a set, for all families together and for each family.
fn set_findings(grid: &Grid<'_>, set: &PooledSet) -> Vec<PooledFinding> {
    let levels = set.levels(grid);
    let models = set.models(grid, &levels).pooled;
    if models.is_empty() {
        return Vec::new();
    }
    let levels: Vec<(AxisLevel, Vec<PooledItem>)> = levels
        .iter()
        .filter_map(|level| Some((*level, items(grid, set, &models, *level)?)))
        .collect();
    let groups = match set.kind.only_family() {
        None => grid.groups(),
        only => vec![only],
    };
    let pool = PoolOfLevels {
        models: &models,
        levels: 1,
    };
    let mut findings: Vec<PooledFinding> = groups
        .into_iter()
        .flat_map(|family| {
            corrected(
                levels
                    .iter()
                    .filter_map(|(level, items)| finding(grid, set, pool, *level, items, family))
                    .collect(),
            )
        })
        .collect();
    findings.extend(averaged(grid, set, &models, &levels));
    findings
}

/// Items that some model was asked on both sides; `None` if a model lacks a side.
fn items(
    grid: &Grid<'_>,
    set: &PooledSet,
    models: &[[&str; 2]],
    level: AxisLevel,
) -> Option<Vec<PooledItem>> {
    let pairs: Vec<(usize, usize)> = models
        .iter()
        .map(|[model, other]| set.sides(grid, model, other, level))
        .collect::<Option<_>>()?;
    let items = grid
        .items
        .iter()
        .enumerate()
        .filter(|(_, item)| set.kind.is_about(item))
        .filter_map(|(index, item)| {
            let (mut sides, mut is_asked, mut is_answered) =
                ([SideCounts::default(); 2], false, true);
            for &(first, second) in &pairs {
                let [a, b] = [first, second].map(|subject| grid.result(subject, index));
                is_asked |= a.is_asked() && b.is_asked();
                for (side, result) in sides.iter_mut().zip([a, b]) {
                    let TrialResult::Read { strict, lenient } = result else {
                        is_answered = false;
                        continue;
                    };
                    side.strict += u32::from(set.kind.counts(item, strict));
                    side.lenient += u32::from(set.kind.counts(item, lenient));
                    side.read += u32::from(strict.is_some());
                }
            }
            let sides = is_answered.then_some(sides);
            is_asked.then_some(PooledItem { index, sides })
        });
    Some(items.collect())
}

/// Computes the finding of a level and a family, before correction; `None` if no item was answered by all models.
fn finding(
    grid: &Grid<'_>,
    set: &PooledSet,
    pool: PoolOfLevels<'_>,
    level: AxisLevel,
    items: &[PooledItem],
    family: Option<&Family>,
) -> Option<PooledFinding> {
    let models = pool.models;
    let each = models.len() * pool.levels;
    let (mut answered, mut dropped) = (Vec::new(), 0);
    for (item, sides) in items
        .iter()
        .map(|item| (&grid.items[item.index], item.sides))
        .filter(|(item, _)| item.is_in_family(family))
    {
        match sides {
            Some(sides) => answered.push((item.cluster, sides)),
            None => dropped += 1,
        }
    }
    if answered.is_empty() {
        return None;
    }
    let replies = (each * answered.len()) as f64;
    let strict = difference(grid, &answered, each, |side| side.strict);
    let parsings_differ = answered
        .iter()
        .flat_map(|(_, sides)| sides)
        .any(|side| side.strict != side.lenient);
    let lenient = if parsings_differ {
        difference(grid, &answered, each, |side| side.lenient)
    } else {
        strict
    };
    let clusters: BTreeSet<u32> = answered.iter().map(|(cluster, _)| *cluster).collect();
    let [names, blind_names] = [0, 1].map(|side| {
        let names: BTreeSet<&str> = models.iter().map(|pair| pair[side]).collect();
        names.into_iter().map(str::to_owned).collect()
    });
    Some(PooledFinding {
        kind: set.kind,
        family: family.cloned(),
        variant: set.variant.clone(),
        enhancer: set.enhancer.clone(),
        level,
        mean_over: Vec::new(),
        models: names,
        blind_models: if set.kind == PooledKind::Blind {
            blind_names
        } else {
            Vec::new()
        },
        strict,
        lenient,
        format: [0, 1].map(|side| {
            answered
                .iter()
                .map(|(_, sides)| f64::from(sides[side].read))
                .sum::<f64>()
                / replies
        }),
        levels: 1,
        items: answered.len(),
        dropped,
        clusters: clusters.len(),
        least_p: least_p(clusters.len()),
        least_holm: 1.0,
    })
}

/// Computes the difference of the counted replies, before correction; `counted` gives their number, `each` is the number of replies to an
/// item on each side.
fn difference(
    grid: &Grid<'_>,
    answered: &[(u32, [SideCounts; 2])],
    each: usize,
    counted: impl Fn(&SideCounts) -> u32,
) -> PooledDifference {
    let mut clusters = vec![ClusterNet { net: 0, items: 0 }; grid.clusters];
    let (mut sums, mut squares) = ([0_u64; 2], 0);
    for (cluster, sides) in answered {
        let [first, second] = [&sides[0], &sides[1]].map(&counted);
        let net = i64::from(first) - i64::from(second);
        let of_cluster = &mut clusters[*cluster as usize];
        of_cluster.net += net;
        of_cluster.items += 1;
        squares += net * net;
        sums[0] += u64::from(first);
        sums[1] += u64::from(second);
    }
    clusters.retain(|cluster| cluster.items > 0);
    let tested = PairedTest::new(&clusters, each as f64, squares as f64);
    let [first, second] = sums.map(|count| count as f64 / each as f64 / answered.len() as f64);
    PooledDifference {
        first,
        second,
        difference: tested.difference,
        p: tested.p,
        p_by: tested.by,
        holm: 1.0,
        verdict: Significance::NotShown,
        p_report: None,
    }
}

/// Fills in the verdicts of the findings of one set, after Holm's correction.
fn corrected(mut set: Vec<PooledFinding>) -> Vec<PooledFinding> {
    let least = holm_of(set.iter().map(|finding| finding.least_p));
    let strict = holm_of(set.iter().map(|finding| finding.strict.p));
    let lenient = holm_of(set.iter().map(|finding| finding.lenient.p));
    let levels = set.len();
    for (index, finding) in set.iter_mut().enumerate() {
        finding.levels = levels;
        finding.least_holm = least[index];
        let kind = finding.kind;
        for (parsed, holm) in [
            (&mut finding.strict, strict[index]),
            (&mut finding.lenient, lenient[index]),
        ] {
            parsed.holm = holm;
            let gain = kind.gain(parsed.difference.value);
            parsed.verdict = Significance::new(gain, holm, least[index]);
        }
    }
    set
}
