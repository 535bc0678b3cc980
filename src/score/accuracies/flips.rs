//! First level at which each item is answered wrongly: [`FirstFailure`].

use super::curve::CurvePoints;
use crate::choice::ParsingMode;
use crate::grid::Grid;
use darkqa_base::types::AxisLevel;

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
    /// First level at which an item of the grid is not answered correctly. `None` if no level fails, or if an earlier
    /// level has no reply.
    #[must_use]
    pub fn first(&self, grid: &Grid<'_>, item: usize) -> Option<AxisLevel> {
        for &(level, subject) in &self.curve.subjects {
            let chosen = grid.result(subject, item).reading(ParsingMode::Strict)?;
            if !grid.items[item].is_right(chosen) {
                return Some(level);
            }
        }
        None
    }
}
