//! Every difference that is of interest, with its test: [`Comparison`].

use std::collections::BTreeMap;

use super::choice::ReadingMode;
use super::grid::Grid;
use super::paired::PairedComparison;
use super::significance::holm;
use super::subject::Subject;
use crate::types::{AxisLevel, Family, KindReading, View};
use rayon::prelude::*;

/// What is compared with what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ComparisonKind {
    /// A dark level with L0: what darkness costs.
    Level,
    /// Sensor noise with exposure drop alone, at one level.
    Variant,
    /// Enhanced with raw, at one level and variant.
    Enhancer,
    /// A model with another, in one condition.
    Model,
    /// A model that sees with one that has the words alone.
    Blind,
}

impl ComparisonKind {
    /// All, in the order of the tables.
    pub const ALL: [Self; 5] = [
        Self::Level,
        Self::Variant,
        Self::Enhancer,
        Self::Model,
        Self::Blind,
    ];

    /// The name in files.
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

/// What a comparison shows at the 5 % level, after Holm's correction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Significance {
    /// The first is better.
    Better,
    /// The first is worse.
    Worse,
    /// Nothing is shown; which is not to say that they are the same.
    Tied,
}

impl Significance {
    /// The word in tables.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Better => "better",
            Self::Worse => "worse",
            Self::Tied => "tied",
        }
    }
}

/// One subject against another on the items that both replied to, in the strict reading.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// What is compared.
    pub kind: ComparisonKind,
    /// The first: the darker, the noisy, the enhanced, the one that sees.
    pub first: Subject,
    /// What it is held against.
    pub second: Subject,
    /// The family; `None` for all.
    pub family: Option<Family>,
    /// The numbers.
    pub paired: PairedComparison,
    /// The p-value after Holm's correction over all comparisons of this kind and these models, so that another model in the
    /// report changes no verdict; those by family are corrected among themselves.
    pub holm: f64,
    /// What that shows.
    pub verdict: Significance,
}

/// All comparisons of a grid, by kind, family and subjects.
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
                verdict: Significance::Tied,
            })
        });
    corrected(paired.collect())
}

/// The comparisons with their verdicts, after Holm's correction within each set of them.
fn corrected(mut all: Vec<Comparison>) -> Vec<Comparison> {
    let mut sets = BTreeMap::<_, Vec<usize>>::new();
    for (index, one) in all.iter().enumerate() {
        let models = (one.first.model.clone(), one.second.model.clone());
        let set = (one.kind, one.family.is_some(), models);
        sets.entry(set).or_default().push(index);
    }
    for set in sets.into_values() {
        let values: Vec<f64> = set.iter().map(|index| all[*index].paired.p).collect();
        for (index, holm) in set.into_iter().zip(holm(&values)) {
            let one = &mut all[index];
            one.holm = holm;
            one.verdict = verdict(one.paired.difference.value, holm);
        }
    }
    all
}

fn verdict(difference: f64, p: f64) -> Significance {
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
            // Darkness is what raw images show; what an enhancer leaves of it is read from the curves.
            ComparisonKind::Level
                if subject.variant.kind.is_some() && subject.enhancer.is_none() =>
            {
                let light =
                    Subject::seeing(&subject.model, AxisLevel::L0, &KindReading::NONE, None);
                grid.find(&light).into_iter().collect()
            }
            ComparisonKind::Variant => match subject
                .variant
                .kind
                .and_then(crate::types::degradation::Kind::base)
            {
                None => Vec::new(),
                // The same level of the kind that it adds something to, which has no readings.
                base => one(grid, subject, |other| {
                    other.variant = KindReading {
                        kind: base,
                        reading: None,
                    };
                }),
            },
            ComparisonKind::Enhancer if subject.enhancer.is_some() => {
                one(grid, subject, |other| other.enhancer = None)
            }
            ComparisonKind::Model => later_models(grid, index),
            ComparisonKind::Blind if subject.view == Some(View::Image) => blind(grid, subject),
            _ => Vec::new(),
        };
        pairs.extend(against.into_iter().map(|other| (index, other)));
    }
    pairs
}

/// The subject that is another but for a change, where there is one.
fn one(grid: &Grid<'_>, subject: &Subject, change: impl FnOnce(&mut Subject)) -> Vec<usize> {
    let mut other = subject.clone();
    change(&mut other);
    grid.find(&other).into_iter().collect()
}

/// Other models in the same condition, each pair once.
fn later_models(grid: &Grid<'_>, index: usize) -> Vec<usize> {
    let subject = &grid.subjects[index];
    let later = grid.subjects.iter().enumerate().skip(index + 1);
    let light = |of: &Subject| (of.view, of.level, of.variant.clone(), of.enhancer.clone());
    later
        .filter(|(_, other)| other.model != subject.model && light(other) == light(subject))
        .map(|(other, _)| other)
        .collect()
}

/// The same model without images; all models without images where it was never asked so.
fn blind(grid: &Grid<'_>, subject: &Subject) -> Vec<usize> {
    let all = || {
        let subjects = grid.subjects.iter().enumerate();
        subjects.filter(|(_, other)| other.view == Some(View::Blind))
    };
    let own: Vec<usize> = all()
        .filter(|(_, other)| other.model == subject.model)
        .map(|(index, _)| index)
        .collect();
    if own.is_empty() {
        all().map(|(index, _)| index).collect()
    } else {
        own
    }
}
