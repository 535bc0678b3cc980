//! Summaries of accuracy over all levels: [`Curve`].

use rayon::prelude::*;

use crate::bootstrap::Resamples;
use crate::choice::ParsingMode;
use crate::estimate::ClusterCount;
use crate::grid::{Grid, TrialResult};
use crate::model_in_condition::ModelInCondition;
use crate::threshold::{CurveSummary, LevelCounts};
use darkqa_ground::types::degradations::Kind;
use darkqa_ground::types::{Axis, AxisLevel, EnhancerName, Family, RunGroup, Variant, View};

/// Summary of one model over all levels, in one variant, raw or with one enhancer.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    pub model: String,
    pub variant: Variant,
    /// Enhancer; `None` for raw images.
    pub enhancer: Option<EnhancerName>,
    /// Question family; `None` for all families together.
    pub family: Option<Family>,
    /// True if the floor is the accuracy of the model itself without images; false if guessing is the floor.
    pub floor_is_blind: bool,
    /// Threshold and area in the strict parsing, which is the main result.
    pub summary: CurveSummary,
    /// Threshold and area in the lenient parsing.
    pub lenient: CurveSummary,
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
        match mode {
            ParsingMode::Strict => &self.summary,
            ParsingMode::Lenient => &self.lenient,
        }
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
                                || subject.variant == *variant
                                    && subject.enhancer.as_ref() == enhancer)
                    })
                    .filter_map(|(index, subject)| Some((subject.level?, index)))
                    .collect();
                subjects.sort_unstable();
                Self {
                    model: model.to_owned(),
                    variant: variant.clone(),
                    enhancer: enhancer.cloned(),
                    subjects,
                }
            })
            .filter(|points| points.subjects.len() > 1 && points.subjects[0].0 == AxisLevel::L0)
            .collect()
    }
}

/// Computes all curves of a grid: each model in each variant, raw and with each enhancer. A curve needs L0 and at least one degraded level.
#[must_use]
pub fn curves(grid: &Grid<'_>, draws: &Resamples, family: Option<&Family>) -> Vec<Curve> {
    CurvePoints::all(grid)
        .into_par_iter()
        .filter_map(|points| curve(grid, draws, family, points))
        .collect()
}

fn curve(
    grid: &Grid<'_>,
    draws: &Resamples,
    family: Option<&Family>,
    points: CurvePoints,
) -> Option<Curve> {
    let subjects = &points.subjects;
    let missing: Vec<Vec<u32>> = subjects
        .iter()
        .map(|(_, subject)| grid.failed(*subject, family))
        .collect();
    let blind = grid.find_up_to_group(&ModelInCondition::new(&points.model, None));
    let [(strict, floor_is_blind), (lenient, _)] = ParsingMode::ALL.map(|mode| {
        let counts: Vec<Vec<ClusterCount>> = subjects
            .iter()
            .map(|(_, subject)| grid.counts(*subject, family, mode))
            .collect();
        let guessing = Floor::of_guessing(grid, subjects[0].1, family);
        let seeing_nothing = blind.and_then(|blind| {
            Floor::of_blind(&grid.counts(blind, family, mode), &counts[0], &missing[0])
        });
        // Only what images add can be lost in the dark; without an image the model may still be worse than a guess.
        let floor = seeing_nothing.filter(|floor| floor.total() > guessing.total());
        let is_blind = floor.is_some();
        let floor = floor.unwrap_or(guessing);
        let levels = LevelCounts {
            levels: subjects.iter().map(|(level, _)| *level).collect(),
            counts,
            missing: missing.clone(),
            guesses: floor.replies,
            missing_guesses: floor.missing,
        };
        (levels, is_blind)
    });
    let summary = strict.summary(draws)?;
    Some(Curve {
        lenient: if lenient.counts == strict.counts {
            summary.clone()
        } else {
            lenient.summary(draws)?
        },
        floor_is_blind,
        summary,
        model: points.model,
        variant: points.variant,
        enhancer: points.enhancer,
        family: family.cloned(),
    })
}

/// Expected numbers of right replies at L0 without the image, by cluster.
pub(crate) struct Floor {
    /// Among the replies.
    pub(crate) replies: Vec<f32>,
    /// Among the missing replies.
    pub(crate) missing: Vec<f32>,
}

impl Floor {
    /// The floor of guessing.
    fn of_guessing(grid: &Grid<'_>, clean: usize, family: Option<&Family>) -> Self {
        Self {
            replies: guesses(grid, clean, family, TrialResult::is_reply),
            missing: guesses(grid, clean, family, |result| result == TrialResult::Failed),
        }
    }

    /// The floor of a model that was asked without images, scaled to its number of replies at L0 (`clean`). `missing` is the number of
    /// missing replies at L0. `None` without a reply.
    pub(crate) fn of_blind(
        blind: &[ClusterCount],
        clean: &[ClusterCount],
        missing: &[u32],
    ) -> Option<Self> {
        let sum = |counts: &[ClusterCount], count: fn(&ClusterCount) -> u32| -> f64 {
            counts.iter().map(|one| f64::from(count(one))).sum()
        };
        let replies = sum(blind, |count| count.replies);
        let (scale, share) = (
            sum(clean, |count| count.replies) / replies,
            sum(blind, |count| count.right) / replies,
        );
        (replies > 0.0).then(|| Self {
            replies: blind
                .iter()
                .map(|count| (f64::from(count.right) * scale) as f32)
                .collect(),
            missing: missing
                .iter()
                .map(|missing| (f64::from(*missing) * share) as f32)
                .collect(),
        })
    }

    /// Expected number of right replies, of all replies at L0.
    fn total(&self) -> f64 {
        self.replies.iter().map(|right| f64::from(*right)).sum()
    }
}

/// Expected number of right guesses among the results at L0 for which `counts` is true, by cluster.
fn guesses(
    grid: &Grid<'_>,
    clean: usize,
    family: Option<&Family>,
    counts: impl Fn(TrialResult) -> bool,
) -> Vec<f32> {
    let mut guesses = vec![0.0_f32; grid.clusters];
    for (item, result) in grid.family_items(clean, family) {
        if counts(result) {
            guesses[item.cluster as usize] += 1.0 / item.asked.choices.len() as f32;
        }
    }
    guesses
}
