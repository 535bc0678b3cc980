//! Which model sees best in the dark: [`BestInTheDark`].

use super::choice::ReadingMode;
use super::estimate::Estimate;
use super::grid::{ClusterCount, Grid};
use super::paired::difference;
use super::pooled::pool;
use super::significance::{Significance, holm, least_p, swap_test};
use super::subject::Subject;
use super::trapezoid::weights;
use crate::types::{AxisLevel, KindReading};

/// Comparison of the models by their mean accuracy over the exposure drops, raw, in the strict reading.
#[derive(Debug, Clone, PartialEq)]
pub struct BestInTheDark {
    /// Kind of degradation: the last kind that was asked (noise, if it was), in its first light reading.
    pub variant: KindReading,
    /// The levels that every model was asked, from L0.
    pub levels: Vec<AxisLevel>,
    /// The models with their areas, largest area first. The first one leads.
    pub models: Vec<ModelArea>,
    /// The models that the leader is not shown to be better than, in the order of `models`. If it is empty, the leader is shown
    /// to be the best.
    pub not_shown_better_than: Vec<String>,
    /// All pairs of models, in the order of `models`.
    pub pairs: Vec<AreaPair>,
    /// Number of items that every model answered at every level.
    pub items: usize,
    /// Number of items that some model was asked at every level, but that are left out because a model has no reply.
    pub dropped: usize,
    /// Number of clusters of the items.
    pub clusters: usize,
    /// The smallest p-value that so many clusters allow, 2 / 2ᶜ.
    pub least_p: f64,
}

impl BestInTheDark {
    /// The model with the largest area.
    #[must_use]
    pub fn leader(&self) -> &ModelArea {
        &self.models[0]
    }

    /// Whether the leader is shown to be better than every other model.
    #[must_use]
    pub fn is_shown(&self) -> bool {
        self.not_shown_better_than.is_empty()
    }
}

/// Mean accuracy of one model over the exposure drops, on the items of all models.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelArea {
    pub model: String,
    /// Mean accuracy from L0 to the darkest level, by the trapezoid rule over EV.
    pub area: Estimate,
    /// Accuracy at L0, on the same items.
    pub clean: Estimate,
    /// The area minus the accuracy at L0; `None` if that is not above chance, because then nothing can be lost.
    pub loss: Option<Estimate>,
}

/// One model against another by area, on the items of all models.
#[derive(Debug, Clone, PartialEq)]
pub struct AreaPair {
    pub first: String,
    pub second: String,
    /// Area of the first minus that of the second.
    pub difference: Estimate,
    /// p-value of swapping the two models in whole clusters.
    pub p: f64,
    /// Number of random swaps behind the p-value; `None` if it is exact.
    pub draws: Option<usize>,
    /// p-value after Holm's correction over all pairs of models.
    pub holm: f64,
    pub significance: Significance,
}

/// The comparison of the models by area; `None` if fewer than two of them were asked at L0 and at a degraded level, or if they share
/// no item.
#[must_use]
pub(crate) fn best_in_the_dark(grid: &Grid<'_>) -> Option<BestInTheDark> {
    let variant = grid.main_variant()?;
    let curves: Vec<(&str, Vec<AxisLevel>)> = pool(grid)
        .into_iter()
        .map(|model| (model, levels(grid, model, &variant)))
        .filter(|(_, levels)| levels.len() > 1 && levels[0] == AxisLevel::L0)
        .collect();
    let shared = |level: &AxisLevel| curves.iter().all(|(_, levels)| levels.contains(level));
    let levels = curves.first()?.1.iter().copied().filter(shared);
    let levels: Vec<AxisLevel> = levels.collect();
    if curves.len() < 2 || levels.len() < 2 {
        return None;
    }
    let names: Vec<&str> = curves.iter().map(|(model, _)| *model).collect();
    let (scores, dropped) = ClusterScores::all(grid, &names, &variant, &levels);
    if scores.is_empty() {
        return None;
    }
    let weight: u64 = weights(&levels).iter().sum();
    let mut models: Vec<(ModelArea, usize)> = (0..names.len())
        .filter_map(|model| Some((area(&scores, model, names[model], weight)?, model)))
        .collect();
    models.sort_by(|(a, _), (b, _)| b.area.value.total_cmp(&a.area.value));
    let pairs = pairs(&scores, &models, weight);
    let leader = &models[0].0.model;
    let unshown = pairs
        .iter()
        .filter(|pair| pair.first == *leader && pair.significance != Significance::Better);
    Some(BestInTheDark {
        not_shown_better_than: unshown.map(|pair| pair.second.clone()).collect(),
        variant,
        levels,
        items: scores.iter().map(|cluster| cluster.items).sum(),
        dropped,
        clusters: scores.len(),
        least_p: least_p(scores.len()),
        models: models.into_iter().map(|(area, _)| area).collect(),
        pairs,
    })
}

/// The levels at which a model was asked about raw images of a variant, sorted, with L0.
fn levels(grid: &Grid<'_>, model: &str, variant: &KindReading) -> Vec<AxisLevel> {
    let subjects = grid.subjects.iter().filter(|subject| {
        let is_clean = subject.level == Some(AxisLevel::L0);
        subject.model == model
            && subject.enhancer.is_none()
            && (is_clean || subject.variant == *variant)
    });
    let mut levels: Vec<AxisLevel> = subjects.filter_map(|subject| subject.level).collect();
    levels.sort_unstable();
    levels
}

/// Sums over the items of a cluster that every model answered at every level.
#[derive(Debug, Clone, Default)]
struct ClusterScores {
    /// Number of items.
    items: usize,
    /// Weighted number of right replies of each model, over all levels.
    weighted: Vec<u64>,
    /// Number of right replies of each model at L0.
    clean: Vec<u32>,
    /// Expected number of right guesses at one level.
    guesses: f64,
}

impl ClusterScores {
    /// The clusters that have an item, and the number of items that are left out because a model has no reply.
    fn all(
        grid: &Grid<'_>,
        models: &[&str],
        variant: &KindReading,
        levels: &[AxisLevel],
    ) -> (Vec<Self>, usize) {
        let subject =
            |model: &str, level| grid.stand_in(&Subject::seeing(model, level, variant, None));
        let subjects = models.iter().map(|model| {
            let subjects = levels.iter().filter_map(|level| subject(model, *level));
            subjects.collect()
        });
        let subjects: Vec<Vec<usize>> = subjects.collect();
        let weights = weights(levels);
        let blank = Self {
            weighted: vec![0; models.len()],
            clean: vec![0; models.len()],
            ..Self::default()
        };
        let mut clusters = vec![blank; grid.clusters];
        let mut dropped = 0;
        for (index, item) in grid.items.iter().enumerate() {
            let answered = |subject: &usize| {
                let reading = grid.result(*subject, index).reading(ReadingMode::Strict);
                reading.map(|chosen| item.is_right(chosen))
            };
            let right = subjects
                .iter()
                .map(|levels| levels.iter().map(answered).collect());
            let Some(right) = right.collect::<Option<Vec<Vec<bool>>>>() else {
                let asked = |subject: &usize| grid.result(*subject, index).is_asked();
                dropped += usize::from(subjects.iter().any(|levels| levels.iter().all(asked)));
                continue;
            };
            let cluster = &mut clusters[item.cluster as usize];
            cluster.items += 1;
            cluster.guesses += 1.0 / item.record.detail.choices.len() as f64;
            for (model, levels) in right.iter().enumerate() {
                let right = levels.iter().zip(&weights).filter(|(right, _)| **right);
                cluster.weighted[model] += right.map(|(_, weight)| weight).sum::<u64>();
                cluster.clean[model] += u32::from(levels[0]);
            }
        }
        clusters.retain(|cluster| cluster.items > 0);
        (clusters, dropped)
    }
}

/// The area of a model, given by its index.
fn area(clusters: &[ClusterScores], model: usize, name: &str, weight: u64) -> Option<ModelArea> {
    let n: usize = clusters.iter().map(|cluster| cluster.items).sum();
    let mean = |cluster: &ClusterScores| cluster.weighted[model] as f64 / weight as f64;
    let sums = |of: &dyn Fn(&ClusterScores) -> f64| -> Vec<(f64, f64)> {
        let clusters = clusters.iter();
        clusters
            .map(|cluster| (of(cluster), cluster.items as f64))
            .collect()
    };
    let clean_counts = clusters.iter().map(|cluster| ClusterCount {
        right: cluster.clean[model],
        replies: cluster.items as u32,
    });
    let clean = Estimate::clustered(&clean_counts.collect::<Vec<_>>())?;
    let chance = clusters.iter().map(|cluster| cluster.guesses).sum::<f64>() / n as f64;
    let lost = |cluster: &ClusterScores| mean(cluster) - f64::from(cluster.clean[model]);
    Some(ModelArea {
        model: name.to_owned(),
        area: Estimate::scored(&sums(&mean), weight as f64, n)?,
        clean,
        loss: (clean.low > chance).then(|| difference(&sums(&lost), n)),
    })
}

/// All pairs of models, given with their indices, with their verdicts.
fn pairs(clusters: &[ClusterScores], models: &[(ModelArea, usize)], weight: u64) -> Vec<AreaPair> {
    let n: usize = clusters.iter().map(|cluster| cluster.items).sum();
    let mut pairs = Vec::new();
    for (index, (first, a)) in models.iter().enumerate() {
        for (second, b) in &models[index + 1..] {
            let net =
                |cluster: &ClusterScores| cluster.weighted[*a] as i64 - cluster.weighted[*b] as i64;
            let nets: Vec<i64> = clusters.iter().map(net).collect();
            let sums = clusters.iter().zip(&nets);
            let sums =
                sums.map(|(cluster, net)| (*net as f64 / weight as f64, cluster.items as f64));
            let tested = swap_test(&nets);
            pairs.push(AreaPair {
                first: first.model.clone(),
                second: second.model.clone(),
                difference: difference(&sums.collect::<Vec<_>>(), n),
                p: tested.p,
                draws: tested.draws,
                holm: 1.0,
                significance: Significance::NotShown,
            });
        }
    }
    let corrected = holm(&pairs.iter().map(|pair| pair.p).collect::<Vec<_>>());
    let least_holm = pairs.len() as f64 * least_p(clusters.len());
    for (pair, holm) in pairs.iter_mut().zip(corrected) {
        pair.holm = holm;
        pair.significance = Significance::of(pair.difference.value, holm, least_holm);
    }
    pairs
}
