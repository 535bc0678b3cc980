//! Paired differences between subjects, with their tests: [`Comparison`].

use std::collections::BTreeMap;

use super::choice::ReadingMode;
use super::grid::Grid;
use super::paired::PairedComparison;
use super::significance::holm;
use super::subject::Subject;
use crate::types::{AxisLevel, Family, KindReading, View};
use rayon::prelude::*;

/// The two sides of a comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ComparisonKind {
    /// A degraded level against L0, without an enhancer.
    Level,
    /// Sensor noise against exposure drop alone, at the same level.
    Variant,
    /// Enhanced against raw, at the same level and variant.
    Enhancer,
    /// One model against another in the same condition.
    Model,
    /// A model with images against a model without.
    Blind,
}

impl ComparisonKind {
    /// All kinds in the order of the tables.
    pub const ALL: [Self; 5] = [
        Self::Level,
        Self::Variant,
        Self::Enhancer,
        Self::Model,
        Self::Blind,
    ];

    /// The name of the kind in CSV files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Level => "level",
            Self::Variant => "variant",
            Self::Enhancer => "enhancer",
            Self::Model => "model",
            Self::Blind => "blind",
        }
    }
}

/// Result of a comparison at the 5 % level, after Holm's correction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Significance {
    /// The first subject is better.
    Better,
    /// The first subject is worse.
    Worse,
    /// No significant difference. This does not show that the two are equal.
    Tied,
}

impl Significance {
    /// The word for the result in tables.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Better => "better",
            Self::Worse => "worse",
            Self::Tied => "tied",
        }
    }
}

/// One subject against another on the items to which both replied, in the strict reading.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    pub kind: ComparisonKind,
    /// The first side: the degraded, the noisy, the enhanced, or the one with images.
    pub first: Subject,
    /// The second side, to which the first is compared.
    pub second: Subject,
    /// Question family; `None` for all families together.
    pub family: Option<Family>,
    pub paired: PairedComparison,
    /// p-value after Holm's correction over all comparisons of this kind and these models. Another model in the report
    /// therefore changes no result. Comparisons by family are corrected separately.
    pub holm: f64,
    pub significance: Significance,
}

/// All comparisons of a grid, ordered by kind, family and subjects.
#[must_use]
pub(crate) fn comparisons(grid: &Grid<'_>) -> Vec<Comparison> {
    let families = grid.groups();
    let mut jobs = Vec::new();
    for kind in ComparisonKind::ALL {
        let pairs = pairs(grid, kind);
        for family in &families {
            jobs.extend(pairs.iter().map(|(a, b)| (kind, *family, *a, *b)));
        }
    }
    let paired = jobs
        .into_par_iter()
        .filter_map(|(kind, family, first, second)| {
            Some(Comparison {
                kind,
                first: grid.subjects[first].clone(),
                second: grid.subjects[second].clone(),
                family: family.cloned(),
                paired: PairedComparison::new(grid, first, second, family, ReadingMode::Strict)?,
                holm: 1.0,
                significance: Significance::Tied,
            })
        });
    corrected(paired.collect())
}

/// The comparisons with their significance, after Holm's correction within each set.
fn corrected(mut all: Vec<Comparison>) -> Vec<Comparison> {
    let mut sets = BTreeMap::<_, Vec<usize>>::new();
    for (index, comparison) in all.iter().enumerate() {
        let models = (
            comparison.first.model.clone(),
            comparison.second.model.clone(),
        );
        let set = (comparison.kind, comparison.family.is_some(), models);
        sets.entry(set).or_default().push(index);
    }
    for set in sets.into_values() {
        let values: Vec<f64> = set.iter().map(|index| all[*index].paired.p).collect();
        for (index, holm) in set.into_iter().zip(holm(&values)) {
            let comparison = &mut all[index];
            comparison.holm = holm;
            comparison.significance = significance(comparison.paired.difference.value, holm);
        }
    }
    all
}

fn significance(difference: f64, p: f64) -> Significance {
    if p >= 0.05 {
        Significance::Tied
    } else if difference > 0.0 {
        Significance::Better
    } else {
        Significance::Worse
    }
}

/// The indices of the subjects that a kind compares.
pub(super) fn pairs(grid: &Grid<'_>, kind: ComparisonKind) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    for (index, subject) in grid.subjects.iter().enumerate() {
        let against: Vec<usize> = match kind {
            // Only raw images show what darkness costs. The curves show how much of it an enhancer recovers.
            ComparisonKind::Level
                if subject.variant.kind.is_some() && subject.enhancer.is_none() =>
            {
                let clean =
                    Subject::seeing(&subject.model, AxisLevel::L0, &KindReading::NONE, None);
                grid.find(&clean).into_iter().collect()
            }
            ComparisonKind::Variant => match subject
                .variant
                .kind
                .and_then(crate::types::degradation::Kind::base)
            {
                None => Vec::new(),
                // The same level of the base kind, which has no light readings.
                base => changed(grid, subject, |other| {
                    other.variant = KindReading {
                        kind: base,
                        reading: None,
                    };
                }),
            },
            ComparisonKind::Enhancer if subject.enhancer.is_some() => {
                changed(grid, subject, |other| other.enhancer = None)
            }
            ComparisonKind::Model => later_models(grid, index),
            ComparisonKind::Blind if subject.view == Some(View::Image) => blind(grid, subject),
            _ => Vec::new(),
        };
        pairs.extend(against.into_iter().map(|other| (index, other)));
    }
    pairs
}

/// The subject that differs from `subject` by a change only, if the grid has it.
fn changed(grid: &Grid<'_>, subject: &Subject, change: impl FnOnce(&mut Subject)) -> Vec<usize> {
    let mut other = subject.clone();
    change(&mut other);
    grid.find(&other).into_iter().collect()
}

/// Later models of the grid in the same condition, so that each pair occurs once. Built-in reference models are compared
/// only if there are no others.
fn later_models(grid: &Grid<'_>, index: usize) -> Vec<usize> {
    let subject = &grid.subjects[index];
    let has_others = grid.subjects.iter().any(|other| !other.is_reference());
    let is_left_out = |subject: &Subject| has_others && subject.is_reference();
    if is_left_out(subject) {
        return Vec::new();
    }
    let later = grid.subjects.iter().enumerate().skip(index + 1);
    let condition = |of: &Subject| (of.view, of.level, of.variant.clone(), of.enhancer.clone());
    later
        .filter(|(_, other)| other.model != subject.model && condition(other) == condition(subject))
        .filter(|(_, other)| !is_left_out(other))
        .map(|(other, _)| other)
        .collect()
}

/// The same model without images; if it was never asked so, all models without images.
fn blind(grid: &Grid<'_>, subject: &Subject) -> Vec<usize> {
    let all = || {
        let subjects = grid.subjects.iter().enumerate();
        subjects.filter(|(_, other)| other.view == Some(View::Blind))
    };
    let same_model: Vec<usize> = all()
        .filter(|(_, other)| other.model == subject.model)
        .map(|(index, _)| index)
        .collect();
    if same_model.is_empty() {
        all().map(|(index, _)| index).collect()
    } else {
        same_model
    }
}
