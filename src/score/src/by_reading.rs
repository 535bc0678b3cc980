//! [`FindingByReading`]: a finding about noise, tested under each light reading.
//!
//! The paper's noise model can be interpreted in several ways. A conclusion that holds under one of them alone is a conclusion about that
//! interpretation. So each finding is computed under every reading on the same items, by the same formula, and the results are reported
//! next to each other. Only the levels of the paper, L1–L5, count. Holm's correction covers all claims of all models under all readings
//! (Holm 1979, Scand. J. Stat. 6:65), so that a report without any effect names none with 95 % probability.

use std::collections::BTreeSet;

use rayon::prelude::*;

use super::choice::ReadingMode;
use super::estimate::Estimate;
use super::grid::Grid;
use super::paired::{ClusterNet, PairedTest};
use super::significance::{ALPHA, holm};
use super::subject::Subject;
use darkqa_ground::types::degradation::Kind;
use darkqa_ground::types::{
    AxisLevel, EnhancerName, Family, KindReading, LightGroup, ReadingName, View,
};

/// A statement about noise that may hold under one light reading and not under another.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum NoiseHypothesis {
    /// With noise, accuracy is lower than by the exposure drop alone: L1–L5 together, or one level.
    NoiseCompounds(Option<AxisLevel>),
    /// Darkness with noise costs accuracy: L5 against L0.
    DarknessCosts,
    /// An enhancer harms where light is left, L1–L3.
    EnhancerHarms(EnhancerName),
    /// An enhancer helps in the dark, L4–L5.
    EnhancerHelps(EnhancerName),
    /// A family is answered worse with a noisy image of a level than without images.
    BelowBlind(Family, AxisLevel),
}

impl NoiseHypothesis {
    /// The word in files.
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

    /// Whether the claim is that the first side is better than the second; else that it is worse.
    fn is_gain(&self) -> bool {
        matches!(self, Self::NoiseCompounds(_) | Self::EnhancerHelps(_))
    }

    /// The family that the claim is about; `None` for all.
    #[must_use]
    pub fn family(&self) -> Option<&Family> {
        match self {
            Self::BelowBlind(family, _) => Some(family),
            _ => None,
        }
    }

    /// The enhancer that the claim is about.
    #[must_use]
    pub fn enhancer(&self) -> Option<&EnhancerName> {
        match self {
            Self::EnhancerHarms(name) | Self::EnhancerHelps(name) => Some(name),
            _ => None,
        }
    }

    /// The levels that the claim is about, as far as they were asked.
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

/// L1 to L5.
fn paper_levels() -> Vec<AxisLevel> {
    Kind::Sensor
        .ladder()
        .iter()
        .map(|severity| AxisLevel::new(Kind::Sensor, *severity))
        .collect()
}

/// Test result of a claim, after the correction over claims and readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Support {
    /// The effect is detected on the side of the claim.
    Holds,
    /// The effect is detected on the other side.
    Opposite,
    /// No effect is detected.
    Open,
}

impl Support {
    /// The word in tables and files.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Opposite => "opposite",
            Self::Open => "open",
        }
    }
}

/// A claim under all readings together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Robustness {
    /// It holds under every reading of the report.
    All,
    /// It holds under some readings.
    Some,
    /// It holds under one reading at least, and the opposite is detected under another.
    Reversed,
    /// It holds under no reading, and the opposite is detected under at least one.
    None,
    /// No reading decides it.
    Open,
}

impl Robustness {
    /// The words in tables and files.
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

/// A claim under one reading.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectInReading {
    /// The light reading.
    pub reading: ReadingName,
    /// First side less second, mean over the levels; `n` is the number of items. `None` if a side was not asked.
    pub effect: Option<TestedEffect>,
}

/// An effect with its test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TestedEffect {
    /// The difference of accuracies with its 95 % interval by clusters.
    pub difference: Estimate,
    /// Test result of the claim.
    pub standing: Support,
    /// p-value of no difference.
    pub p: f64,
    /// The p-value after Holm's correction over all claims and readings.
    pub holm: f64,
}

/// A claim about one model under every light reading, on the same items.
#[derive(Debug, Clone, PartialEq)]
pub struct FindingByReading {
    /// The model.
    pub model: String,
    /// The runs that show these images, in a report on runs that show different ones.
    pub group: Option<LightGroup>,
    /// The claim that was tested.
    pub claim: NoiseHypothesis,
    /// The levels that every reading was asked at.
    pub levels: Vec<AxisLevel>,
    /// The model without images that the claim compares with, if it is another one.
    pub blind: Option<String>,
    /// The effect under each reading of the report, `paper` first.
    pub effects: Vec<EffectInReading>,
    /// The claim under all readings together.
    pub robustness: Robustness,
    /// Number of items that were asked, but not answered on every side, level and reading.
    pub dropped: usize,
}

/// All claims of each model, if the grid has several light readings; else none.
#[must_use]
pub fn by_reading(grid: &Grid<'_>) -> Vec<FindingByReading> {
    let readings: BTreeSet<&ReadingName> = noisy(grid)
        .filter_map(|subject| subject.variant.reading.as_ref())
        .collect();
    if readings.len() < 2 {
        return Vec::new();
    }
    let readings: Vec<&ReadingName> = readings.into_iter().collect();
    let models: BTreeSet<(&str, Option<&LightGroup>)> = noisy(grid)
        .map(|subject| (&*subject.model, subject.variant.group.as_ref()))
        .collect();
    let mut models: Vec<(&str, Option<&LightGroup>)> = models.into_iter().collect();
    models.sort_by_cached_key(|(model, _)| grid.listing.place(model));
    let jobs: Vec<(&str, Option<&LightGroup>, NoiseHypothesis)> = models
        .into_iter()
        .flat_map(|(model, group)| {
            claims(grid, model)
                .into_iter()
                .map(move |claim| (model, group, claim))
        })
        .collect();
    let found = jobs.into_par_iter().filter_map(|(model, group, claim)| {
        let sides = Sides { grid, model, group };
        finding(&sides, claim, &readings)
    });
    corrected(found.collect())
}

/// The subjects with noisy images.
fn noisy<'g>(grid: &'g Grid<'_>) -> impl Iterator<Item = &'g Subject> {
    grid.subjects.iter().filter(|subject| {
        subject.view == Some(View::Image) && subject.variant.kind.is_some_and(Kind::has_readings)
    })
}

/// The claims that may be computed for a model, in the order of the table.
fn claims(grid: &Grid<'_>, model: &str) -> Vec<NoiseHypothesis> {
    let enhancers: BTreeSet<&EnhancerName> = noisy(grid)
        .filter(|subject| subject.model == model)
        .filter_map(|subject| subject.enhancer.as_ref())
        .collect();
    let levels = paper_levels();
    let mut claims = vec![NoiseHypothesis::NoiseCompounds(None)];
    let by_level = levels.iter();
    claims.extend(by_level.map(|level| NoiseHypothesis::NoiseCompounds(Some(*level))));
    claims.push(NoiseHypothesis::DarknessCosts);
    for name in enhancers {
        claims.push(NoiseHypothesis::EnhancerHarms(name.clone()));
        claims.push(NoiseHypothesis::EnhancerHelps(name.clone()));
    }
    for family in grid.families() {
        let dark = levels[3..].iter().rev();
        claims.extend(dark.map(|level| NoiseHypothesis::BelowBlind(family.clone(), *level)));
    }
    claims
}

/// Where the two sides of a claim are found in the grid.
struct Sides<'g, 'a> {
    grid: &'g Grid<'a>,
    model: &'g str,
    group: Option<&'g LightGroup>,
}

impl Sides<'_, '_> {
    /// The two subjects of a claim at a level under a reading, by their indices.
    fn find(
        &self,
        claim: &NoiseHypothesis,
        level: AxisLevel,
        reading: &ReadingName,
    ) -> Option<(usize, usize)> {
        let light = |kind: Option<Kind>, reading: Option<&ReadingName>| KindReading {
            kind,
            reading: reading.cloned(),
            pair: None,
            group: self.group.cloned(),
        };
        let noisy = light(Some(Kind::Sensor), Some(reading));
        let seeing = |level, variant: &KindReading, enhancer| {
            let subject = Subject::seeing(self.model, level, variant, enhancer);
            self.grid.stand_in(&subject)
        };
        let raw = seeing(level, &noisy, None);
        Some(match claim {
            NoiseHypothesis::NoiseCompounds(_) => (
                seeing(level, &light(Kind::Sensor.base(), None), None)?,
                raw?,
            ),
            NoiseHypothesis::DarknessCosts => (raw?, seeing(AxisLevel::L0, &noisy, None)?),
            NoiseHypothesis::EnhancerHarms(name) | NoiseHypothesis::EnhancerHelps(name) => {
                (seeing(level, &noisy, Some(name))?, raw?)
            }
            NoiseHypothesis::BelowBlind(..) => (raw?, self.blind()?),
        })
    }

    /// The model itself without images; else the only model that was asked so.
    fn blind(&self) -> Option<usize> {
        let blind: Vec<(usize, &Subject)> = self
            .grid
            .subjects
            .iter()
            .enumerate()
            .filter(|(_, subject)| subject.view == Some(View::Blind))
            .collect();
        let own = blind.iter().find(|(_, other)| other.model == self.model);
        match (own, &blind[..]) {
            (Some((index, _)), _) | (None, [(index, _)]) => Some(*index),
            _ => None,
        }
    }
}

/// A claim under every reading; `None` if no reading was asked on both sides.
fn finding(
    sides: &Sides<'_, '_>,
    claim: NoiseHypothesis,
    readings: &[&ReadingName],
) -> Option<FindingByReading> {
    let asked_at = |reading: &ReadingName| {
        claim
            .levels()
            .into_iter()
            .filter(|level| sides.find(&claim, *level, reading).is_some())
            .collect::<BTreeSet<AxisLevel>>()
    };
    let levels: Vec<BTreeSet<AxisLevel>> = readings.iter().map(|name| asked_at(name)).collect();
    let shared = levels
        .iter()
        .filter(|levels| !levels.is_empty())
        .cloned()
        .reduce(|all, more| &all & &more)?;
    let levels: Vec<AxisLevel> = shared.into_iter().collect();
    let pairs: Vec<Vec<(usize, usize)>> = readings
        .iter()
        .map(|reading| {
            levels
                .iter()
                .map(|level| sides.find(&claim, *level, reading))
                .collect::<Option<_>>()
                .unwrap_or_default()
        })
        .collect();
    let (kept, dropped) = shared_items(sides.grid, &pairs, claim.family());
    let effects: Vec<Option<TestedEffect>> = pairs
        .iter()
        .map(|pairs| effect(sides.grid, pairs, &kept))
        .collect();
    if effects.iter().all(Option::is_none) {
        return None;
    }
    let blind = matches!(claim, NoiseHypothesis::BelowBlind(..))
        .then(|| sides.blind())
        .flatten()
        .map(|index| sides.grid.subjects[index].model.clone());
    Some(FindingByReading {
        model: sides.model.to_owned(),
        group: sides.group.cloned(),
        robustness: Robustness::Open,
        claim,
        levels,
        blind: blind.filter(|name| name != sides.model),
        effects: readings
            .iter()
            .zip(effects)
            .map(|(reading, effect)| EffectInReading {
                reading: (*reading).clone(),
                effect,
            })
            .collect(),
        dropped,
    })
}

/// The items of a family that were answered on both sides of all pairs, and the number of those that were asked there but not
/// answered.
fn shared_items(
    grid: &Grid<'_>,
    pairs: &[Vec<(usize, usize)>],
    family: Option<&Family>,
) -> (Vec<usize>, usize) {
    let sides: BTreeSet<usize> = pairs
        .iter()
        .flatten()
        .flat_map(|(first, second)| [*first, *second])
        .collect();
    let (kept, dropped): (Vec<usize>, Vec<usize>) = grid
        .items
        .iter()
        .enumerate()
        .filter(|(_, item)| item.is_of(family))
        .map(|(index, _)| index)
        .filter(|item| {
            sides
                .iter()
                .any(|side| grid.result(*side, *item).is_asked())
        })
        .partition(|item| {
            sides
                .iter()
                .all(|side| grid.result(*side, *item).is_reply())
        });
    (kept, dropped.len())
}

/// The mean over the pairs of the first side less the second, on the items of `kept`; `None` without pairs or items.
fn effect(grid: &Grid<'_>, pairs: &[(usize, usize)], kept: &[usize]) -> Option<TestedEffect> {
    if pairs.is_empty() || kept.is_empty() {
        return None;
    }
    let mut clusters = vec![ClusterNet { net: 0, items: 0 }; grid.clusters];
    let mut squares = 0;
    for &index in kept {
        let item = &grid.items[index];
        let is_right = |subject: usize| {
            let reading = grid.result(subject, index).reading(ReadingMode::Strict);
            i64::from(reading.is_some_and(|chosen| item.is_right(chosen)))
        };
        let net: i64 = pairs
            .iter()
            .map(|(first, second)| is_right(*first) - is_right(*second))
            .sum();
        let cluster = &mut clusters[item.cluster as usize];
        cluster.net += net;
        cluster.items += 1;
        squares += net * net;
    }
    clusters.retain(|cluster| cluster.items > 0);
    let tested = PairedTest::new(&clusters, pairs.len() as f64, squares as f64);
    Some(TestedEffect {
        standing: Support::Open,
        difference: tested.difference,
        p: tested.p,
        holm: tested.p,
    })
}

/// The findings with their test results, after Holm's correction over all of them and all readings.
fn corrected(mut found: Vec<FindingByReading>) -> Vec<FindingByReading> {
    let effects = found.iter().flat_map(|finding| &finding.effects);
    let values = effects.filter_map(|effect| Some(effect.effect.as_ref()?.p));
    let mut corrected = holm(&values.collect::<Vec<_>>()).into_iter();
    for finding in &mut found {
        let is_gain = finding.claim.is_gain();
        for (effect, holm) in finding
            .effects
            .iter_mut()
            .filter_map(|effect| effect.effect.as_mut())
            .zip(&mut corrected)
        {
            effect.holm = holm;
            effect.standing = standing(effect, is_gain);
        }
        finding.robustness = robustness(&finding.effects);
    }
    found
}

fn standing(effect: &TestedEffect, is_gain: bool) -> Support {
    if effect.holm >= ALPHA {
        Support::Open
    } else if (effect.difference.value > 0.0) == is_gain {
        Support::Holds
    } else {
        Support::Opposite
    }
}

/// The claim under the readings. A reading that was not asked shows nothing, so that the claim cannot hold under all.
fn robustness(effects: &[EffectInReading]) -> Robustness {
    let count = |standing: Support| {
        effects
            .iter()
            .filter_map(|effect| effect.effect)
            .filter(|effect| effect.standing == standing)
            .count()
    };
    match (count(Support::Holds), count(Support::Opposite)) {
        (0, 0) => Robustness::Open,
        (0, _) => Robustness::None,
        (holding, 0) if holding == effects.len() => Robustness::All,
        (_, 0) => Robustness::Some,
        _ => Robustness::Reversed,
    }
}

#[cfg(test)]
mod tests;
