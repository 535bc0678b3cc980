//! Ranking of models by accuracy in the dark: [`BestInTheDark`].

use std::collections::BTreeSet;
use std::ops::Range;

use super::comparison::compares_models;
use super::holm_of;
use super::paired::{ClusterNet, PairedTest};
use super::pooled::pool;
use crate::accuracies::{Coverage, shared};
use crate::choice::ParsingMode;
use crate::estimate::{ClusterCount, Estimate};
use crate::grid::Grid;
use crate::model_in_condition::ModelInCondition;
use crate::significance::{ALPHA, Significance, SwapMethod, least_p};
use darkqa_ground::types::degradations::Kind;
use darkqa_ground::types::{AxisLevel, Variant};

/// Comparison of the models by their mean accuracy over the dark levels ([`is_dark`]) with equal weights, on raw images.
#[derive(Debug, Clone, PartialEq)]
pub struct BestInTheDark {
    /// Kind of degradation: the last kind that was asked (noise, if it was), in its first noise profile.
    pub variant: Variant,
    /// Dark levels that every model was asked.
    pub levels: Vec<AxisLevel>,
    /// Lighter levels that every model was asked, from L0.
    pub lighter: Vec<AxisLevel>,
    /// Dark levels that at least one model was asked.
    pub asked: Vec<AxisLevel>,
    /// Models with images that are not compared, because they were not asked at L0 and at a degraded level of this variant, or answered
    /// fewer items than others there.
    pub without: Vec<String>,
    /// Models with their accuracies, the best in the dark first. The first one is the leader.
    pub models: Vec<DarkAccuracy>,
    /// Models without a detected difference from the leader, in the order of `models`. If it is empty, the leader is shown to be the best.
    pub not_shown_better_than: Vec<String>,
    /// All pairs of models, in the order of `models`.
    pub pairs: Vec<DarkPair>,
    /// Leader of the lighter levels and leader of the dark levels, if they are two models whose order changes once.
    pub crossing: Option<Crossing>,
    /// Number of items that every model answered at every level.
    pub items: usize,
    /// Number of items that some model was asked at every level, left out because a model has no reply.
    pub dropped: usize,
    /// Number of clusters of the items.
    pub clusters: usize,
    /// Smallest p-value that this number of clusters, c, allows: 2 / 2ᶜ.
    pub least_p: f64,
    /// p-value of the leader being the best, after the correction over all tests behind sentences.
    pub p_report: Option<f64>,
}

impl BestInTheDark {
    /// Model with the highest mean accuracy.
    #[must_use]
    pub fn leader(&self) -> &DarkAccuracy {
        &self.models[0]
    }

    /// True if the clusters allow a verdict on at least one pair.
    #[must_use]
    pub fn is_possible(&self) -> bool {
        self.pairs
            .iter()
            .any(|pair| pair.significance.is_possible())
    }

    /// True if the leader is shown to be better than every other model, after the correction over the pairs only.
    #[must_use]
    pub fn is_shown(&self) -> bool {
        self.not_shown_better_than.is_empty()
    }

    /// True if the leader is shown to be the best, also after the correction over all sentences.
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
    /// `mean` minus the accuracy at L0; `None` if the latter is not above chance, because then nothing can be lost.
    pub loss: Option<Estimate>,
}

/// One model against another by mean accuracy over the dark levels, on the items of all models.
#[derive(Debug, Clone, PartialEq)]
pub struct DarkPair {
    pub first: String,
    pub second: String,
    /// Mean accuracy of the first minus that of the second.
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
    /// Leader of the lighter levels, and the last level at which it is ahead.
    pub before: (String, AxisLevel),
    /// Leader of the dark levels, and the first level at which it is ahead.
    pub after: (String, AxisLevel),
    /// Mean accuracy of the first minus that of the second, over the levels where the first is ahead.
    pub lead: Estimate,
    /// The same difference over the levels where the second is ahead.
    pub lag: Estimate,
    /// The larger of the two p-values, times the number of gaps between levels at which the order could change.
    pub p: f64,
    /// p-value after the correction over all tests behind sentences.
    pub p_report: Option<f64>,
}

impl Crossing {
    /// True if the change of order is detected after that correction.
    #[must_use]
    pub fn is_detected(&self) -> bool {
        self.p_report.is_some_and(|value| value < ALPHA)
    }
}

/// Exposure drop of L3, in EV.
const DARK_EV: f64 = 6.0;

/// True if a level counts as dark: L3 (6 EV) and darker, or for another kind of degradation the third step of its ladder and beyond.
#[must_use]
pub(crate) fn is_dark(level: AxisLevel, kind: Kind) -> bool {
    let threshold = kind
        .ladder()
        .get(2)
        .map_or(DARK_EV, |third| AxisLevel::new(kind, *third).value());
    level.value() >= threshold
}

/// A model and the levels at which it was asked.
type Asked<'g> = (&'g str, BTreeSet<AxisLevel>);

/// Compares the models in the dark, in one parsing. If they share no dark level, the darkest shared level counts as dark. `None` if fewer
/// than two models were asked at L0 and at a degraded level, if the models share no item, or if there are too many models to compare.
#[must_use]
pub fn best_in_the_dark(grid: &Grid<'_>, mode: ParsingMode) -> Option<BestInTheDark> {
    if !compares_models(grid) {
        return None;
    }
    let variant = grid.main_variant()?;
    let kind = variant.kind?;
    let (curves, mut without): (Vec<Asked<'_>>, Vec<Asked<'_>>) = pool(grid)
        .into_iter()
        .map(|model| (model, levels(grid, model, &variant)))
        .partition(|(_, levels)| levels.len() > 1 && levels.contains(&AxisLevel::L0));
    let (curves, incomplete) = split_by_coverage(grid, curves, &variant);
    without.extend(incomplete);
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
    let clusters = scores.clusters();
    Some(BestInTheDark {
        not_shown_better_than: pairs
            .iter()
            .filter(|pair| pair.first == *leader && pair.significance != Significance::Better)
            .map(|pair| pair.second.clone())
            .collect(),
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

/// Levels at which a model was asked about raw images of a variant; L0 is included if the clean frames are from the same runs.
fn levels(grid: &Grid<'_>, model: &str, variant: &Variant) -> BTreeSet<AxisLevel> {
    let clean = ModelInCondition::with_images(model, AxisLevel::L0, variant, None);
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

/// Splits the models into those with enough answered items and those with fewer. The latter are left out, so that they do not reduce the
/// items of the others.
fn split_by_coverage<'g>(
    grid: &Grid<'_>,
    models: Vec<Asked<'g>>,
    variant: &Variant,
) -> (Vec<Asked<'g>>, Vec<Asked<'g>>) {
    let coverages: Vec<Coverage> = models
        .iter()
        .map(|(model, levels)| {
            let sides = levels.iter().filter_map(|level| {
                let subject = grid.find_up_to_group(&ModelInCondition::with_images(
                    model, *level, variant, None,
                ))?;
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

/// Right replies of all models to an item that every model answered at every level.
struct ItemScores {
    /// Index of the cluster.
    cluster: usize,
    /// True if a model is right at a level; by model, then by level.
    right: Vec<Vec<bool>>,
    /// Probability of a right guess.
    guess: f64,
}

impl ItemScores {
    /// Number of levels in a range at which a model is right.
    fn right(&self, model: usize, levels: &Range<usize>) -> i64 {
        self.right[model][levels.clone()]
            .iter()
            .map(|right| i64::from(*right))
            .sum()
    }
}

/// Right replies of all models to the items that every model answered at every level.
struct Scores {
    items: Vec<ItemScores>,
    /// Number of levels.
    levels: usize,
    /// Number of items that are left out because a model has no reply.
    dropped: usize,
    /// Number of clusters of the whole grid.
    all_clusters: usize,
}

impl Scores {
    fn new(
        grid: &Grid<'_>,
        models: &[&str],
        variant: &Variant,
        levels: &[AxisLevel],
        mode: ParsingMode,
    ) -> Self {
        let subjects: Vec<Vec<usize>> = models
            .iter()
            .map(|model| {
                levels
                    .iter()
                    .map(|level| ModelInCondition::with_images(model, *level, variant, None))
                    .filter_map(|subject| grid.find_up_to_group(&subject))
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
            let right: Option<Vec<Vec<bool>>> = subjects
                .iter()
                .map(|levels| {
                    levels
                        .iter()
                        .map(|subject| {
                            let reading = grid.result(*subject, index).reading(mode);
                            reading.map(|chosen| item.is_right(chosen))
                        })
                        .collect()
                })
                .collect();
            let Some(right) = right else {
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

    /// Number of clusters with at least one item.
    fn clusters(&self) -> usize {
        self.cluster_sums(|_| 0).len()
    }

    /// Sums of a value over the items, for each cluster with at least one item.
    fn cluster_sums(&self, value: impl Fn(&ItemScores) -> i64) -> Vec<ClusterNet> {
        let mut sums = vec![ClusterNet { net: 0, items: 0 }; self.all_clusters];
        for item in &self.items {
            let sum = &mut sums[item.cluster];
            sum.net += value(item);
            sum.items += 1;
        }
        sums.retain(|sum| sum.items > 0);
        sums
    }

    /// Tests a difference of each item, whose maximum is `scale`.
    fn test(&self, scale: usize, difference: impl Fn(&ItemScores) -> i64) -> PairedTest {
        let squares: i64 = self.items.iter().map(|item| difference(item).pow(2)).sum();
        PairedTest::new(
            &self.cluster_sums(&difference),
            scale as f64,
            squares as f64,
        )
    }

    /// Tests the mean accuracy of the first model minus that of the second over a range of levels.
    fn test_pair(&self, [first, second]: [usize; 2], levels: Range<usize>) -> PairedTest {
        self.test(levels.len(), |item| {
            item.right(first, &levels) - item.right(second, &levels)
        })
    }

    /// Computes the accuracies of a model, given by its index; the levels from `split` on are dark.
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
        let sums: Vec<(f64, f64)> = self
            .cluster_sums(|item| item.right(model, &dark))
            .into_iter()
            .map(|sum| (sum.net as f64 / count, f64::from(sum.items)))
            .collect();
        let clean_counts: Vec<ClusterCount> = self
            .cluster_sums(|item| item.right(model, &(0..1)))
            .into_iter()
            .map(|sum| ClusterCount {
                right: sum.net as u32,
                replies: sum.items,
            })
            .collect();
        let clean = Estimate::clustered(&clean_counts)?;
        let chance = self.items.iter().map(|item| item.guess).sum::<f64>() / n as f64;
        let loss = (clean.low > chance).then(|| {
            self.test(dark.len(), |item| {
                item.right(model, &dark) - item.right(model, &(0..1)) * dark.len() as i64
            })
            .difference
        });
        Some(DarkAccuracy {
            model: name.to_owned(),
            mean: Estimate::from_scores(&sums, count, n)?,
            lighter: by_level[..split].iter().sum::<f64>() / split as f64,
            by_level,
            clean,
            loss,
        })
    }

    /// Tests all pairs of models, given with their indices.
    fn pairs(&self, models: &[(DarkAccuracy, usize)], split: usize) -> Vec<DarkPair> {
        let mut pairs = Vec::new();
        for (index, (first, a)) in models.iter().enumerate() {
            for (second, b) in &models[index + 1..] {
                let tested = self.test_pair([*a, *b], split..self.levels);
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
        let corrected = holm_of(pairs.iter().map(|pair| pair.p));
        let least_holm = pairs.len() as f64 * least_p(self.clusters());
        for (pair, holm) in pairs.iter_mut().zip(corrected) {
            pair.holm = holm;
            pair.significance = Significance::new(pair.difference.value, holm, least_holm);
        }
        pairs
    }

    /// Tests the change of order between the leader of the lighter levels and the leader of the dark ones; `None` if both are the same
    /// model, or if their order changes more than once.
    fn crossing(&self, models: &[(DarkAccuracy, usize)], levels: &[AxisLevel]) -> Option<Crossing> {
        let (dark, dark_index) = models.first()?;
        // `rev`, because `max_by` returns the last of equal elements; the first one is better in the dark.
        let (light, light_index) = models
            .iter()
            .rev()
            .max_by(|(a, _), (b, _)| a.lighter.total_cmp(&b.lighter))?;
        let lead_by_level: Vec<f64> = light
            .by_level
            .iter()
            .zip(&dark.by_level)
            .map(|(light, dark)| light - dark)
            .collect();
        let split = (1..self.levels).find(|level| lead_by_level[*level] < 0.0)?;
        let changes_once = lead_by_level[..split].iter().all(|lead| *lead >= 0.0)
            && lead_by_level[split..].iter().all(|lead| *lead <= 0.0);
        if !changes_once || dark_index == light_index {
            return None;
        }
        let pair = [*light_index, *dark_index];
        let (lead, lag) = (
            self.test_pair(pair, 0..split),
            self.test_pair(pair, split..self.levels),
        );
        let gaps = (self.levels - 1) as f64;
        Some(Crossing {
            before: (light.model.clone(), levels[split - 1]),
            after: (dark.model.clone(), levels[split]),
            lead: lead.difference,
            lag: lag.difference,
            p: (gaps * lead.p.max(lag.p)).min(1.0),
            p_report: None,
        })
    }
}
