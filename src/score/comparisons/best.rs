//! Ranking of models by accuracy in the dark: [`BestInTheDark`].

mod scores;

use std::collections::BTreeSet;

use super::comparison::compares_models;
use super::pooled::pool;
use crate::accuracies::{Coverage, shared};
use crate::choice::ParsingMode;
use crate::grid::Grid;
use crate::model_in_condition::ModelInCondition;
use crate::significance::{ALPHA, Significance, least_p};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{AxisLevel, Variant};

use scores::Scores;

pub use scores::{Crossing, DarkAccuracy, DarkGain, DarkPair, LevelLead};

/// Comparison of the models by mean accuracy over the dark levels ([`is_dark`]), with equal weights, on images without
/// an enhancer.
#[derive(Debug, Clone, PartialEq)]
pub struct BestInTheDark {
    /// Compared variant: the last kind of degradation in the runs (noise, if present), with its first noise profile.
    pub variant: Variant,
    /// Dark levels at which every model was asked.
    pub levels: Vec<AxisLevel>,
    /// Lighter levels at which every model was asked, L0 first.
    pub lighter: Vec<AxisLevel>,
    /// Dark levels at which at least one model was asked.
    pub asked: Vec<AxisLevel>,
    /// Models that saw images but are excluded: they lack L0 or a degraded level of this variant, or answered fewer
    /// items than others.
    pub without: Vec<String>,
    /// Accuracies of the models by descending mean over the dark levels. The first model is the leader.
    pub models: Vec<DarkAccuracy>,
    /// Models that the leader does not beat significantly, in the order of `models`. Empty if the leader is
    /// significantly the best.
    pub not_shown_better_than: Vec<String>,
    /// All pairs of models, in the order of `models`.
    pub pairs: Vec<DarkPair>,
    /// Whether the leader sees anything in the dark.
    pub gain: DarkGain,
    /// Comparison by level of the leader at the lighter levels with the leader in the dark; `None` if both are one
    /// model.
    pub crossing: Option<Crossing>,
    /// Number of items that every model answered at every level.
    pub items: usize,
    /// Number of items left out because a reply is missing. At least one model was asked them at every level.
    pub dropped: usize,
    /// Number of clusters of the items.
    pub clusters: usize,
    /// Smallest possible p-value with c clusters: 2 / 2ᶜ.
    pub least_p: f64,
    /// `p_leader` after the correction over all tests that the report's sentences use; `None` before that correction.
    pub p_report: Option<f64>,
}

impl BestInTheDark {
    /// Model with the highest mean accuracy.
    #[must_use]
    pub fn leader(&self) -> &DarkAccuracy {
        &self.models[0]
    }

    /// True if there are enough clusters for at least one pair to be significant.
    #[must_use]
    pub fn is_possible(&self) -> bool {
        self.pairs.iter().any(|pair| pair.significance.is_possible())
    }

    /// True if the leader is significantly better than every other model. Only the correction over all pairs is
    /// applied.
    #[must_use]
    pub fn is_shown(&self) -> bool {
        self.not_shown_better_than.is_empty()
    }

    /// Verdict of a pair in tables, which is that of the sentence; `None` for pairs without the leader, which no
    /// sentence is about. `is_detected` is true if the leader is detected to be the best.
    #[must_use]
    pub fn verdict(&self, pair: &DarkPair, is_detected: bool) -> Option<Significance> {
        match pair.significance {
            own if !own.is_possible() => Some(own),
            _ if pair.first != self.leader().model => None,
            _ if is_detected => Some(Significance::Better),
            _ => Some(Significance::NotShown),
        }
    }

    /// True if the leader is significantly the best, also after the correction over all tests that the report's
    /// sentences use.
    #[must_use]
    pub fn is_detected(&self) -> bool {
        self.is_shown() && self.p_report.is_some_and(|value| value < ALPHA)
    }

    /// p-value for the claim that the leader is the best: the largest p-value of its pairs after Holm's correction over
    /// all pairs.
    #[must_use]
    pub(crate) fn p_leader(&self) -> f64 {
        self.pairs.iter().filter(|pair| pair.first == self.leader().model).map(|pair| pair.holm).fold(0.0, f64::max)
    }
}

/// Exposure drop of L3, in EV.
const DARK_EV: f64 = 6.0;

/// True if a level counts as dark: the third step of its kind's ladder or a more severe level. Without a third step, L3
/// (6 EV) or darker.
#[must_use]
pub(crate) fn is_dark(level: AxisLevel, kind: Kind) -> bool {
    let threshold = kind.ladder().get(2).map_or(DARK_EV, |third| AxisLevel::new(kind, *third).value());
    level.value() >= threshold
}

/// A model and the levels at which it was asked.
type Asked<'g> = (&'g str, BTreeSet<AxisLevel>);

/// Compares the models in the dark, with replies parsed in `mode`. If the models share no dark level, the darkest
/// shared level counts as dark. `None` if the grid has too many models to compare, if fewer than two models were asked
/// at L0 and at a degraded level, or if the models share no degraded level or no item.
#[must_use]
pub fn best_in_the_dark(grid: &Grid<'_>, mode: ParsingMode) -> Option<BestInTheDark> {
    if !compares_models(grid) {
        return None;
    }
    let variant = grid.main_variant()?;
    let kind = variant.kind?;
    let (compared, mut without): (Vec<Asked<'_>>, Vec<Asked<'_>>) = pool(grid)
        .into_iter()
        .map(|model| (model, levels(grid, model, &variant)))
        .partition(|(_, levels)| levels.len() > 1 && levels.contains(&AxisLevel::L0));
    let (compared, incomplete) = split_by_coverage(grid, compared, &variant);
    without.extend(incomplete);
    let levels: Vec<AxisLevel> = compared
        .first()?
        .1
        .iter()
        .copied()
        .filter(|level| compared.iter().all(|(_, levels)| levels.contains(level)))
        .collect();
    if compared.len() < 2 || levels.len() < 2 {
        return None;
    }
    let dark_count = levels.iter().filter(|level| is_dark(**level, kind)).count();
    let (lighter, dark) = levels.split_at(levels.len() - dark_count.max(1));
    let asked: BTreeSet<AxisLevel> =
        compared.iter().flat_map(|(_, levels)| levels).copied().filter(|level| *level >= dark[0]).collect();
    let names: Vec<&str> = compared.iter().map(|(model, _)| *model).collect();
    let scores = Scores::new(grid, &names, &variant, &levels, mode);
    if scores.items.is_empty() {
        return None;
    }
    let split = lighter.len();
    let mut models: Vec<(DarkAccuracy, usize)> =
        (0..names.len()).filter_map(|model| Some((scores.accuracy(model, names[model], split)?, model))).collect();
    models.sort_by(|(a, _), (b, _)| b.mean.value.total_cmp(&a.mean.value));
    let pairs = scores.pairs(&models, split);
    let (leader, leader_index) = models.first()?;
    let leader = &leader.model;
    let clusters = scores.clusters();
    Some(BestInTheDark {
        not_shown_better_than: pairs
            .iter()
            .filter(|pair| pair.first == *leader && pair.significance != Significance::Better)
            .map(|pair| pair.second.clone())
            .collect(),
        gain: scores.gain(*leader_index, split)?,
        crossing: scores.crossing(&models, &levels),
        variant,
        levels: dark.to_vec(),
        lighter: lighter.to_vec(),
        asked: asked.into_iter().collect(),
        without: without.iter().map(|(model, _)| (*model).to_owned()).collect(),
        items: scores.items.len(),
        dropped: scores.dropped,
        clusters,
        least_p: least_p(clusters),
        p_report: None,
        models: models.into_iter().map(|(model, _)| model).collect(),
        pairs,
    })
}

/// Levels at which a model was asked about images of a variant without an enhancer. L0 is included if it was asked in
/// the same runs.
fn levels(grid: &Grid<'_>, model: &str, variant: &Variant) -> BTreeSet<AxisLevel> {
    let clean = ModelInCondition::with_images(model, AxisLevel::L0, variant, None);
    grid.subjects
        .iter()
        .filter(|subject| {
            let is_degraded = subject.model == model && subject.enhancer.is_none() && subject.variant == *variant;
            is_degraded || subject.matches_up_to_group(&clean)
        })
        .filter_map(|subject| subject.level)
        .collect()
}

/// Splits the models into those with complete coverage and those with too few answered items. An incomplete model would
/// reduce the items on which all models are compared.
fn split_by_coverage<'g>(
    grid: &Grid<'_>,
    models: Vec<Asked<'g>>,
    variant: &Variant,
) -> (Vec<Asked<'g>>, Vec<Asked<'g>>) {
    let coverages: Vec<Coverage> = models
        .iter()
        .map(|(model, levels)| {
            let sides = levels.iter().filter_map(|level| {
                let subject = grid.find_up_to_group(&ModelInCondition::with_images(model, *level, variant, None))?;
                Some((*level, vec![subject]))
            });
            Coverage::new(grid, sides, |_| true)
        })
        .collect();
    let Some(most) = shared(&coverages) else {
        return (models, Vec::new());
    };
    let (mut complete, mut incomplete) = (Vec::new(), Vec::new());
    for (model, coverage) in models.into_iter().zip(&coverages) {
        if coverage.lacking(most).is_empty() {
            complete.push(model);
        } else {
            incomplete.push(model);
        }
    }
    (complete, incomplete)
}
