//! Ranking of models by accuracy in the dark: [`BestInTheDark`].

use std::collections::BTreeSet;
use std::ops::Range;

use super::comparison::compares_models;
use super::paired::{ClusterNet, PairedTest};
use super::pooled::pool;
use crate::accuracies::{Coverage, shared};
use crate::choice::ReadingMode;
use crate::estimate::{ClusterCount, Estimate};
use crate::grid::Grid;
use crate::significance::{ALPHA, Significance, SwapMethod, holm, least_p};
use crate::subject::ModelInCondition;
use darkqa_ground::types::degradations::Kind;
use darkqa_ground::types::{AxisLevel, Variant};

/// Comparison of the models by their mean accuracy over the dark levels ([`is_dark`]), each level alike, on raw images.
#[derive(Debug, Clone, PartialEq)]
pub struct BestInTheDark {
    /// Kind of degradation: the last kind that was asked (noise, if it was), in its first noise profile.
    pub variant: Variant,
    /// The dark levels that every model was asked.
    pub levels: Vec<AxisLevel>,
    /// The lighter levels that every model was asked, from L0.
    pub lighter: Vec<AxisLevel>,
    /// The dark levels that some model was asked.
    pub asked: Vec<AxisLevel>,
    /// Models with images that are not compared, because they were not asked at L0 and at a degraded level of this variant, or answered
    /// less than others there.
    pub without: Vec<String>,
    /// The models with their accuracies, the best in the dark first. The first one leads.
    pub models: Vec<DarkAccuracy>,
    /// The models that the leader is not shown to be better than, in the order of `models`. If it is empty, the leader is shown
    /// to be the best.
    pub not_shown_better_than: Vec<String>,
    /// All pairs of models, in the order of `models`.
    pub pairs: Vec<DarkPair>,
    /// The leader in the light before the leader in the dark, if they are two models whose order changes once.
    pub crossing: Option<Crossing>,
    /// Number of items that every model answered at every level.
    pub items: usize,
    /// Number of items that some model was asked at every level, but that are left out because a model has no reply.
    pub dropped: usize,
    /// Number of clusters of the items.
    pub clusters: usize,
    /// Smallest p-value that this number of clusters, c, allows: 2 / 2ᶜ.
    pub least_p: f64,
    /// p-value of the leader being the best, after the correction over all tests that sentences rest on.
    pub p_report: Option<f64>,
}

impl BestInTheDark {
    /// The model with the largest mean accuracy.
    #[must_use]
    pub fn leader(&self) -> &DarkAccuracy {
        &self.models[0]
    }

    /// Whether the clusters allow a verdict on any pair.
    #[must_use]
    pub fn is_possible(&self) -> bool {
        self.pairs
            .iter()
            .any(|pair| pair.significance.is_possible())
    }

    /// Whether the leader is shown to be better than every other model, by the correction over the pairs alone.
    #[must_use]
    pub fn is_shown(&self) -> bool {
        self.not_shown_better_than.is_empty()
    }

    /// Whether the leader is shown to be the best, also after the correction over all sentences.
    #[must_use]
    pub fn is_detected(&self) -> bool {
        self.is_shown() && self.p_report.is_some_and(|value| value < ALPHA)
    }

    /// p-value of the leader being the best: the largest one of its pairs, each after Holm's correction over all pairs.
    #[must_use]
    pub(crate) fn p_leader(&self) -> f64 {
        self.pairs
            .iter()
            .filter(|pair| pair.first == self.leader().model)
            .map(|pair| pair.holm)
            .fold(0.0, f64::max)
    }
}

/// Mean accuracy of one model over the dark levels, on the items of all models.
#[derive(Debug, Clone, PartialEq)]
pub struct DarkAccuracy {
    pub model: String,
    /// Mean accuracy over the dark levels.
    pub mean: Estimate,
    /// Mean accuracy over the lighter levels.
    pub lighter: f64,
    /// Accuracy at each level, the lighter ones first.
    pub by_level: Vec<f64>,
    /// Accuracy at L0, on the same items.
    pub clean: Estimate,
    /// The mean minus the accuracy at L0; `None` if that is not above chance, because then nothing can be lost.
    pub loss: Option<Estimate>,
}

/// One model against another by mean accuracy over the dark levels, on the items of all models.
#[derive(Debug, Clone, PartialEq)]
pub struct DarkPair {
    pub first: String,
    pub second: String,
    /// Mean of the first minus that of the second.
    pub difference: Estimate,
    /// p-value of no difference.
    pub p: f64,
    /// How the swaps were counted.
    pub p_by: SwapMethod,
    /// p-value after Holm's correction over all pairs of models.
    pub holm: f64,
    pub significance: Significance,
}

/// Two models whose order changes once with the level.
#[derive(Debug, Clone, PartialEq)]
pub struct Crossing {
    /// The leader of the lighter levels, and the last level at which it is ahead.
    pub before: (String, AxisLevel),
    /// The leader of the dark levels, and the first level at which it is ahead.
    pub after: (String, AxisLevel),
    /// Mean accuracy of the first less that of the second, over the levels where the first is ahead.
    pub lead: Estimate,
    /// The same over the levels where the second is ahead.
    pub lag: Estimate,
    /// The larger p-value of the two, times the number of places between levels where the order could change.
    pub p: f64,
    /// p-value after the correction over all tests that sentences rest on.
    pub p_report: Option<f64>,
}

impl Crossing {
    /// Whether the change of order is shown after that correction.
    #[must_use]
    pub fn is_detected(&self) -> bool {
        self.p_report.is_some_and(|value| value < ALPHA)
    }
}

/// The exposure drop of L3, in EV.
const DARK_EV: f64 = 6.0;

/// Whether a level counts as dark: L3 (6 EV) and darker; of another kind of degradation the third step of its ladder and beyond.
#[must_use]
pub(crate) fn is_dark(level: AxisLevel, kind: Kind) -> bool {
    let third = kind.ladder().get(2);
    let least = third.map_or(DARK_EV, |third| AxisLevel::new(kind, *third).value());
    level.value() >= least
}

/// A model and the levels at which it was asked.
type Asked<'g> = (&'g str, BTreeSet<AxisLevel>);

/// Compares the models in the dark, in one parsing. Returns `None` if fewer than two of them were asked at L0 and at a degraded level, if
/// they share no item, or if there are too many models to compare. If they share no dark level, the darkest one that they share counts as
/// dark.
#[must_use]
pub fn best_in_the_dark(grid: &Grid<'_>, mode: ReadingMode) -> Option<BestInTheDark> {
    if !compares_models(grid) {
        return None;
    }
    let variant = grid.main_variant()?;
    let kind = variant.kind?;
    let models = pool(grid)
        .into_iter()
        .map(|model| (model, levels(grid, model, &variant)));
    let (curves, mut without): (Vec<Asked<'_>>, Vec<Asked<'_>>) =
        models.partition(|(_, levels)| levels.len() > 1 && levels.contains(&AxisLevel::L0));
    let (curves, apart) = with_most_answers(grid, curves, &variant);
    without.extend(apart);
    let levels: Vec<AxisLevel> = curves
        .first()?
        .1
        .iter()
        .copied()
        .filter(|level| curves.iter().all(|(_, levels)| levels.contains(level)))
        .collect();
    if curves.len() < 2 || levels.len() < 2 {
        return None;
    }
    let dark = levels.iter().filter(|level| is_dark(**level, kind)).count();
    let (lighter, dark) = levels.split_at(levels.len() - dark.max(1));
    let asked: BTreeSet<AxisLevel> = curves
        .iter()
        .flat_map(|(_, levels)| levels)
        .copied()
        .filter(|level| *level >= dark[0])
        .collect();
    let names: Vec<&str> = curves.iter().map(|(model, _)| *model).collect();
    let scores = Scores::new(grid, &names, &variant, &levels, mode);
    if scores.items.is_empty() {
        return None;
    }
    let split = lighter.len();
    let mut models: Vec<(DarkAccuracy, usize)> = (0..names.len())
        .filter_map(|model| Some((scores.accuracy(model, names[model], split)?, model)))
        .collect();
    models.sort_by(|(a, _), (b, _)| b.mean.value.total_cmp(&a.mean.value));
    let pairs = scores.pairs(&models, split);
    let leader = &models.first()?.0.model;
    let unshown = pairs
        .iter()
        .filter(|pair| pair.first == *leader && pair.significance != Significance::Better);
    let clusters = scores.clusters();
    Some(BestInTheDark {
        not_shown_better_than: unshown.map(|pair| pair.second.clone()).collect(),
        crossing: scores.crossing(&models, &levels),
        variant,
        levels: dark.to_vec(),
        lighter: lighter.to_vec(),
        asked: asked.into_iter().collect(),
        without: without
            .iter()
            .map(|(model, _)| (*model).to_owned())
            .collect(),
        items: scores.items.len(),
        dropped: scores.dropped,
        clusters,
        least_p: least_p(clusters),
        p_report: None,
        models: models.into_iter().map(|(model, _)| model).collect(),
        pairs,
    })
}

/// The levels at which a model was asked about raw images of a variant, with L0 if its clean frames are those of the same runs.
fn levels(grid: &Grid<'_>, model: &str, variant: &Variant) -> BTreeSet<AxisLevel> {
    let clean = ModelInCondition::seeing(model, AxisLevel::L0, variant, None);
    grid.subjects
        .iter()
        .filter(|subject| {
            let is_degraded =
                subject.model == model && subject.enhancer.is_none() && subject.variant == *variant;
            is_degraded || subject.matches_up_to_group(&clean)
        })
        .filter_map(|subject| subject.level)
        .collect()
}

/// Splits the models into those that answered most and those that answered less. The latter are compared separately, so that they do not
/// reduce the items of the others.
fn with_most_answers<'g>(
    grid: &Grid<'_>,
    models: Vec<Asked<'g>>,
    variant: &Variant,
) -> (Vec<Asked<'g>>, Vec<Asked<'g>>) {
    let coverages: Vec<Coverage> = models
        .iter()
        .map(|(model, levels)| {
            let sides = levels.iter().filter_map(|level| {
                let subject =
                    grid.stand_in(&ModelInCondition::seeing(model, *level, variant, None))?;
                Some((*level, vec![subject]))
            });
            Coverage::new(grid, sides, |_| true)
        })
        .collect();
    let Some(most) = shared(&coverages) else {
        return (models, Vec::new());
    };
    let is_complete: Vec<bool> = coverages
        .iter()
        .map(|coverage| coverage.lacking(most).is_empty())
        .collect();
    let mut is_complete = is_complete.into_iter();
    models
        .into_iter()
        .partition(|_| is_complete.next() == Some(true))
}

/// Right replies of all models to an item that every model answered at every level.
struct ItemScores {
    /// Index of the cluster.
    cluster: usize,
    /// Whether each model is right at each level.
    right: Vec<Vec<bool>>,
    /// Chance of a right guess.
    guess: f64,
}

impl ItemScores {
    /// Number of some levels at which a model is right.
    fn right(&self, model: usize, levels: &Range<usize>) -> i64 {
        let right = self.right[model][levels.clone()].iter();
        right.map(|right| i64::from(*right)).sum()
    }
}

/// Right replies of all models to their shared items.
struct Scores {
    items: Vec<ItemScores>,
    /// Number of levels.
    levels: usize,
    /// Number of items that are left out because a model has no reply.
    dropped: usize,
    /// Number of clusters of all items of the grid.
    all_clusters: usize,
}

impl Scores {
    fn new(
        grid: &Grid<'_>,
        models: &[&str],
        variant: &Variant,
        levels: &[AxisLevel],
        mode: ReadingMode,
    ) -> Self {
        let subject = |model: &str, level| {
            grid.stand_in(&ModelInCondition::seeing(model, level, variant, None))
        };
        let subjects: Vec<Vec<usize>> = models
            .iter()
            .map(|model| {
                levels
                    .iter()
                    .filter_map(|level| subject(model, *level))
                    .collect()
            })
            .collect();
        let mut scores = Self {
            items: Vec::new(),
            levels: levels.len(),
            dropped: 0,
            all_clusters: grid.clusters,
        };
        for (index, item) in grid.items.iter().enumerate() {
            let right = subjects.iter().map(|levels| {
                levels
                    .iter()
                    .map(|subject: &usize| {
                        let reading = grid.result(*subject, index).reading(mode);
                        reading.map(|chosen| item.is_right(chosen))
                    })
                    .collect()
            });
            let Some(right) = right.collect::<Option<Vec<Vec<bool>>>>() else {
                let is_asked = subjects.iter().any(|levels| {
                    levels
                        .iter()
                        .all(|subject: &usize| grid.result(*subject, index).is_asked())
                });
                scores.dropped += usize::from(is_asked);
                continue;
            };
            scores.items.push(ItemScores {
                cluster: item.cluster as usize,
                right,
                guess: 1.0 / item.asked.choices.len() as f64,
            });
        }
        scores
    }

    /// Number of clusters that have an item.
    fn clusters(&self) -> usize {
        self.sums(|_| 0).len()
    }

    /// Sum of a number over the items of each cluster that has an item.
    fn sums(&self, of: impl Fn(&ItemScores) -> i64) -> Vec<ClusterNet> {
        let mut sums = vec![ClusterNet { net: 0, items: 0 }; self.all_clusters];
        for item in &self.items {
            let sum = &mut sums[item.cluster];
            sum.net += of(item);
            sum.items += 1;
        }
        sums.retain(|sum| sum.items > 0);
        sums
    }

    /// The test of a difference that each item has; it is `scale` at most.
    fn tested(&self, scale: usize, of: impl Fn(&ItemScores) -> i64) -> PairedTest {
        let squares: i64 = self.items.iter().map(|item| of(item) * of(item)).sum();
        PairedTest::new(&self.sums(&of), scale as f64, squares as f64)
    }

    /// The mean of the first model less that of the second over some levels.
    fn less(&self, [first, second]: [usize; 2], levels: Range<usize>) -> PairedTest {
        self.tested(levels.len(), |item| {
            item.right(first, &levels) - item.right(second, &levels)
        })
    }

    /// The accuracies of a model, given by its index; the levels from `split` on are dark.
    fn accuracy(&self, model: usize, name: &str, split: usize) -> Option<DarkAccuracy> {
        let (n, dark) = (self.items.len(), split..self.levels);
        let by_level: Vec<f64> = (0..self.levels)
            .map(|level: usize| {
                self.items
                    .iter()
                    .filter(|item| item.right[model][level])
                    .count() as f64
                    / n as f64
            })
            .collect();
        let count = dark.len() as f64;
        let sums = self
            .sums(|item| item.right(model, &dark))
            .into_iter()
            .map(|sum| (sum.net as f64 / count, f64::from(sum.items)));
        let clean = self
            .sums(|item| item.right(model, &(0..1)))
            .into_iter()
            .map(|sum| ClusterCount {
                right: sum.net as u32,
                replies: sum.items,
            });
        let clean = Estimate::clustered(&clean.collect::<Vec<_>>())?;
        let chance = self.items.iter().map(|item| item.guess).sum::<f64>() / n as f64;
        let lost = |item: &ItemScores| {
            item.right(model, &dark) - item.right(model, &(0..1)) * dark.len() as i64
        };
        Some(DarkAccuracy {
            model: name.to_owned(),
            mean: Estimate::scored(&sums.collect::<Vec<_>>(), count, n)?,
            lighter: by_level[..split].iter().sum::<f64>() / split as f64,
            by_level,
            clean,
            loss: (clean.low > chance).then(|| self.tested(dark.len(), lost).difference),
        })
    }

    /// All pairs of models, given with their indices, with their verdicts.
    fn pairs(&self, models: &[(DarkAccuracy, usize)], split: usize) -> Vec<DarkPair> {
        let mut pairs = Vec::new();
        for (index, (first, a)) in models.iter().enumerate() {
            for (second, b) in &models[index + 1..] {
                let tested = self.less([*a, *b], split..self.levels);
                pairs.push(DarkPair {
                    first: first.model.clone(),
                    second: second.model.clone(),
                    difference: tested.difference,
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
            pair.significance = Significance::new(pair.difference.value, holm, least_holm);
        }
        pairs
    }

    /// The change of order of the leader of the lighter levels and the leader of the dark ones; `None` if they are one model, or if
    /// their order changes more than once.
    fn crossing(&self, models: &[(DarkAccuracy, usize)], levels: &[AxisLevel]) -> Option<Crossing> {
        let (dark, dark_index) = models.first()?;
        let by_lighter = |a: &&(DarkAccuracy, usize), b: &&(DarkAccuracy, usize)| {
            a.0.lighter.total_cmp(&b.0.lighter)
        };
        // `rev`, because `max_by` returns the last of equal elements; the first one is better in the dark.
        let (light, light_index) = models.iter().rev().max_by(by_lighter)?;
        let ahead = |level: usize| light.by_level[level] - dark.by_level[level];
        let split = (1..self.levels).find(|split| ahead(*split) < 0.0)?;
        let changes_once = (0..split).all(|level| ahead(level) >= 0.0)
            && (split..self.levels).all(|level| ahead(level) <= 0.0);
        if !changes_once || dark_index == light_index {
            return None;
        }
        let pair = [*light_index, *dark_index];
        let (lead, lag) = (
            self.less(pair, 0..split),
            self.less(pair, split..self.levels),
        );
        let places = (self.levels - 1) as f64;
        Some(Crossing {
            before: (light.model.clone(), levels[split - 1]),
            after: (dark.model.clone(), levels[split]),
            lead: lead.difference,
            lag: lag.difference,
            p: (places * lead.p.max(lag.p)).min(1.0),
            p_report: None,
        })
    }
}
