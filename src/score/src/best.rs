//! Which model sees best in the dark: [`BestInTheDark`].

use std::collections::BTreeSet;

use super::choice::ReadingMode;
use super::estimate::Estimate;
use super::grid::{ClusterCount, Grid};
use super::paired::difference;
use super::pooled::pool;
use super::significance::{Significance, SwapMethod, SwapTest, holm, least_p, swap_test};
use super::subject::Subject;
use super::trapezoid::weights;
use darkqa_ground::types::{AxisLevel, KindReading};

/// Comparison of the models by their mean accuracy over the exposure drops, raw, in the strict reading.
#[derive(Debug, Clone, PartialEq)]
pub struct BestInTheDark {
    /// Kind of degradation: the last kind that was asked (noise, if it was), in its first light reading.
    pub variant: KindReading,
    /// The levels that every model was asked, from L0.
    pub levels: Vec<AxisLevel>,
    /// The levels that some model was asked, from L0.
    pub asked: Vec<AxisLevel>,
    /// Models with images that are not compared, because they were not asked at L0 and at a degraded level of this variant.
    pub without: Vec<String>,
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

    /// Whether the clusters allow a verdict on any pair.
    #[must_use]
    pub fn is_possible(&self) -> bool {
        let mut pairs = self.pairs.iter();
        pairs.any(|pair| pair.significance.is_possible())
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
    /// How the p-value was found.
    pub p_by: SwapMethod,
    /// p-value after Holm's correction over all pairs of models.
    pub holm: f64,
    pub significance: Significance,
}

/// A model and the levels at which it was asked.
type Asked<'g> = (&'g str, BTreeSet<AxisLevel>);

/// The comparison of the models by area; `None` if fewer than two of them were asked at L0 and at a degraded level, or if they share
/// no item.
#[must_use]
pub fn best_in_the_dark(grid: &Grid<'_>) -> Option<BestInTheDark> {
    let variant = grid.main_variant()?;
    let models = pool(grid)
        .into_iter()
        .map(|model| (model, levels(grid, model, &variant)));
    let (curves, without): (Vec<Asked<'_>>, Vec<Asked<'_>>) =
        models.partition(|(_, levels)| levels.len() > 1 && levels.contains(&AxisLevel::L0));
    let shared = |level: &AxisLevel| curves.iter().all(|(_, levels)| levels.contains(level));
    let levels = curves.first()?.1.iter().copied().filter(shared);
    let levels: Vec<AxisLevel> = levels.collect();
    let asked: BTreeSet<AxisLevel> = curves
        .iter()
        .flat_map(|(_, levels)| levels)
        .copied()
        .collect();
    if curves.len() < 2 || levels.len() < 2 {
        return None;
    }
    let names: Vec<&str> = curves.iter().map(|(model, _)| *model).collect();
    let scores = Scores::new(grid, &names, &variant, &levels);
    if scores.items.is_empty() {
        return None;
    }
    let models =
        (0..names.len()).filter_map(|model| Some((scores.area(model, names[model])?, model)));
    let mut models: Vec<(ModelArea, usize)> = models.collect();
    models.sort_by(|(a, _), (b, _)| b.area.value.total_cmp(&a.area.value));
    let pairs = scores.pairs(&models);
    let leader = &models.first()?.0.model;
    let unshown = pairs
        .iter()
        .filter(|pair| pair.first == *leader && pair.significance != Significance::Better);
    let clusters = scores.clusters();
    Some(BestInTheDark {
        not_shown_better_than: unshown.map(|pair| pair.second.clone()).collect(),
        variant,
        levels,
        asked: asked.into_iter().collect(),
        without: without
            .iter()
            .map(|(model, _)| (*model).to_owned())
            .collect(),
        items: scores.items.len(),
        dropped: scores.dropped,
        clusters,
        least_p: least_p(clusters),
        models: models.into_iter().map(|(area, _)| area).collect(),
        pairs,
    })
}

/// The levels at which a model was asked about raw images of a variant, with L0 if its clean frames are those of the same runs.
fn levels(grid: &Grid<'_>, model: &str, variant: &KindReading) -> BTreeSet<AxisLevel> {
    let clean = Subject::seeing(model, AxisLevel::L0, variant, None);
    let subjects = grid.subjects.iter().filter(|subject| {
        let is_degraded =
            subject.model == model && subject.enhancer.is_none() && subject.variant == *variant;
        is_degraded || subject.is_for(&clean)
    });
    subjects.filter_map(|subject| subject.level).collect()
}

/// Right replies of all models to an item that every model answered at every level.
struct ItemScores {
    /// Index of the cluster.
    cluster: usize,
    /// Weighted number of right replies of each model, over all levels.
    weighted: Vec<u64>,
    /// Whether each model is right at L0.
    clean: Vec<bool>,
    /// Chance of a right guess.
    guess: f64,
}

/// Right replies of all models to their shared items.
struct Scores {
    items: Vec<ItemScores>,
    /// Sum of the weights of the levels.
    weight: u64,
    /// Number of levels.
    levels: usize,
    /// Number of items that are left out because a model has no reply.
    dropped: usize,
    /// Number of clusters of all items of the grid.
    all_clusters: usize,
}

impl Scores {
    fn new(grid: &Grid<'_>, models: &[&str], variant: &KindReading, levels: &[AxisLevel]) -> Self {
        let subject =
            |model: &str, level| grid.stand_in(&Subject::seeing(model, level, variant, None));
        let subjects = models.iter().map(|model| {
            let subjects = levels.iter().filter_map(|level| subject(model, *level));
            subjects.collect()
        });
        let subjects: Vec<Vec<usize>> = subjects.collect();
        let weights = weights(levels);
        let mut scores = Self {
            items: Vec::new(),
            weight: weights.iter().sum(),
            levels: levels.len(),
            dropped: 0,
            all_clusters: grid.clusters,
        };
        for (index, item) in grid.items.iter().enumerate() {
            let answered = |subject: &usize| {
                let reading = grid.result(*subject, index).reading(ReadingMode::Strict);
                reading.map(|chosen| item.is_right(chosen))
            };
            let right = subjects.iter();
            let right = right.map(|levels| levels.iter().map(answered).collect());
            let Some(right) = right.collect::<Option<Vec<Vec<bool>>>>() else {
                let asked = |subject: &usize| grid.result(*subject, index).is_asked();
                let is_asked = subjects.iter().any(|levels| levels.iter().all(asked));
                scores.dropped += usize::from(is_asked);
                continue;
            };
            let weighted = right.iter().map(|levels| {
                let right = levels.iter().zip(&weights).filter(|(right, _)| **right);
                right.map(|(_, weight)| weight).sum()
            });
            scores.items.push(ItemScores {
                cluster: item.cluster as usize,
                weighted: weighted.collect(),
                clean: right.iter().map(|levels| levels[0]).collect(),
                guess: 1.0 / item.asked.choices.len() as f64,
            });
        }
        scores
    }

    /// Number of clusters that have an item.
    fn clusters(&self) -> usize {
        self.sums(|_| 0).len()
    }

    /// Sum of a number over the items of each cluster that has an item, and the number of these items.
    fn sums(&self, of: impl Fn(&ItemScores) -> i64) -> Vec<(i64, u32)> {
        let mut sums = vec![(0, 0); self.all_clusters];
        for item in &self.items {
            let (sum, count) = &mut sums[item.cluster];
            *sum += of(item);
            *count += 1;
        }
        sums.retain(|(_, count)| *count > 0);
        sums
    }

    /// The mean of a weighted difference, as a share of all weights, and the test of swaps.
    fn difference(&self, of: impl Fn(&ItemScores) -> i64) -> (Estimate, SwapTest) {
        let weight = self.weight as f64;
        let sums = self.sums(&of);
        let nets: Vec<i64> = sums.iter().map(|(net, _)| *net).collect();
        let shares = sums.iter();
        let shares = shares.map(|(net, count)| (*net as f64 / weight, f64::from(*count)));
        let squares = self.items.iter().map(|item| {
            let share = of(item) as f64 / weight;
            share * share
        });
        let estimate = difference(&shares.collect::<Vec<_>>(), squares.sum(), self.items.len());
        (estimate, swap_test(&nets))
    }

    /// The area of a model, given by its index.
    fn area(&self, model: usize, name: &str) -> Option<ModelArea> {
        let (n, weight) = (self.items.len(), self.weight as f64);
        let sums = self.sums(|item| item.weighted[model] as i64).into_iter();
        let sums = sums.map(|(sum, count)| (sum as f64 / weight, f64::from(count)));
        let clean = self.sums(|item| i64::from(item.clean[model])).into_iter();
        let clean = clean.map(|(right, replies)| ClusterCount {
            right: right as u32,
            replies,
        });
        let clean = Estimate::clustered(&clean.collect::<Vec<_>>())?;
        let chance = self.items.iter().map(|item| item.guess).sum::<f64>() / n as f64;
        let lost = |item: &ItemScores| {
            let clean = if item.clean[model] { self.weight } else { 0 };
            item.weighted[model] as i64 - clean as i64
        };
        Some(ModelArea {
            model: name.to_owned(),
            area: Estimate::scored(&sums.collect::<Vec<_>>(), self.levels as f64, n)?,
            clean,
            loss: (clean.low > chance).then(|| self.difference(lost).0),
        })
    }

    /// All pairs of models, given with their indices, with their verdicts.
    fn pairs(&self, models: &[(ModelArea, usize)]) -> Vec<AreaPair> {
        let mut pairs = Vec::new();
        for (index, (first, a)) in models.iter().enumerate() {
            for (second, b) in &models[index + 1..] {
                let net = |item: &ItemScores| item.weighted[*a] as i64 - item.weighted[*b] as i64;
                let (difference, tested) = self.difference(net);
                pairs.push(AreaPair {
                    first: first.model.clone(),
                    second: second.model.clone(),
                    difference,
                    p: tested.p,
                    p_by: tested.by,
                    holm: 1.0,
                    significance: Significance::NotShown,
                });
            }
        }
        let corrected = holm(&pairs.iter().map(|pair| pair.p).collect::<Vec<_>>());
        let least_holm = pairs.len() as f64 * least_p(self.clusters());
        for (pair, holm) in pairs.iter_mut().zip(corrected) {
            pair.holm = holm;
            pair.significance = Significance::of(pair.difference.value, holm, least_holm);
        }
        pairs
    }
}
