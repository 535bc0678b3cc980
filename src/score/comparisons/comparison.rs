//! Paired differences between subjects, with their tests: [`Comparison`].
//!
//! Synthetic images that dark photographs are compared with: [`equally_dark`].

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::paired::PairedComparison;
use super::tested::Claim;
use crate::choice::ParsingMode;
use crate::grid::Grid;
use crate::model_in_condition::{ModelInCondition, models_under_test};
use crate::photographs::{PairDarkness, pair_facts};
use crate::significance::{PValues, Verdict};
use darkqa_base::types::degradations::Axis;
use darkqa_base::types::{AxisLevel, EnhancerName, Family, PairDark, Variant, View};

/// The two sides of a comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ComparisonKind {
    /// A degraded level against L0, without an enhancer.
    Level,
    /// Sensor noise against exposure drop alone, at the same level.
    Variant,
    /// Enhanced against raw, at the same level and variant.
    Enhancer,
    /// One enhancer against another, at the same level and variant.
    EnhancerPair,
    /// One model against another in the same condition.
    Model,
    /// A model with images against a model without.
    Blind,
    /// A model against itself with other images of the same frames at the same level.
    Light,
    /// A dark photograph against synthetic images of the same darkness, raw or with the same enhancer.
    RealSynthetic,
    /// A dark photograph, enhanced against raw.
    RealEnhanced,
}

impl ComparisonKind {
    /// All kinds in the order of the tables.
    pub const ALL: [Self; 9] = [
        Self::Level,
        Self::Variant,
        Self::Enhancer,
        Self::EnhancerPair,
        Self::Model,
        Self::Blind,
        Self::Light,
        Self::RealSynthetic,
        Self::RealEnhanced,
    ];

    /// Name of the kind in CSV files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Level => "level",
            Self::Variant => "variant",
            Self::Enhancer => "enhancer",
            Self::EnhancerPair => "enhancers",
            Self::Model => "model",
            Self::Blind => "blind",
            Self::Light => "light",
            Self::RealSynthetic => "real-synthetic",
            Self::RealEnhanced => "real-enhanced",
        }
    }
}

/// Minimum number of shared items for a verdict in comparisons that may be across runs: two models, or two kinds of
/// images (chosen). In all other kinds, one run asked both sides the same items.
pub const MIN_PAIRS: usize = 30;

/// One subject against another on the items to which both replied, in both parsings.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    pub kind: ComparisonKind,
    /// First side: the degraded, noisy or enhanced one, or the one with images.
    pub first: ModelInCondition,
    /// Second side, to which the first is compared.
    pub second: ModelInCondition,
    /// Question family; `None` for all families together.
    pub family: Option<Family>,
    /// Comparison in the strict parsing, which is the main result.
    ///
    /// Holm's correction is over all comparisons of this kind and these models, so that another model in the report
    /// changes no result. Comparisons by family are corrected separately.
    pub strict: PairedComparison,
    /// Comparison in the lenient parsing.
    pub lenient: PairedComparison,
    /// Smallest corrected p-value that the clusters of this comparison allow, however large the difference is.
    pub least_holm: f64,
}

impl Comparison {
    /// True if the sides share too few items for a verdict.
    #[must_use]
    pub fn is_too_small(&self) -> bool {
        let may_cross_runs = matches!(self.kind, ComparisonKind::Model | ComparisonKind::Light);
        may_cross_runs && self.strict.tested.difference.n < MIN_PAIRS
    }

    /// Statement that sentences may make.
    #[must_use]
    pub fn claim(&self) -> Claim {
        Claim::new([&self.strict.tested, &self.lenient.tested], |gain| gain)
    }

    /// Verdict in tables, the same as in sentences; `None` if no sentence is about the comparison.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        self.claim().verdict(&self.strict.tested)
    }

    pub(crate) fn parsed_mut(&mut self, mode: ParsingMode) -> &mut PairedComparison {
        mode.of([&mut self.strict, &mut self.lenient])
    }

    /// Comparison in a parsing.
    #[must_use]
    pub fn parsed(&self, mode: ParsingMode) -> &PairedComparison {
        mode.of([&self.strict, &self.lenient])
    }
}

/// Maximum number of comparisons for a ranking of models, and between enhancers (chosen); they take at most a gigabyte
/// each.
const MAX_COMPARISONS: usize = 500_000;

/// True if models are ranked. The number of pairs grows with the square of the number of models, so it is limited.
#[must_use]
pub fn ranks_models(grid: &Grid<'_>) -> bool {
    let models: BTreeSet<&str> = grid.subjects.iter().map(|s| &*s.model).collect();
    let pairs = grid.subjects.len() * models.len().saturating_sub(1) / 2;
    pairs.saturating_mul(grid.groups().len()) <= MAX_COMPARISONS
}

/// Maximum number of models that are compared pair by pair (chosen): a reader compares no 8,128 pairs of 128 models, and
/// the tables and time of a report would be those of the pairs.
pub const MAX_COMPARED_MODELS: usize = 12;

/// Models that are compared pair by pair, sorted: the models under test, or the [`MAX_COMPARED_MODELS`] with the highest
/// mean accuracy over the raw degraded conditions of the main variant, or over all conditions without such.
///
/// The choice goes by the replies that are compared, so the differences among the chosen models are a little smaller
/// than those between all. A pair is corrected over its own comparisons alone ([`Comparison::strict`]), so that its
/// result does not depend on the choice.
#[must_use]
pub fn compared_models<'g>(grid: &'g Grid<'_>) -> BTreeSet<&'g str> {
    let all = models_under_test(grid.subjects.iter().map(|subject| &*subject.model));
    if all.len() <= MAX_COMPARED_MODELS {
        return all;
    }
    let main = grid.main_variant();
    let mean = |model: &str, is_dark: bool| {
        let own = grid.subjects.iter().enumerate().filter(|(_, subject)| {
            let is_shown = !is_dark || (main.as_ref() == Some(&subject.variant) && subject.enhancer.is_none());
            subject.model == model && is_shown
        });
        let accuracies: Vec<f64> = own
            .filter_map(|(index, _)| grid.accuracy(index, None, ParsingMode::Strict))
            .map(|accuracy| accuracy.value)
            .collect();
        (!accuracies.is_empty()).then(|| accuracies.iter().sum::<f64>() / accuracies.len() as f64)
    };
    let mut ranked: Vec<(&str, f64)> =
        all.into_iter().filter_map(|model| Some((model, mean(model, true).or_else(|| mean(model, false))?))).collect();
    ranked.sort_by(|(one, a), (other, b)| b.total_cmp(a).then(one.cmp(other)));
    ranked.into_iter().take(MAX_COMPARED_MODELS).map(|(model, _)| model).collect()
}

/// True if enhancers are compared with each other. The number of pairs grows with the square of the number of
/// enhancers, so it is limited.
#[must_use]
pub fn compares_enhancers(grid: &Grid<'_>) -> bool {
    let enhanced = grid.subjects.iter().filter_map(|s| s.enhancer.as_ref());
    let enhancers: BTreeSet<&EnhancerName> = enhanced.clone().collect();
    let pairs = enhanced.count() * enhancers.len().saturating_sub(1) / 2;
    pairs.saturating_mul(grid.groups().len()) <= MAX_COMPARISONS
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
    corrected(uncorrected(grid, jobs))
}

/// A kind, a family, and the indices of the two sides.
type Pairing<'a> = (ComparisonKind, Option<&'a Family>, usize, usize);

/// Computes the comparisons that have items, before correction.
fn uncorrected(grid: &Grid<'_>, jobs: Vec<Pairing<'_>>) -> Vec<Comparison> {
    jobs.into_par_iter()
        .filter_map(|(kind, family, first, second)| {
            let strict = PairedComparison::new(grid, first, second, family, ParsingMode::Strict)?;
            let differs = grid.parsings_differ(first) || grid.parsings_differ(second);
            let lenient = if differs {
                PairedComparison::new(grid, first, second, family, ParsingMode::Lenient)?
            } else {
                strict.clone()
            };
            Some(Comparison {
                kind,
                first: grid.subjects[first].clone(),
                second: grid.subjects[second].clone(),
                family: family.cloned(),
                strict,
                lenient,
                least_holm: 1.0,
            })
        })
        .collect()
}

/// Comparisons of the kind [`Light`](ComparisonKind::Light) between different names of one model, which was asked in
/// the same way under each name.
#[must_use]
pub(crate) fn lights_between(grid: &Grid<'_>, names: &[String]) -> Vec<Comparison> {
    let named: Vec<(usize, &ModelInCondition)> =
        grid.subjects.iter().enumerate().filter(|(_, subject)| names.contains(&subject.model)).collect();
    let mut pairs = Vec::new();
    for (position, (index, subject)) in named.iter().enumerate() {
        pairs.extend(
            named[position + 1..]
                .iter()
                .filter(|(_, other)| other.model != subject.model && is_other_light(subject, other))
                .map(|(other, _)| (*index, *other)),
        );
    }
    let mut jobs = Vec::new();
    for family in grid.groups() {
        jobs.extend(pairs.iter().map(|(first, second)| (ComparisonKind::Light, family, *first, *second)));
    }
    corrected(uncorrected(grid, jobs))
}

/// Fills in the significance of the comparisons, after Holm's correction within each set.
fn corrected(mut all: Vec<Comparison>) -> Vec<Comparison> {
    let mut sets = BTreeMap::<_, Vec<usize>>::new();
    for (index, comparison) in all.iter().enumerate() {
        let models = (comparison.first.model.clone(), comparison.second.model.clone());
        let set = (comparison.kind, comparison.family.is_some(), models);
        sets.entry(set).or_default().push(index);
    }
    for set in sets.into_values() {
        let own = set.iter().map(|index| &all[*index]);
        let [strict, lenient] = ParsingMode::ALL.map(|mode| {
            let paired = own.clone().map(|found| found.parsed(mode));
            let tests: Vec<PValues> = paired.map(PairedComparison::p_values).collect();
            PValues::corrected(&tests)
        });
        for (position, index) in set.into_iter().enumerate() {
            let comparison = &mut all[index];
            let is_too_small = comparison.is_too_small();
            comparison.least_holm = strict[position].least;
            for (paired, corrected) in
                [(&mut comparison.strict, strict[position]), (&mut comparison.lenient, lenient[position])]
            {
                let tested = &mut paired.tested;
                tested.correct(tested.difference.value, corrected);
                if is_too_small {
                    tested.verdict = Verdict::TooFew;
                }
            }
        }
    }
    all
}

/// Indices of the subjects that a kind compares.
pub(super) fn pairs(grid: &Grid<'_>, kind: ComparisonKind) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    let compares_enhancers = compares_enhancers(grid);
    let compared = if kind == ComparisonKind::Model { compared_models(grid) } else { BTreeSet::new() };
    for (index, subject) in grid.subjects.iter().enumerate() {
        let against: Vec<usize> = match kind {
            // Only raw images show the cost of darkness. The curves show how much of it an enhancer recovers.
            ComparisonKind::Level if subject.variant.is_degraded() && subject.enhancer.is_none() => {
                let clean = ModelInCondition::with_images(&subject.model, AxisLevel::L0, &subject.variant, None);
                grid.find_up_to_group(&clean).into_iter().collect()
            }
            ComparisonKind::Variant => {
                match subject.variant.kind.and_then(darkqa_base::types::degradations::Kind::base) {
                    None => Vec::new(),
                    // The same level of the base kind, which has no noise profiles.
                    base => find_changed(grid, subject, |other| {
                        other.variant =
                            Variant { kind: base, reading: None, pair: None, group: subject.variant.group.clone() };
                    }),
                }
            }
            ComparisonKind::Enhancer | ComparisonKind::RealEnhanced
                if subject.enhancer.is_some()
                    && subject.variant.photograph().is_some() == (kind == ComparisonKind::RealEnhanced) =>
            {
                find_changed(grid, subject, |other| other.enhancer = None)
            }
            ComparisonKind::RealSynthetic if subject.variant.photograph().is_some() => equally_dark(grid, index),
            ComparisonKind::EnhancerPair if compares_enhancers && subject.enhancer.is_some() => {
                later_enhancers(grid, index)
            }
            ComparisonKind::Model => later_models(grid, index, &compared),
            ComparisonKind::Light => later_lights(grid, index),
            ComparisonKind::Blind if subject.view == Some(View::Image) => blind(grid, subject),
            _ => Vec::new(),
        };
        pairs.extend(against.into_iter().map(|other| (index, other)));
    }
    pairs
}

/// Finds the subject that differs from `subject` only by a change, if the grid contains it.
fn find_changed(grid: &Grid<'_>, subject: &ModelInCondition, change: impl FnOnce(&mut ModelInCondition)) -> Vec<usize> {
    let mut other = subject.clone();
    change(&mut other);
    grid.find_up_to_group(&other).into_iter().collect()
}

/// Other enhancers of the same model at the same level and variant, later in the order of names, so that each pair
/// occurs once.
fn later_enhancers(grid: &Grid<'_>, index: usize) -> Vec<usize> {
    let subject = &grid.subjects[index];
    // The subjects of a model are sorted by level, variant and enhancer.
    grid.subjects
        .iter()
        .enumerate()
        .skip(index + 1)
        .take_while(|(_, other)| {
            (&other.model, other.level, &other.variant) == (&subject.model, subject.level, &subject.variant)
        })
        .map(|(other, _)| other)
        .collect()
}

/// Later models of the grid in the same condition, so that each pair occurs once. Only models in `compared` are
/// compared.
fn later_models(grid: &Grid<'_>, index: usize, compared: &BTreeSet<&str>) -> Vec<usize> {
    let subject = &grid.subjects[index];
    if !compared.contains(&*subject.model) {
        return Vec::new();
    }
    let condition = |of: &ModelInCondition| (of.view, of.level, of.variant.clone(), of.enhancer.clone());
    grid.subjects
        .iter()
        .enumerate()
        .skip(index + 1)
        .filter(|(_, other)| other.model != subject.model && condition(other) == condition(subject))
        .filter(|(_, other)| compared.contains(&*other.model))
        .map(|(other, _)| other)
        .collect()
}

/// Later subjects of the grid with the same model at the same level, raw or with the same enhancer, but in another
/// noise profile or with images of other runs.
fn later_lights(grid: &Grid<'_>, index: usize) -> Vec<usize> {
    let subject = &grid.subjects[index];
    grid.subjects
        .iter()
        .enumerate()
        .skip(index + 1)
        .filter(|(_, other)| other.model == subject.model && is_other_light(subject, other))
        .map(|(other, _)| other)
        .collect()
}

/// True if two subjects have the same level, raw or with the same enhancer, but another noise profile or images of
/// other runs.
fn is_other_light(one: &ModelInCondition, other: &ModelInCondition) -> bool {
    (one.view, one.level) == (other.view, other.level)
        && (one.variant.kind, &one.enhancer) == (other.variant.kind, &other.enhancer)
        && one.variant.pair.as_ref().map(PairDark::without_profile)
            == other.variant.pair.as_ref().map(PairDark::without_profile)
        && one.variant != other.variant
}

/// Indices of the same model without images; if it was never asked without images, of all models without images.
fn blind(grid: &Grid<'_>, subject: &ModelInCondition) -> Vec<usize> {
    let (same_model, others) = (0..grid.subjects.len())
        .filter(|index| grid.subjects[*index].view == Some(View::Blind))
        .partition::<Vec<_>, _>(|index| grid.subjects[*index].model == subject.model);
    if same_model.is_empty() { others } else { same_model }
}

/// Maximum distance in EV between a photograph and a level that it is compared with (chosen: half of the largest step
/// of the paper's levels).
const MAX_DISTANCE_EV: f64 = 1.0;

/// Finds the subjects of the same model, raw or with the same enhancer, whose synthetic images are as dark as the
/// photographs of a subject, preferably frame by frame; otherwise, for each variant, the level nearest to the median
/// drop of the photographs, if one is near.
fn equally_dark(grid: &Grid<'_>, photographed: usize) -> Vec<usize> {
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
