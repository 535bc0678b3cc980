//! Summaries of accuracy over all levels: [`Curve`].

use rayon::prelude::*;

use crate::bootstrap::Resamples;
use crate::choice::ParsingMode;
use crate::grid::{Grid, TrialResult};
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
    let [strict, lenient] = ParsingMode::ALL.map(|mode| LevelCounts {
        levels: subjects.iter().map(|(level, _)| *level).collect(),
        counts: subjects
            .iter()
            .map(|(_, subject)| grid.counts(*subject, family, mode))
            .collect(),
        guesses: guesses(grid, subjects[0].1, family),
    });
    let summary = strict.summary(draws)?;
    Some(Curve {
        lenient: if lenient.counts == strict.counts {
            summary.clone()
        } else {
            lenient.summary(draws)?
        },
        summary,
        model: points.model,
        variant: points.variant,
        enhancer: points.enhancer,
        family: family.cloned(),
    })
}

/// Expected number of right guesses among the replies at L0, by cluster.
fn guesses(grid: &Grid<'_>, clean: usize, family: Option<&Family>) -> Vec<f32> {
    let mut guesses = vec![0.0_f32; grid.clusters];
    for (item, result) in grid.family_items(clean, family) {
        if let TrialResult::Read { .. } = result {
            guesses[item.cluster as usize] += 1.0 / item.asked.choices.len() as f32;
        }
    }
    guesses
}
