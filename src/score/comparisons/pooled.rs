//! Differences pooled over models: [`PooledFinding`].
//!
//! The models are fixed: a finding is about these models, not about models in general. The sample consists of items,
//! grouped in clusters.
//!
//! Replies of all models to one item: [`PooledItem`].

mod contrast;
mod finding;
mod left_out;

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::comparison::compares_enhancers;
use super::paired::BoundedSums;
use super::pooled_kind::PooledKind;
use crate::accuracies::{Lacking, LevelCoverage, shared};
use crate::choice::ParsingMode;
use crate::grid::{Grid, TrialResult};
use crate::model_in_condition::{ModelInCondition, pooled_models};
use crate::significance::{PValues, least_p};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{AxisLevel, EnhancerName, Family, Variant, View};
use finding::is_severe;

pub(crate) use contrast::family_contrasts;
pub(crate) use left_out::models_left_out;

pub use contrast::FamilyContrast;
pub use finding::{PooledDifference, PooledFinding};
pub use left_out::ModelsLeftOut;

/// Models that findings are about, sorted: models with images, without people and without reference models. If only
/// reference models ran, one of them.
#[must_use]
pub fn pool<'g>(grid: &'g Grid<'_>) -> Vec<&'g str> {
    models(grid, View::Image)
}

/// [`pooled_models`] with or without images.
fn models<'g>(grid: &'g Grid<'_>, view: View) -> Vec<&'g str> {
    let asked = grid.subjects.iter().filter(|subject| subject.view == Some(view)).map(|subject| &*subject.model);
    pooled_models(grid.listing.without_people(asked)).into_iter().collect()
}

/// A kind, variant and enhancers; Holm's correction is applied to each family of such a set, and of all pairs of
/// enhancers together.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct PooledFamily {
    kind: PooledKind,
    variant: Variant,
    enhancer: Option<EnhancerName>,
    /// Enhancer of the second side, for two enhancers.
    against: Option<EnhancerName>,
}

impl PooledFamily {
    /// All sets for which the grid may contain both sides.
    fn all(grid: &Grid<'_>) -> BTreeSet<Self> {
        let mut sets = Self::of_enhancers_and_raw(grid);
        if compares_enhancers(grid) {
            let enhanced: Vec<Self> = sets.iter().filter(|set| set.enhancer.is_some()).cloned().collect();
            // The sets are sorted by variant and enhancer, so those of a variant are neighbours.
            for of_variant in enhanced.chunk_by(|a, b| a.variant == b.variant) {
                for (index, first) in of_variant.iter().enumerate() {
                    sets.extend(of_variant[index + 1..].iter().map(|second| Self {
                        kind: PooledKind::EnhancerPair,
                        against: second.enhancer.clone(),
                        ..first.clone()
                    }));
                }
            }
        }
        sets
    }

    /// All sets but those of two enhancers.
    fn of_enhancers_and_raw(grid: &Grid<'_>) -> BTreeSet<Self> {
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
                    against: None,
                })
            })
            .collect()
    }

    /// Indices of the two subjects that are compared at a level; `model` is the model of the first side, `other` that
    /// of the second.
    fn sides(&self, grid: &Grid<'_>, model: &str, other: &str, level: AxisLevel) -> Option<(usize, usize)> {
        let first = ModelInCondition::with_images(model, level, &self.variant, self.enhancer.as_ref());
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
            PooledKind::Enhancer => ModelInCondition::with_images(model, level, &self.variant, None),
            PooledKind::EnhancerPair => {
                ModelInCondition::with_images(model, level, &self.variant, self.against.as_ref())
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

    /// Models of the set, as pairs of first and second side. Models that answered fewer items than others are listed
    /// separately.
    fn models<'g>(&self, grid: &'g Grid<'_>, levels: &BTreeSet<AxisLevel>) -> SetModels<'g> {
        let all = self.asked_models(grid, levels);
        let coverages: Vec<LevelCoverage> = all
            .iter()
            .map(|[model, other]| {
                let sides = levels.iter().filter_map(|level| {
                    let (first, second) = self.sides(grid, model, other, *level)?;
                    Some((*level, vec![first, second]))
                });
                LevelCoverage::new(grid, sides, |item| self.kind.is_about(&grid.items[item]))
            })
            .collect();
        let mut models = SetModels::default();
        let Some(most) = shared(&coverages) else {
            return models;
        };
        for (pair, coverage) in all.into_iter().zip(&coverages) {
            let lacking = coverage.lacking(most);
            if lacking.is_empty() {
                let more: Vec<AxisLevel> =
                    coverage.levels().filter(|level| !most.levels().any(|known| known == *level)).collect();
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
    /// A model is compared with its own replies without images. Only if no model was asked without images, each is
    /// compared with every blind model.
    fn asked_models<'g>(&self, grid: &'g Grid<'_>, levels: &BTreeSet<AxisLevel>) -> Vec<[&'g str; 2]> {
        let pool = pool(grid);
        let is_asked =
            |pair: &[&str; 2]| levels.iter().any(|level| self.sides(grid, pair[0], pair[1], *level).is_some());
        let own: Vec<[&str; 2]> = pool.iter().map(|model| [*model, *model]).filter(is_asked).collect();
        if self.kind != PooledKind::Blind || !own.is_empty() {
            return own;
        }
        let blind = models(grid, View::Blind);
        pool.iter().flat_map(|model| blind.iter().map(|other| [*model, *other])).filter(is_asked).collect()
    }
}

/// Models of a set.
#[derive(Debug, Default)]
struct SetModels<'g> {
    /// Pooled models, as pairs of first and second side.
    pooled: Vec<[&'g str; 2]>,
    /// Models that answered too few items, with the levels and the numbers of items of [`LevelCoverage::lacking`].
    left_out: Vec<(&'g str, Lacking)>,
    /// Pooled models that were asked at more levels than the others, with these levels.
    extra_levels: Vec<(&'g str, Vec<AxisLevel>)>,
}

/// Returns all pooled findings of single levels, and those averaged over levels, both ordered by kind, variant,
/// enhancer, family and level.
#[must_use]
pub fn pooled(grid: &Grid<'_>) -> (Vec<PooledFinding>, Vec<PooledFinding>) {
    let sets: Vec<PooledFamily> = PooledFamily::all(grid).into_iter().collect();
    let findings: Vec<PooledFinding> = sets.into_par_iter().flat_map_iter(|set| set_findings(grid, &set)).collect();
    let (mut levels, means): (Vec<PooledFinding>, Vec<PooledFinding>) =
        findings.into_iter().partition(|finding| finding.mean_over.is_empty());
    correct_enhancer_pairs(&mut levels);
    (levels, means)
}

/// Corrects the findings about two enhancers over all pairs and levels of a variant, for each family.
fn correct_enhancer_pairs(findings: &mut [PooledFinding]) {
    let mut sets = BTreeMap::<(Variant, Option<Family>), Vec<usize>>::new();
    for (index, finding) in findings.iter().enumerate() {
        if finding.kind == PooledKind::EnhancerPair {
            let set = (finding.variant.clone(), finding.family.clone());
            sets.entry(set).or_default().push(index);
        }
    }
    for set in sets.into_values() {
        let own = set.iter().map(|index| findings[*index].clone()).collect();
        for (index, finding) in set.into_iter().zip(corrected(own)) {
            findings[index] = finding;
        }
    }
}

/// Computes the findings of a set averaged over its darker levels, and over its lighter levels, if it has several of
/// them. An effect that grows with the level is not averaged over the lighter levels.
fn averaged(
    grid: &Grid<'_>,
    set: &PooledFamily,
    models: &[[&str; 2]],
    levels: &[(AxisLevel, Vec<PooledItem>)],
) -> Vec<PooledFinding> {
    if !set.kind.is_averaged() {
        return Vec::new();
    }
    let halves = [true, false].map(|severe| {
        let half: Vec<&(AxisLevel, Vec<PooledItem>)> =
            levels.iter().filter(|(level, _)| is_severe(*level, set.variant.kind) == severe).collect();
        let is_tested = severe || !set.kind.grows_with_the_level();
        if half.len() < 2 || !is_tested {
            return None;
        }
        let mean_over: Vec<AxisLevel> = half.iter().map(|(level, _)| *level).collect();
        // Sum of each item with its number of levels.
        let mut sums = BTreeMap::<usize, (PooledItem, usize)>::new();
        for item in half.iter().flat_map(|(_, items)| items) {
            sums.entry(item.index)
                .and_modify(|(sum, levels)| {
                    sum.sides = [0, 1].map(|side| sum.sides[side].add(item.sides[side]));
                    sum.state = sum.state.and(item.state);
                    *levels += 1;
                })
                .or_insert((*item, 1));
        }
        // Only items asked at every level count.
        let items: Vec<PooledItem> = sums
            .into_values()
            .map(|(item, levels)| PooledItem {
                state: if levels == half.len() { item.state } else { PooledState::Unasked },
                ..item
            })
            .collect();
        let level = *mean_over.last()?;
        let pool = PoolOfLevels { models, levels: half.len() };
        let found = finding(grid, set, pool, level, &items, None)?;
        Some(PooledFinding { mean_over, ..found })
    });
    halves.into_iter().flatten().flat_map(|one| corrected(vec![one])).collect()
}

/// Models of a finding, and the number of levels that it averages over.
#[derive(Debug, Clone, Copy)]
struct PoolOfLevels<'m> {
    models: &'m [[&'m str; 2]],
    levels: usize,
}

/// Computes the findings of a set, for all families together and for each family.
fn set_findings(grid: &Grid<'_>, set: &PooledFamily) -> Vec<PooledFinding> {
    let levels = set.levels(grid);
    let models = set.models(grid, &levels).pooled;
    if models.is_empty() {
        return Vec::new();
    }
    let levels: Vec<(AxisLevel, Vec<PooledItem>)> =
        levels.iter().filter_map(|level| Some((*level, items(grid, set, &models, *level)?))).collect();
    let groups = match set.kind.only_family() {
        None => grid.groups(),
        only => vec![only],
    };
    let pool = PoolOfLevels { models: &models, levels: 1 };
    let mut findings: Vec<PooledFinding> = groups
        .into_iter()
        .flat_map(|family| {
            corrected(
                levels.iter().filter_map(|(level, items)| finding(grid, set, pool, *level, items, family)).collect(),
            )
        })
        .collect();
    findings.extend(averaged(grid, set, &models, &levels));
    findings
}

/// Items that some model was asked on both sides; `None` if a model lacks a side.
fn items(grid: &Grid<'_>, set: &PooledFamily, models: &[[&str; 2]], level: AxisLevel) -> Option<Vec<PooledItem>> {
    let pairs: Vec<(usize, usize)> =
        models.iter().map(|[model, other]| set.sides(grid, model, other, level)).collect::<Option<_>>()?;
    let items =
        grid.items.iter().enumerate().filter(|(_, item)| set.kind.is_about(item)).filter_map(|(index, item)| {
            let mut sides = [SideCounts::default(); 2];
            let mut is_asked = false;
            let mut state = PooledState::Answered;
            for &(first, second) in &pairs {
                let results = grid.results([first, second], index);
                let is_asked_on_both = results.iter().all(|result| result.is_asked());
                is_asked |= is_asked_on_both;
                let has_reply = results.iter().any(|result| result.is_reply());
                for (side, result) in sides.iter_mut().zip(results) {
                    let TrialResult::Read { strict, lenient } = result else {
                        side.missing += u32::from(has_reply);
                        state = state.and(if is_asked_on_both { PooledState::Missing } else { PooledState::Unasked });
                        continue;
                    };
                    side.strict += u32::from(set.kind.counts(item, strict));
                    side.lenient += u32::from(set.kind.counts(item, lenient));
                    side.read += u32::from(strict.is_some());
                    side.replies += 1;
                }
            }
            is_asked.then_some(PooledItem { index, sides, state })
        });
    Some(items.collect())
}

/// Computes the finding of a level and a family, before correction; `None` if no item was answered by all models.
fn finding(
    grid: &Grid<'_>,
    set: &PooledFamily,
    pool: PoolOfLevels<'_>,
    level: AxisLevel,
    items: &[PooledItem],
    family: Option<&Family>,
) -> Option<PooledFinding> {
    let models = pool.models;
    let each = models.len() * pool.levels;
    let of_family: Vec<(u32, PooledItem)> = items
        .iter()
        .map(|item| (&grid.items[item.index], *item))
        .filter(|(item, _)| item.is_in_family(family))
        .map(|(item, pooled)| (item.cluster, pooled))
        .collect();
    let answered: Vec<(u32, [SideCounts; 2])> = of_family
        .iter()
        .filter(|(_, item)| item.state == PooledState::Answered)
        .map(|(cluster, item)| (*cluster, item.sides))
        .collect();
    let dropped = of_family.len() - answered.len();
    let replies = (each * answered.len()) as f64;
    let strict = difference(grid, &of_family, each, |side| side.strict)?;
    let parsings_differ = of_family.iter().flat_map(|(_, item)| &item.sides).any(|side| side.strict != side.lenient);
    let lenient = if parsings_differ { difference(grid, &of_family, each, |side| side.lenient)? } else { strict };
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
        against: set.against.clone(),
        level,
        mean_over: Vec::new(),
        models: names,
        blind_models: if set.kind == PooledKind::Blind { blind_names } else { Vec::new() },
        strict,
        lenient,
        format: [0, 1].map(|side| answered.iter().map(|(_, sides)| f64::from(sides[side].read)).sum::<f64>() / replies),
        levels: 1,
        items: answered.len(),
        dropped,
        missing: of_family
            .iter()
            .filter(|(_, item)| item.state == PooledState::Missing && item.net_bounds(|_| 0).is_some())
            .count(),
        clusters: clusters.len(),
        least_p: least_p(clusters.len()),
        least_holm: 1.0,
    })
}

/// Computes the difference of the counted replies, before correction; `counted` gives their number, `each` is the
/// number of replies to an item on each side. `None` if no item is answered.
fn difference(
    grid: &Grid<'_>,
    items: &[(u32, PooledItem)],
    each: usize,
    counted: impl Fn(&SideCounts) -> u32,
) -> Option<PooledDifference> {
    let mut nets = BoundedSums::new(grid.clusters);
    let (mut sums, mut answered) = ([0_u64; 2], 0);
    for (cluster, item) in items {
        let Some([lowest, highest]) = item.net_bounds(&counted) else {
            continue;
        };
        if item.state == PooledState::Answered {
            nets.add(*cluster, lowest);
            answered += 1;
            for (sum, side) in sums.iter_mut().zip(&item.sides) {
                *sum += u64::from(counted(side));
            }
        } else {
            nets.add_missing(*cluster, lowest, highest);
        }
    }
    let tested = nets.test(each as f64)?.tested;
    let [first, second] = sums.map(|count| count as f64 / each as f64 / f64::from(answered));
    Some(PooledDifference { first, second, tested })
}

/// Fills in the verdicts of the findings of one set, after Holm's correction.
fn corrected(mut set: Vec<PooledFinding>) -> Vec<PooledFinding> {
    let [strict, lenient] = ParsingMode::ALL.map(|mode| {
        let tests = set.iter().map(|finding| finding.parsed(mode).tested.p_values(finding.least_p));
        PValues::corrected(&tests.collect::<Vec<PValues>>())
    });
    let levels = set.len();
    for (index, finding) in set.iter_mut().enumerate() {
        finding.levels = levels;
        finding.least_holm = strict[index].least;
        let kind = finding.kind;
        for (parsed, corrected) in [(&mut finding.strict, strict[index]), (&mut finding.lenient, lenient[index])] {
            let tested = &mut parsed.tested;
            tested.correct(kind.gain(tested.difference.value), corrected);
        }
    }
    set
}

/// Replies of all models to one item on both sides.
#[derive(Debug, Clone, Copy)]
pub(super) struct PooledItem {
    /// Index of the item in the grid.
    index: usize,
    /// Replies of each side.
    sides: [SideCounts; 2],
    state: PooledState,
}

impl PooledItem {
    /// Smallest and largest difference of the counted replies of both sides, which are equal if all replied; `counted`
    /// gives their number. `None` if a model was not asked, or without any reply, which tells nothing about the two
    /// sides.
    fn net_bounds(&self, counted: impl Fn(&SideCounts) -> u32) -> Option<[i64; 2]> {
        let is_usable = match self.state {
            PooledState::Answered => true,
            PooledState::Missing => self.sides.iter().any(|side| side.replies > 0),
            PooledState::Unasked => false,
        };
        let [first, second] = [&self.sides[0], &self.sides[1]].map(|side| i64::from(counted(side)));
        let [first_missing, second_missing] = [0, 1].map(|side| i64::from(self.sides[side].missing));
        is_usable.then_some([first - second - second_missing, first + first_missing - second])
    }
}

/// Which models have a reply to an item.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PooledState {
    /// Every model replied on both sides.
    Answered,
    /// Every model was asked on both sides, and some replies are missing.
    Missing,
    /// Some model was not asked on a side.
    Unasked,
}

impl PooledState {
    /// State of an item over several models or levels.
    fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::Answered, Self::Answered) => Self::Answered,
            (Self::Unasked, _) | (_, Self::Unasked) => Self::Unasked,
            _ => Self::Missing,
        }
    }
}

/// Numbers of replies of all models to one item on one side. If a model has no reply on either side, neither side
/// counts it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SideCounts {
    /// Counted replies in the strict parsing: right replies, or false answers.
    strict: u32,
    /// Counted replies in the lenient parsing.
    lenient: u32,
    /// Replies in which the strict parsing finds a choice.
    read: u32,
    /// Replies.
    replies: u32,
    /// Missing replies of models that replied on the other side.
    missing: u32,
}

impl SideCounts {
    fn add(self, other: Self) -> Self {
        Self {
            strict: self.strict + other.strict,
            lenient: self.lenient + other.lenient,
            read: self.read + other.read,
            replies: self.replies + other.replies,
            missing: self.missing + other.missing,
        }
    }
}
