//! Where an item is lost and found again: [`Fall`] and [`Effect`].

use serde::Serialize;

use super::accuracy::Subject;
use super::choice::Mode;
use super::curve::Points;
use super::grid::Grid;
use crate::types::{EnhancerName, Level, Variant};

/// One model in one variant, raw or enhanced: at which level its items fail first.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fall {
    /// The model.
    pub model: String,
    /// The variant.
    pub variant: Variant,
    /// The enhancer; `None` for raw.
    pub enhancer: Option<EnhancerName>,
    /// By item of the grid: the first level at which it is not answered rightly; `None` where it never fails, or a level
    /// before has no reply.
    pub first: Vec<Option<Level>>,
}

impl Fall {
    /// How many items fail first at a level.
    #[must_use]
    pub fn count(&self, level: Level) -> usize {
        self.first
            .iter()
            .filter(|first| **first == Some(level))
            .count()
    }
}

/// Where items fail first, for every curve of a grid.
#[must_use]
pub fn falls(grid: &Grid<'_>) -> Vec<Fall> {
    let lines = Points::all(grid).into_iter().map(|points| {
        let first = (0..grid.items.len()).map(|item| first_failing(grid, &points, item));
        Fall {
            first: first.collect(),
            model: points.model,
            variant: points.variant,
            enhancer: points.enhancer,
        }
    });
    lines.collect()
}

fn first_failing(grid: &Grid<'_>, points: &Points, item: usize) -> Option<Level> {
    for &(level, subject) in &points.subjects {
        let chosen = grid.mark(subject, item).reading(Mode::Strict)?;
        if !grid.items[item].is_right(chosen) {
            return Some(level);
        }
    }
    None
}

/// What an enhancer does to one item.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Effect {
    /// Wrong raw, right enhanced.
    Rescued,
    /// Right raw, wrong enhanced.
    Harmed,
}

/// What the enhancer of a subject does to an item; `None` where nothing changes, or a reply is missing.
#[must_use]
pub fn effect(grid: &Grid<'_>, subject: usize, item: usize) -> Option<Effect> {
    let raw = Subject {
        enhancer: None,
        ..grid.subjects[subject].clone()
    };
    let raw = grid.find(&raw).filter(|raw| *raw != subject)?;
    let right = |subject: usize| {
        let chosen = grid.mark(subject, item).reading(Mode::Strict)?;
        Some(grid.items[item].is_right(chosen))
    };
    match (right(raw)?, right(subject)?) {
        (false, true) => Some(Effect::Rescued),
        (true, false) => Some(Effect::Harmed),
        _ => None,
    }
}
