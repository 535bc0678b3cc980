//! Where an item is lost: [`FirstFailure`].

use super::choice::ReadingMode;
use super::curve::CurvePoints;
use super::grid::Grid;
use crate::types::{AxisLevel, EnhancerName, KindReading};

/// One model in one variant, raw or enhanced: at which level its items fail first.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstFailure {
    /// The model.
    pub model: String,
    /// The variant.
    pub variant: KindReading,
    /// The enhancer; `None` for raw.
    pub enhancer: Option<EnhancerName>,
    /// By item of the grid: the first level at which it is not answered rightly; `None` where it never fails, or a level
    /// before has no reply.
    pub first: Vec<Option<AxisLevel>>,
}

/// Where items fail first, for every curve of a grid.
#[must_use]
pub(crate) fn falls(grid: &Grid<'_>) -> Vec<FirstFailure> {
    let lines = CurvePoints::all(grid).into_iter().map(|points| {
        let first = (0..grid.items.len()).map(|item| first_failing(grid, &points, item));
        FirstFailure {
            first: first.collect(),
            model: points.model,
            variant: points.variant,
            enhancer: points.enhancer,
        }
    });
    lines.collect()
}

fn first_failing(grid: &Grid<'_>, points: &CurvePoints, item: usize) -> Option<AxisLevel> {
    for &(level, subject) in &points.subjects {
        let chosen = grid.mark(subject, item).reading(ReadingMode::Strict)?;
        if !grid.items[item].is_right(chosen) {
            return Some(level);
        }
    }
    None
}
