//! Summaries of accuracy over all levels: [`Curve`].
//!
//! First level at which each item is answered wrongly: [`FirstFailure`].

use rayon::prelude::*;

use super::balance::UnbalancedFamily;
use crate::bootstrap::Resamples;
use crate::choice::ParsingMode;
use crate::estimate::ClusterCount;
use crate::grid::{Grid, TrialResult};
use crate::model_in_condition::ModelInCondition;
use crate::threshold::{CurveSummary, LevelCounts};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{Axis, AxisLevel, EnhancerName, Family, RunGroup, Variant, View};

/// Summary of one model over all levels, in one variant, raw or with one enhancer.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    pub model: String,
    pub variant: Variant,
    /// Enhancer; `None` for raw images.
    pub enhancer: Option<EnhancerName>,
    /// Question family; `None` for all families together.
    pub family: Option<Family>,
    /// Source of the floor.
    pub floor: FloorKind,
    /// Threshold and area in the strict parsing, which is the main result.
    pub summary: CurveSummary,
    /// Threshold and area in the lenient parsing.
    pub lenient: CurveSummary,
}

/// Source of the floor of a curve: answers without the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FloorKind {
    /// A guess among the choices.
    Guessing,
    /// In families of which one answer is true of most questions, but not of all, always that answer; else a guess.
    CommonAnswer,
    /// The model itself without images.
    Blind,
}

impl FloorKind {
    /// The name in tables and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Guessing => "guessing",
            Self::CommonAnswer => "common answer",
            Self::Blind => "no image",
        }
    }
}

impl Curve {
    /// Quantity on the horizontal axis of the curve.
    #[must_use]
    pub fn axis(&self) -> Axis {
        self.variant.kind.map_or(Axis::LIGHT, Kind::axis)
    }

    /// Threshold and area in a parsing.
    #[must_use]
    pub fn parsed(&self, mode: ParsingMode) -> &CurveSummary {
        mode.of([&self.summary, &self.lenient])
    }
}

/// Points of one curve: one model in one variant, raw or with one enhancer.
#[derive(Debug)]
pub struct CurvePoints {
    pub model: String,
    pub variant: Variant,
    pub enhancer: Option<EnhancerName>,
    /// Levels in increasing severity, with the index of the subject at each. L0 is the clean frame for every curve.
    pub subjects: Vec<(AxisLevel, usize)>,
}

impl CurvePoints {
    /// All curves of a grid that have L0 and at least one degraded level.
    pub(crate) fn all(grid: &Grid<'_>) -> Vec<Self> {
        let mut keys: Vec<(&str, &Variant, Option<&EnhancerName>)> = grid
            .subjects
            .iter()
            .filter(|subject| subject.view == Some(View::Image) && subject.variant.kind.is_some())
            .map(|subject| (&*subject.model, &subject.variant, subject.enhancer.as_ref()))
            .collect();
        // Sorts equal keys together to remove duplicates, then restores the order of the models.
        keys.sort_unstable();
        keys.dedup();
        keys.sort_by_cached_key(|(model, ..)| grid.listing.place(model));
        keys.into_iter()
            .map(|(model, variant, enhancer)| {
                let group = variant.group.as_ref();
                let mut subjects: Vec<(AxisLevel, usize)> = grid
                    .subjects
                    .iter()
                    .enumerate()
                    .filter(|(_, subject)| {
                        subject.view == Some(View::Image)
                            && subject.model == model
                            && (subject.level == Some(AxisLevel::L0)
                                && subject.enhancer.is_none()
                                && RunGroup::overlap(subject.variant.group.as_ref(), group)
                                || subject.variant == *variant && subject.enhancer.as_ref() == enhancer)
                    })
                    .filter_map(|(index, subject)| Some((subject.level?, index)))
                    .collect();
                subjects.sort_unstable();
                Self { model: model.to_owned(), variant: variant.clone(), enhancer: enhancer.cloned(), subjects }
            })
            .filter(|points| points.subjects.len() > 1 && points.subjects[0].0 == AxisLevel::L0)
            .collect()
    }
}

/// Computes all curves of a grid: each model in each variant, raw and with each enhancer. A curve needs L0 and at least
/// one degraded level. `unbalanced` are the families of the grid with a common answer.
#[must_use]
pub fn curves(
    grid: &Grid<'_>,
    draws: &Resamples,
    family: Option<&Family>,
    unbalanced: &[UnbalancedFamily],
) -> Vec<Curve> {
    CurvePoints::all(grid).into_par_iter().filter_map(|points| curve(grid, draws, family, unbalanced, points)).collect()
}

fn curve(
    grid: &Grid<'_>,
    draws: &Resamples,
    family: Option<&Family>,
    unbalanced: &[UnbalancedFamily],
    points: CurvePoints,
) -> Option<Curve> {
    let subjects = &points.subjects;
    let missing: Vec<Vec<u32>> = subjects.iter().map(|(_, subject)| grid.failed(*subject, family)).collect();
    let blind = grid.find_up_to_group(&ModelInCondition::new(&points.model, None));
    let [guessing, common] =
        [&[], unbalanced].map(|unbalanced| Floor::from_choices(grid, subjects[0].1, family, unbalanced));
    let [(strict, floor), (lenient, _)] = ParsingMode::ALL.map(|mode| {
        let counts: Vec<Vec<ClusterCount>> =
            subjects.iter().map(|(_, subject)| grid.counts(*subject, family, mode)).collect();
        let seeing_nothing =
            blind.and_then(|blind| Floor::from_blind(&grid.counts(blind, family, mode), &counts[0], &missing[0]));
        // Only what images add can be lost in the dark; without an image the model may still be worse than a guess.
        let (floor, kind) = match seeing_nothing {
            Some(blind) if blind.total() > guessing.total() => (blind, FloorKind::Blind),
            // Without a blind run, the model is assumed to know which answer is common.
            None if common != guessing => (common.clone(), FloorKind::CommonAnswer),
            _ => (guessing.clone(), FloorKind::Guessing),
        };
        let levels = LevelCounts {
            levels: subjects.iter().map(|(level, _)| *level).collect(),
            counts,
            missing: missing.clone(),
            guesses: floor.replies,
            missing_guesses: floor.missing,
        };
        (levels, kind)
    });
    let summary = strict.summary(draws)?;
    Some(Curve {
        lenient: if lenient.counts == strict.counts { summary.clone() } else { lenient.summary(draws)? },
        floor,
        summary,
        model: points.model,
        variant: points.variant,
        enhancer: points.enhancer,
        family: family.cloned(),
    })
}

/// Expected numbers of right replies at L0 without the image, by cluster.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Floor {
    /// Among the replies.
    pub(crate) replies: Vec<f32>,
    /// Among the missing replies.
    pub(crate) missing: Vec<f32>,
}

impl Floor {
    /// The floor of an answer without the image: the common one in these unbalanced families, a guess in others. If an
    /// answer is true of all questions of a family, it counts as a guess, because a floor of 100 % leaves no threshold.
    fn from_choices(grid: &Grid<'_>, clean: usize, family: Option<&Family>, unbalanced: &[UnbalancedFamily]) -> Self {
        let (mut replies, mut missing) = (vec![0.0; grid.clusters], vec![0.0; grid.clusters]);
        for (item, result) in grid.family_items(clean, family) {
            let of_result = match result {
                TrialResult::Absent => continue,
                TrialResult::Failed => &mut missing,
                TrialResult::Read { .. } => &mut replies,
            };
            let common = unbalanced.iter().find(|one| one.count < one.questions && one.family == *item.asked.family);
            of_result[item.cluster as usize] += match common {
                Some(common) => f32::from(u8::from(common.is_true_of(item))),
                None => 1.0 / item.asked.choices.len() as f32,
            };
        }
        Self { replies, missing }
    }

    /// The floor of a model that was asked without images, scaled to its number of replies at L0 (`clean`). `missing`
    /// is the number of missing replies at L0. `None` without a reply.
    pub(crate) fn from_blind(blind: &[ClusterCount], clean: &[ClusterCount], missing: &[u32]) -> Option<Self> {
        let sum = |counts: &[ClusterCount], count: fn(&ClusterCount) -> u32| -> f64 {
            counts.iter().map(|one| f64::from(count(one))).sum()
        };
        let replies = sum(blind, |count| count.replies);
        let (scale, share) = (sum(clean, |count| count.replies) / replies, sum(blind, |count| count.right) / replies);
        (replies > 0.0).then(|| Self {
            replies: blind.iter().map(|count| (f64::from(count.right) * scale) as f32).collect(),
            missing: missing.iter().map(|missing| (f64::from(*missing) * share) as f32).collect(),
        })
    }

    /// Expected number of right replies, of all replies at L0.
    fn total(&self) -> f64 {
        self.replies.iter().map(|right| f64::from(*right)).sum()
    }
}

/// First failing levels of the items, for one model in one variant, raw or with one enhancer.
#[derive(Debug)]
pub struct FirstFailure {
    /// Model, variant and enhancer, with the asked levels.
    pub curve: CurvePoints,
}

/// First failing levels for every curve of a grid.
#[must_use]
pub(crate) fn first_failures(grid: &Grid<'_>) -> Vec<FirstFailure> {
    CurvePoints::all(grid).into_iter().map(|curve| FirstFailure { curve }).collect()
}

impl FirstFailure {
    /// True if an item of the grid was asked on the curve.
    #[must_use]
    pub fn has_item(&self, grid: &Grid<'_>, item: usize) -> bool {
        grid.has_item(self.curve.subjects.iter().map(|(_, subject)| *subject), item)
    }

    /// First level at which an item of the grid is not answered correctly. `None` if no level fails, or if an earlier
    /// level has no reply.
    #[must_use]
    pub fn first(&self, grid: &Grid<'_>, item: usize) -> Option<AxisLevel> {
        for &(level, subject) in &self.curve.subjects {
            let chosen = grid.compared_result(subject, item).parsed(ParsingMode::Strict)?;
            if !grid.items[item].is_right(chosen) {
                return Some(level);
            }
        }
        None
    }
}
