//! Synthetic images that dark photographs are compared with: [`equally_dark`].

use std::collections::BTreeMap;

use crate::grid::Grid;
use crate::model_in_condition::ModelInCondition;
use crate::photographs::pair_darkness::{PairDarkness, pair_facts};
use darkqa_base::types::degradations::Axis;
use darkqa_base::types::{Variant, View};

/// Maximum distance in EV between a photograph and a level that it is compared with (chosen: half of the largest step
/// of the paper's levels).
const MAX_DISTANCE_EV: f64 = 1.0;

/// Finds the subjects of the same model, raw or with the same enhancer, whose synthetic images are as dark as the
/// photographs of a subject, preferably frame by frame; otherwise, for each variant, the level nearest to the median
/// drop of the photographs, if one is near.
pub(super) fn equally_dark(grid: &Grid<'_>, photographed: usize) -> Vec<usize> {
    let subject = &grid.subjects[photographed];
    let facts = pair_facts(grid, photographed);
    let others: Vec<(usize, &ModelInCondition)> = grid
        .subjects
        .iter()
        .enumerate()
        .filter(|(_, other)| {
            other.view == Some(View::Image)
                && other.model == subject.model
                && other.enhancer == subject.enhancer
                && other.variant.group == subject.variant.group
        })
        .collect();
    let matches: Vec<usize> = others
        .iter()
        .filter(|(_, other)| other.variant.pair.is_some() && other.variant.synthetic_kind().is_some())
        .map(|(index, _)| *index)
        .filter(|index| {
            // Images may be made as dark as another photograph of the same frames; these do not match.
            let other_facts = pair_facts(grid, *index);
            let shared: Vec<_> =
                other_facts.iter().filter_map(|(frame, other)| Some((other, facts.get(frame)?))).collect();
            !shared.is_empty() && shared.iter().all(|(one, other)| one == other)
        })
        .collect();
    if !matches.is_empty() {
        return matches;
    }
    let facts: Vec<_> = facts.into_values().collect();
    let Some(darkness) = subject.variant.photograph().and_then(|name| PairDarkness::new(name, &facts)) else {
        return Vec::new();
    };
    let mut nearest = BTreeMap::<&Variant, (f64, usize)>::new();
    for (index, other) in others {
        let distance = other
            .level
            .filter(|level| level.axis() == Some(Axis::LIGHT))
            .map(|level| (level.value() - darkness.synthesis).abs())
            .filter(|distance| *distance <= MAX_DISTANCE_EV);
        if let Some(distance) = distance {
            let best = nearest.entry(&other.variant).or_insert((distance, index));
            if distance < best.0 {
                *best = (distance, index);
            }
        }
    }
    nearest.into_values().map(|(_, index)| index).collect()
}
