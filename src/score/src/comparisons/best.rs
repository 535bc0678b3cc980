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

/// Comparison of the models by mean accuracy over the dark levels ([`is_dark`]), with equal weights, on images without an enhancer.
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
    /// Models that saw images but are excluded: they lack L0 or a degraded level of this variant, or answered fewer items than others.
    pub without: Vec<String>,
    /// Accuracies of the models by descending mean over the dark levels. The first model is the leader.
    pub models: Vec<DarkAccuracy>,
    /// Models that the leader does not beat significantly, in the order of `models`. Empty if the leader is significantly the best.
    pub not_shown_better_than: Vec<String>,
    /// All pairs of models, in the order of `models`.
    pub pairs: Vec<DarkPair>,
    /// Change of order between the leader at the lighter levels and the leader in the dark; `None` if both are one model or their order
    /// changes more than once.
    pub crossing: Option<Crossing>,
    /// Number of items that every model answered at every level.
    pub items: usize,
    /// Number of items left out because a reply is missing or unread. At least one model was asked them at every level.
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
        self.pairs
            .iter()
            .any(|pair| pair.significance.is_possible())
    }

    /// True if the leader is significantly better than every other model. Only the correction over all pairs is applied.
    #[must_use]
    pub fn is_shown(&self) -> bool {
        self.not_shown_better_than.is_empty()
    }

    /// True if the leader is significantly the best, also after the correction over all tests that the report's sentences use.
    #[must_use]
    pub fn is_detected(&self) -> bool {
        self.is_shown() && self.p_report.is_some_and(|value| value < ALPHA)
    }

    /// p-value for the claim that the leader is the best: the largest p-value of its pairs after Holm's correction over all pairs.
    #[must_use]
    pub(crate) fn p_leader(&self) -> f64 {
        self.pairs
            .iter()
            .filter(|pair| pair.first == self.leader().model)
            .map(|pair| pair.holm)
            .fold(0.0, f64::max)
    }
}

/// Accuracies of one model, on the items that all models answered.
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
    /// `mean` minus the accuracy at L0. `None` if the accuracy at L0 is not above chance, so that nothing can be lost.
    pub loss: Option<Estimate>,
}

/// Comparison of two models by mean accuracy over the dark levels, on the items that all models answered.
#[derive(Debug, Clone, PartialEq)]
pub struct DarkPair {
    pub first: String,
    pub second: String,
    /// Mean accuracy of `first` minus mean accuracy of `second`.
    pub difference: Estimate,
    /// p-value of the null hypothesis of no difference.
    pub p: f64,
    /// Method that computed `p`.
    pub p_by: SwapMethod,
    /// p-value after Holm's correction over all pairs of models.
    pub holm: f64,
    pub significance: Significance,
}

/// Two models whose order changes once with the level.
#[derive(Debug, Clone, PartialEq)]
pub struct Crossing {
    /// Leader at the lighter levels, and the last level before the change of order.
    pub before: (String, AxisLevel),
    /// Leader in the dark, and the first level after the change of order.
    pub after: (String, AxisLevel),
    /// Mean accuracy of the `before` model minus the `after` model, over the levels before the change of order.
    pub lead: Estimate,
    /// Mean accuracy of the `before` model minus the `after` model, over the levels after the change of order.
    pub lag: Estimate,
    /// Larger p-value of `lead` and `lag`, times the number of gaps between levels and the number of pairs of models (Bonferroni over the
    /// possible places of the change and the pairs that could have led).
    pub p: f64,
    /// `p` after the correction over all tests that the report's sentences use; `None` before that correction.
    pub p_report: Option<f64>,
}

impl Crossing {
    /// True if `p_report` is significant.
    #[must_use]
    pub fn is_detected(&self) -> bool {
        self.p_report.is_some_and(|value| value < ALPHA)
    }
}

/// Exposure drop of L3, in EV.
const DARK_EV: f64 = 6.0;

/// True if a level counts as dark: the third step of its kind's ladder or a more severe level. Without a third step, L3 (6 EV) or darker.
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

/// Compares the models in the dark, with replies parsed in `mode`. If the models share no dark level, the darkest shared level counts as
/// dark. `None` if the grid has too many models to compare, if fewer than two models were asked at L0 and at a degraded level, or if
/// the models share no degraded level or no item.
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
    let asked: BTreeSet<AxisLevel> = compared
        .iter()
        .flat_map(|(_, levels)| levels)
        .copied()
        .filter(|level| *level >= dark[0])
        .collect();
    let names: Vec<&str> = compared.iter().map(|(model, _)| *model).collect();
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

/// Levels at which a model was asked about images of a variant without an enhancer. L0 is included if it was asked in the same runs.
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

/// Splits the models into those with complete coverage and those with too few answered items. An incomplete model would reduce the items
/// on which all models are compared.
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

/// Scores of all models on one item that every model answered at every level.
struct ItemScores {
    /// Index of the item's cluster.
    cluster: usize,
    /// True if a model is right at a level; by model, then by level.
    right: Vec<Vec<bool>>,
    /// Probability of a right guess.
    guess: f64,
}

impl ItemScores {
    /// Number of levels in a range at which a model is right.
    fn right_count(&self, model: usize, levels: &Range<usize>) -> i64 {
        self.right[model][levels.clone()]
            .iter()
            .map(|right| i64::from(*right))
            .sum()
    }
}

/// Scores of all models on the items that every model answered at every level.
struct Scores {
    items: Vec<ItemScores>,
    /// Number of levels.
    levels: usize,
    /// Number of items left out because a reply is missing or unread (see [`BestInTheDark::dropped`]).
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

    /// Tests the mean of a difference by item. `scale` is the largest possible difference of an item.
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
            item.right_count(first, &levels) - item.right_count(second, &levels)
        })
    }

    /// Computes the accuracies of the model with index `model`. Levels from index `split` on are dark.
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
            .cluster_sums(|item| item.right_count(model, &dark))
            .into_iter()
            .map(|sum| (sum.net as f64 / count, f64::from(sum.items)))
            .collect();
        let clean_counts: Vec<ClusterCount> = self
            .cluster_sums(|item| item.right_count(model, &(0..1)))
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
                item.right_count(model, &dark)
                    - item.right_count(model, &(0..1)) * dark.len() as i64
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

    /// Tests all pairs of `models`, which come with their indices in the scores. Levels from index `split` on are dark.
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

    /// Tests the change of order between the leader at the lighter levels and the leader in the dark. `None` if both are the same model, or
    /// if their order does not change exactly once.
    fn crossing(&self, models: &[(DarkAccuracy, usize)], levels: &[AxisLevel]) -> Option<Crossing> {
        let (dark, dark_index) = models.first()?;
        // `max_by` returns the last of equal elements; with `rev` that is the model with the higher accuracy in the dark.
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
        let gaps = self.levels - 1;
        let pairs = models.len() * (models.len() - 1) / 2;
        Some(Crossing {
            before: (light.model.clone(), levels[split - 1]),
            after: (dark.model.clone(), levels[split]),
            lead: lead.difference,
            lag: lag.difference,
            p: ((gaps * pairs) as f64 * lead.p.max(lag.p)).min(1.0),
            p_report: None,
        })
    }
}
