//! Findings about noise, tested under each noise profile: [`FindingByProfile`].
//!
//! The paper's noise model can be interpreted in several ways; each interpretation is a noise profile. A conclusion
//! that holds under only one profile is a conclusion about that profile. Each finding is therefore computed under every
//! profile, on the same items and by the same formula, and the results are reported side by side. Only the paper's
//! levels, L1–L5, are tested. Holm's correction covers all claims of all models under all profiles (Holm 1979, Scand.
//! J. Stat. 6:65): without any effect, the report names none with a probability of 95 %.

use std::collections::BTreeSet;

use rayon::prelude::*;

use super::paired::{BoundedSums, net_bounds};
use super::tested::Tested;
use crate::choice::ParsingMode;
use crate::grid::{Grid, TrialResult};
use crate::model_in_condition::ModelInCondition;
use crate::significance::{ALPHA, holm};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{AxisLevel, EnhancerName, Family, ProfileName, RunGroup, Variant, View};

/// A claim about noise that may hold under one noise profile and not under another.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum NoiseHypothesis {
    /// Accuracy is lower with noise than with the exposure drop alone, at one level; `None` for L1–L5 together.
    NoiseCompounds(Option<AxisLevel>),
    /// Accuracy is lower at L5 with noise than at L0.
    DarknessCosts,
    /// An enhancer lowers accuracy where some light is left, at L1–L3.
    EnhancerHarms(EnhancerName),
    /// An enhancer raises accuracy in the dark, at L4–L5.
    EnhancerHelps(EnhancerName),
    /// Accuracy on a family is lower with noisy images of a level than without images.
    BelowBlind(Family, AxisLevel),
}

impl NoiseHypothesis {
    /// Name of the claim in files.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::NoiseCompounds(_) => "noise_compounds",
            Self::DarknessCosts => "darkness_costs",
            Self::EnhancerHarms(_) => "enhancer_harms",
            Self::EnhancerHelps(_) => "enhancer_helps",
            Self::BelowBlind(..) => "below_blind",
        }
    }

    /// True if the claim is that the first side is better than the second; false if the claim is that it is worse.
    fn expects_gain(&self) -> bool {
        matches!(self, Self::NoiseCompounds(_) | Self::EnhancerHelps(_))
    }

    /// Family of the claim; `None` for all families.
    #[must_use]
    pub fn family(&self) -> Option<&Family> {
        match self {
            Self::BelowBlind(family, _) => Some(family),
            _ => None,
        }
    }

    /// Enhancer of the claim, if it is about one.
    #[must_use]
    pub fn enhancer(&self) -> Option<&EnhancerName> {
        match self {
            Self::EnhancerHarms(name) | Self::EnhancerHelps(name) => Some(name),
            _ => None,
        }
    }

    /// Levels that the claim covers, asked or not.
    fn levels(&self) -> Vec<AxisLevel> {
        let levels = paper_levels();
        match self {
            Self::NoiseCompounds(None) => levels,
            Self::NoiseCompounds(Some(level)) | Self::BelowBlind(_, level) => vec![*level],
            Self::DarknessCosts => levels[4..].to_vec(),
            Self::EnhancerHarms(_) => levels[..3].to_vec(),
            Self::EnhancerHelps(_) => levels[3..].to_vec(),
        }
    }
}

/// The paper's levels, L1 to L5.
fn paper_levels() -> Vec<AxisLevel> {
    Kind::Sensor.ladder().iter().map(|severity| AxisLevel::new(Kind::Sensor, *severity)).collect()
}

/// Test result of a claim, after Holm's correction over all claims and profiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClaimVerdict {
    /// An effect in the direction of the claim is detected.
    Holds,
    /// An effect in the opposite direction is detected.
    Opposite,
    /// No effect is detected.
    Open,
}

impl ClaimVerdict {
    /// Word in tables and files.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Opposite => "opposite",
            Self::Open => "open",
        }
    }
}

/// Summary of the test results of a claim under all profiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Robustness {
    /// The claim holds under every profile of the report.
    All,
    /// The claim holds under some profiles, and the opposite is detected under none.
    Some,
    /// The claim holds under at least one profile, and the opposite is detected under another.
    Reversed,
    /// The claim holds under no profile, and the opposite is detected under at least one.
    None,
    /// Neither the claim nor its opposite is detected under any profile.
    Open,
}

impl Robustness {
    /// Words in tables and files.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::All => "under all",
            Self::Some => "under some",
            Self::Reversed => "reversed",
            Self::None => "under none",
            Self::Open => "open",
        }
    }
}

/// Effect of a claim under one noise profile.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectInProfile {
    /// Noise profile.
    pub profile: ProfileName,
    /// Accuracy of the first side minus that of the second, averaged over the levels; `n` is the number of items.
    /// `None` if a side was not asked.
    /// Holm's correction is over all claims and profiles.
    pub effect: Option<Tested>,
    /// Result of the claim; [`ClaimVerdict::Open`] without an effect.
    pub verdict: ClaimVerdict,
}

/// Test results of a claim about one model under every noise profile, on the same items.
#[derive(Debug, Clone, PartialEq)]
pub struct FindingByProfile {
    /// Model.
    pub model: String,
    /// Runs that showed these images, if the runs of the report showed different ones.
    pub group: Option<RunGroup>,
    /// Tested claim.
    pub claim: NoiseHypothesis,
    /// Levels asked under every profile, except profiles without any asked level.
    pub levels: Vec<AxisLevel>,
    /// The model asked without images that [`NoiseHypothesis::BelowBlind`] compares with, if it is not `model` itself.
    pub blind: Option<String>,
    /// Effect under each profile of the report, `paper` first.
    pub effects: Vec<EffectInProfile>,
    /// Summary over all profiles.
    pub robustness: Robustness,
    /// Number of items that were asked, but not answered on every side, level and profile. The effects hold for all
    /// values of the missing replies.
    pub dropped: usize,
}

/// Tests all claims of each model under every noise profile; empty if the grid has fewer than two profiles.
#[must_use]
pub(crate) fn by_profile(grid: &Grid<'_>) -> Vec<FindingByProfile> {
    let profiles: BTreeSet<&ProfileName> =
        noisy_subjects(grid).filter_map(|subject| subject.variant.reading.as_ref()).collect();
    if profiles.len() < 2 {
        return Vec::new();
    }
    let profiles: Vec<&ProfileName> = profiles.into_iter().collect();
    let models: BTreeSet<(&str, Option<&RunGroup>)> =
        noisy_subjects(grid).map(|subject| (&*subject.model, subject.variant.group.as_ref())).collect();
    let mut models: Vec<(&str, Option<&RunGroup>)> = models.into_iter().collect();
    models.sort_by_cached_key(|(model, _)| grid.listing.place(model));
    let tests: Vec<(&str, Option<&RunGroup>, NoiseHypothesis)> = models
        .into_iter()
        .flat_map(|(model, group)| claims(grid, model).into_iter().map(move |claim| (model, group, claim)))
        .collect();
    let findings: Vec<FindingByProfile> = tests
        .into_par_iter()
        .filter_map(|(model, group, claim)| {
            let lookup = SideLookup { grid, model, group };
            finding(&lookup, claim, &profiles)
        })
        .collect();
    with_holm_correction(findings)
}

/// Subjects with noisy images.
fn noisy_subjects<'g>(grid: &'g Grid<'_>) -> impl Iterator<Item = &'g ModelInCondition> {
    grid.subjects
        .iter()
        .filter(|subject| subject.view == Some(View::Image) && subject.variant.kind.is_some_and(Kind::has_profiles))
}

/// Claims to test for a model, in the order of the table.
fn claims(grid: &Grid<'_>, model: &str) -> Vec<NoiseHypothesis> {
    let enhancers: BTreeSet<&EnhancerName> = noisy_subjects(grid)
        .filter(|subject| subject.model == model)
        .filter_map(|subject| subject.enhancer.as_ref())
        .collect();
    let levels = paper_levels();
    let mut claims = vec![NoiseHypothesis::NoiseCompounds(None)];
    claims.extend(levels.iter().map(|level| NoiseHypothesis::NoiseCompounds(Some(*level))));
    claims.push(NoiseHypothesis::DarknessCosts);
    for name in enhancers {
        claims.push(NoiseHypothesis::EnhancerHarms(name.clone()));
        claims.push(NoiseHypothesis::EnhancerHelps(name.clone()));
    }
    for family in grid.families() {
        claims.extend(levels[3..].iter().rev().map(|level| NoiseHypothesis::BelowBlind(family.clone(), *level)));
    }
    claims
}

/// Finds the two sides of a claim about one model: the subjects that it compares.
struct SideLookup<'g, 'a> {
    grid: &'g Grid<'a>,
    model: &'g str,
    group: Option<&'g RunGroup>,
}

impl SideLookup<'_, '_> {
    /// Indices of the first and second subject of a claim at a level under a profile; `None` if the grid lacks one of
    /// them.
    fn find(&self, claim: &NoiseHypothesis, level: AxisLevel, profile: &ProfileName) -> Option<(usize, usize)> {
        let noisy = Variant {
            kind: Some(Kind::Sensor),
            reading: Some(profile.clone()),
            pair: None,
            group: self.group.cloned(),
        };
        let unenhanced = self.subject_index(level, &noisy, None)?;
        Some(match claim {
            NoiseHypothesis::NoiseCompounds(_) => {
                let base = Variant { kind: Kind::Sensor.base(), reading: None, ..noisy };
                (self.subject_index(level, &base, None)?, unenhanced)
            }
            NoiseHypothesis::DarknessCosts => {
                let clean = self.subject_index(AxisLevel::L0, &noisy, None)?;
                (unenhanced, clean)
            }
            NoiseHypothesis::EnhancerHarms(name) | NoiseHypothesis::EnhancerHelps(name) => {
                (self.subject_index(level, &noisy, Some(name))?, unenhanced)
            }
            NoiseHypothesis::BelowBlind(..) => (unenhanced, self.blind()?),
        })
    }

    fn subject_index(&self, level: AxisLevel, variant: &Variant, enhancer: Option<&EnhancerName>) -> Option<usize> {
        let subject = ModelInCondition::with_images(self.model, level, variant, enhancer);
        self.grid.find_up_to_group(&subject)
    }

    /// Index of the same model without images, or else of the only model without images.
    fn blind(&self) -> Option<usize> {
        let blind: Vec<(usize, &ModelInCondition)> =
            self.grid.subjects.iter().enumerate().filter(|(_, subject)| subject.view == Some(View::Blind)).collect();
        let own = blind.iter().find(|(_, other)| other.model == self.model);
        match (own, &blind[..]) {
            (Some((index, _)), _) | (None, [(index, _)]) => Some(*index),
            _ => None,
        }
    }
}

/// Tests a claim under every profile; `None` if no profile has replies to compare.
fn finding(lookup: &SideLookup<'_, '_>, claim: NoiseHypothesis, profiles: &[&ProfileName]) -> Option<FindingByProfile> {
    let levels: Vec<AxisLevel> = profiles
        .iter()
        .map(|profile| asked_levels(lookup, &claim, profile))
        .filter(|levels| !levels.is_empty())
        .reduce(|shared, levels| &shared & &levels)?
        .into_iter()
        .collect();
    let pairs: Vec<Vec<(usize, usize)>> = profiles
        .iter()
        .map(|profile| {
            levels.iter().map(|level| lookup.find(&claim, *level, profile)).collect::<Option<_>>().unwrap_or_default()
        })
        .collect();
    let shared = SharedItems::new(lookup.grid, &pairs, claim.family());
    let effects: Vec<Option<Tested>> = pairs.iter().map(|pairs| shared.effect(lookup.grid, pairs)).collect();
    if effects.iter().all(Option::is_none) {
        return None;
    }
    let blind = matches!(claim, NoiseHypothesis::BelowBlind(..))
        .then(|| lookup.blind())
        .flatten()
        .map(|index| lookup.grid.subjects[index].model.clone());
    Some(FindingByProfile {
        model: lookup.model.to_owned(),
        group: lookup.group.cloned(),
        robustness: Robustness::Open,
        claim,
        levels,
        blind: blind.filter(|name| name != lookup.model),
        effects: profiles
            .iter()
            .zip(effects)
            .map(|(profile, effect)| EffectInProfile {
                profile: (*profile).clone(),
                effect,
                verdict: ClaimVerdict::Open,
            })
            .collect(),
        dropped: shared.dropped,
    })
}

/// Levels of a claim at which both sides were asked under a profile.
fn asked_levels(lookup: &SideLookup<'_, '_>, claim: &NoiseHypothesis, profile: &ProfileName) -> BTreeSet<AxisLevel> {
    claim.levels().into_iter().filter(|level| lookup.find(claim, *level, profile).is_some()).collect()
}

/// Items of a family that are compared under all profiles.
struct SharedItems {
    /// Indices of the items with a reply on both sides of all pairs.
    answered: Vec<usize>,
    /// Indices of the other items that were asked on both sides of all pairs.
    missing: Vec<usize>,
    /// Number of items that were asked on any side, and are not answered on all.
    dropped: usize,
}

impl SharedItems {
    fn new(grid: &Grid<'_>, pairs: &[Vec<(usize, usize)>], family: Option<&Family>) -> Self {
        let subjects: BTreeSet<usize> = pairs.iter().flatten().flat_map(|(first, second)| [*first, *second]).collect();
        let mut shared = Self { answered: Vec::new(), missing: Vec::new(), dropped: 0 };
        for (index, item) in grid.items.iter().enumerate() {
            if !item.is_in_family(family) || !grid.has_item(subjects.iter().copied(), index) {
                continue;
            }
            let mut results = subjects.iter().map(|subject| grid.compared_result(*subject, index));
            if results.clone().all(TrialResult::is_reply) {
                shared.answered.push(index);
            } else if results.clone().all(TrialResult::is_asked) {
                shared.missing.push(index);
                shared.dropped += 1;
            } else {
                shared.dropped += usize::from(results.any(TrialResult::is_asked));
            }
        }
        shared
    }

    /// Tests the accuracy of the first sides minus that of the second sides, averaged over the pairs. `None` without
    /// pairs or answered items.
    fn effect(&self, grid: &Grid<'_>, pairs: &[(usize, usize)]) -> Option<Tested> {
        if pairs.is_empty() {
            return None;
        }
        let bounds = |index: usize| {
            let item = &grid.items[index];
            net_bounds(pairs.iter().map(|(first, second)| {
                [*first, *second].map(|subject| {
                    let reading = grid.compared_result(subject, index).parsed(ParsingMode::Strict);
                    reading.map(|chosen| item.is_right(chosen))
                })
            }))
        };
        let mut sums = BoundedSums::new(grid.clusters);
        for &index in &self.answered {
            sums.add(grid.items[index].cluster, bounds(index)[0]);
        }
        for &index in &self.missing {
            let [lowest, highest] = bounds(index);
            sums.add_missing(grid.items[index].cluster, lowest, highest);
        }
        Some(sums.test(pairs.len() as f64)?.tested)
    }
}

/// Fills in the corrected p-values, test results and summaries, with Holm's correction over all findings and profiles.
fn with_holm_correction(mut findings: Vec<FindingByProfile>) -> Vec<FindingByProfile> {
    let p_values: Vec<f64> = findings
        .iter()
        .flat_map(|finding| &finding.effects)
        .filter_map(|in_profile| in_profile.effect)
        .map(|effect| effect.p)
        .collect();
    let mut corrected = holm(&p_values).into_iter();
    for finding in &mut findings {
        let expects_gain = finding.claim.expects_gain();
        for EffectInProfile { effect, verdict, .. } in &mut finding.effects {
            if let Some(effect) = effect {
                effect.holm = corrected.next().unwrap_or(1.0);
                *verdict = claim_verdict(effect, expects_gain);
            }
        }
        finding.robustness = robustness(&finding.effects);
    }
    findings
}

/// Test result of a claim with this effect, by its corrected p-value and the sign of the difference.
fn claim_verdict(effect: &Tested, expects_gain: bool) -> ClaimVerdict {
    if effect.holm >= ALPHA {
        ClaimVerdict::Open
    } else if (effect.difference.value > 0.0) == expects_gain {
        ClaimVerdict::Holds
    } else {
        ClaimVerdict::Opposite
    }
}

/// Summarizes a claim over the profiles. A profile that was not asked has no effect, so the claim then cannot hold
/// under all.
fn robustness(effects: &[EffectInProfile]) -> Robustness {
    let [holding, opposite] = [ClaimVerdict::Holds, ClaimVerdict::Opposite]
        .map(|verdict| effects.iter().filter(|effect| effect.verdict == verdict).count());
    match (holding, opposite) {
        (0, 0) => Robustness::Open,
        (0, _) => Robustness::None,
        (holding, 0) if holding == effects.len() => Robustness::All,
        (_, 0) => Robustness::Some,
        _ => Robustness::Reversed,
    }
}

#[cfg(test)]
mod tests;
