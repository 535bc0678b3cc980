//! The level at which an item is first answered wrongly: [`FirstFailure`].

use super::choice::ReadingMode;
use super::curve::CurvePoints;
use super::grid::Grid;
use crate::types::{AxisLevel, EnhancerName, KindReading};

/// First failing level of each item, for one model in one variant, raw or with one enhancer.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstFailure {
    pub model: String,
    pub variant: KindReading,
    /// Enhancer; `None` for raw images.
    pub enhancer: Option<EnhancerName>,
    /// For each item of the grid, the first level at which it is not answered correctly. `None` if it never fails, or if a
    /// level before that has no reply.
    pub first: Vec<Option<AxisLevel>>,
}

/// First failing levels for every curve of a grid.
#[must_use]
pub(crate) fn first_failures(grid: &Grid<'_>) -> Vec<FirstFailure> {
    let curves = CurvePoints::all(grid).into_iter().map(|points| {
        let first = (0..grid.items.len()).map(|item| first_failing(grid, &points, item));
        FirstFailure {
            first: first.collect(),
            model: points.model,
            variant: points.variant,
            enhancer: points.enhancer,
        }
    });
    curves.collect()
}

fn first_failing(grid: &Grid<'_>, points: &CurvePoints, item: usize) -> Option<AxisLevel> {
    for &(level, subject) in &points.subjects {
        let chosen = grid.result(subject, item).reading(ReadingMode::Strict)?;
        if !grid.items[item].is_right(chosen) {
            return Some(level);
        }
    }
    None
}
