//! Right replies of all models by item and level ([`Scores`]), and what they show of models and pairs of models.

use std::collections::BTreeSet;
use std::ops::Range;

use super::super::paired::{BoundedSums, PairedTest, net_bounds};
use crate::choice::ParsingMode;
use crate::estimate::Estimate;
use crate::grid::Grid;
use crate::model_in_condition::ModelInCondition;
use crate::significance::{ALPHA, PValues, Significance, SwapMethod, least_p};
use darkqa_base::types::{AxisLevel, Variant};

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
    /// Smallest p-value that any values of the missing replies could give.
    pub p_if_answered: f64,
    /// Method that computed `p`.
    pub p_by: SwapMethod,
    /// p-value after Holm's correction over all pairs of models.
    pub holm: f64,
    pub significance: Significance,
}

/// Mean accuracy of the leader over the dark levels minus what it reaches without seeing.
#[derive(Debug, Clone, PartialEq)]
pub struct DarkGain {
    /// True if the leader is compared with its own replies without images; false if it was not asked so, and is
    /// compared with chance.
    pub is_against_blind: bool,
    /// Difference on the items that have a reply without images, or on all items.
    pub difference: Estimate,
    /// p-value of the null hypothesis that the leader is not above; 1 if it is below.
    pub p: f64,
    /// `p` after the correction over all tests that the report's sentences use; `None` before that correction.
    pub p_report: Option<f64>,
}

impl DarkGain {
    /// True if the leader is detected to be above what it reaches without seeing.
    #[must_use]
    pub fn is_detected(&self) -> bool {
        self.p_report.is_some_and(|value| value < ALPHA)
    }
}

/// Leader at the lighter levels against the leader in the dark, at each level.
#[derive(Debug, Clone, PartialEq)]
pub struct Crossing {
    /// Leader at the lighter levels.
    pub light: String,
    /// Leader in the dark.
    pub dark: String,
    /// Differences at all levels, the lighter ones first.
    pub levels: Vec<LevelLead>,
}

/// Difference of two models at one level.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelLead {
    pub level: AxisLevel,
    /// Accuracy of the leader at the lighter levels minus that of the leader in the dark.
    pub lead: Estimate,
    /// p-value of the null hypothesis of no difference, times the number of pairs of models (Bonferroni over the pairs
    /// that could have led).
    pub p: f64,
    /// `p` after the correction over all tests that the report's sentences use; `None` before that correction.
    pub p_report: Option<f64>,
}

impl LevelLead {
    /// True if a difference is detected.
    #[must_use]
    pub fn is_detected(&self) -> bool {
        self.p_report.is_some_and(|value| value < ALPHA)
    }
}

/// Scores of all models on one item.
pub(super) struct ItemScores {
    /// Index of the item's cluster.
    cluster: u32,
    /// True if a model is right at a level, by model, then by level; `None` without a reply.
    right: Vec<Vec<Option<bool>>>,
    /// True if a model is right without images; `None` without such a reply. By model.
    blind: Vec<Option<bool>>,
    /// Number of choices.
    choices: usize,
}

impl ItemScores {
    fn is_complete(&self) -> bool {
        self.right.iter().flatten().all(Option::is_some)
    }

    /// Number of levels in a range at which a model is right, if its missing replies are all `if_missing`.
    fn right_count(&self, model: usize, levels: &Range<usize>, if_missing: bool) -> i64 {
        self.right[model][levels.clone()].iter().map(|right| i64::from(right.unwrap_or(if_missing))).sum()
    }

    /// Smallest and largest sum of differences over pairs of a model and a level ([`net_bounds`]).
    fn net_bounds(&self, pairs: impl Iterator<Item = [(usize, usize); 2]>) -> [i64; 2] {
        net_bounds(pairs.map(|sides| sides.map(|(model, level)| self.right[model][level])))
    }
}

/// Scores of all models on the items that every model was asked at every level.
pub(super) struct Scores {
    /// Items that every model answered at every level.
    pub(super) items: Vec<ItemScores>,
    /// Items of which a reply is missing.
    incomplete: Vec<ItemScores>,
    /// Number of levels.
    levels: usize,
    /// Number of items left out because a reply is missing (see [`super::BestInTheDark::dropped`]).
    pub(super) dropped: usize,
    /// Number of clusters of the whole grid.
    all_clusters: usize,
}

impl Scores {
    pub(super) fn new(
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
        let blind: Vec<Option<usize>> =
            models.iter().map(|model| grid.find_up_to_group(&ModelInCondition::new(model, None))).collect();
        let mut scores = Self {
            items: Vec::new(),
            incomplete: Vec::new(),
            levels: levels.len(),
            dropped: 0,
            all_clusters: grid.clusters,
        };
        for (index, item) in grid.items.iter().enumerate() {
            let is_asked = |levels: &Vec<usize>| levels.iter().all(|subject| grid.result(*subject, index).is_asked());
            let right = subjects.iter().map(|levels| {
                levels
                    .iter()
                    .map(|subject| {
                        let reading = grid.result(*subject, index).reading(mode);
                        reading.map(|chosen| item.is_right(chosen))
                    })
                    .collect()
            });
            let scored = ItemScores {
                cluster: item.cluster,
                right: right.collect(),
                blind: blind
                    .iter()
                    .map(|subject| {
                        let reading = grid.result((*subject)?, index).reading(mode)?;
                        Some(item.is_right(reading))
                    })
                    .collect(),
                choices: item.asked.choices.len().max(1),
            };
            if scored.is_complete() {
                scores.items.push(scored);
                continue;
            }
            scores.dropped += usize::from(subjects.iter().any(is_asked));
            if subjects.iter().all(is_asked) {
                scores.incomplete.push(scored);
            }
        }
        scores
    }

    /// Number of clusters with at least one complete item.
    pub(super) fn clusters(&self) -> usize {
        let clusters: BTreeSet<u32> = self.items.iter().map(|item| item.cluster).collect();
        clusters.len()
    }

    /// Sum and number of a score between 0 and 1 of each item, for each cluster with at least one item.
    fn cluster_sums<'s>(
        &self,
        items: impl Iterator<Item = &'s ItemScores>,
        score: impl Fn(&ItemScores) -> f64,
    ) -> Vec<(f64, f64)> {
        let mut sums = vec![(0.0, 0.0); self.all_clusters];
        for item in items {
            let (sum, n) = &mut sums[item.cluster as usize];
            *sum += score(item);
            *n += 1.0;
        }
        sums.retain(|(_, n)| *n > 0.0);
        sums
    }

    /// Mean accuracy of a model over a range of levels. Its interval holds for all values of the missing replies.
    fn mean(&self, model: usize, levels: &Range<usize>) -> Option<Estimate> {
        let count = levels.len() as f64;
        let (n, max_weight) = (self.items.len(), count);
        let share =
            |if_missing: bool| move |item: &ItemScores| item.right_count(model, levels, if_missing) as f64 / count;
        let sums = self.cluster_sums(self.items.iter(), share(false));
        let estimate = Estimate::from_scores(&sums, max_weight, n)?;
        if self.incomplete.is_empty() {
            return Some(estimate);
        }
        let bounds = [false, true].map(|if_missing| {
            let all = self.items.iter().chain(&self.incomplete);
            Estimate::from_scores(&self.cluster_sums(all, share(if_missing)), max_weight, n)
        });
        Some(estimate.covering(bounds.into_iter().flatten()))
    }

    /// Tests the mean of a difference over the items that have one. `scale` is the largest possible difference of an
    /// item; `bounds` are its smallest and largest value. `None` if no complete item has one.
    fn test(&self, scale: usize, bounds: impl Fn(&ItemScores) -> Option<[i64; 2]>) -> Option<PairedTest> {
        let mut sums = BoundedSums::new(self.all_clusters);
        for item in &self.items {
            if let Some([net, _]) = bounds(item) {
                sums.add(item.cluster, net);
            }
        }
        for item in &self.incomplete {
            if let Some([lowest, highest]) = bounds(item) {
                sums.add_missing(item.cluster, lowest, highest);
            }
        }
        sums.test(scale as f64)
    }

    /// Tests whether a model is above its own replies without images or, if it has none, above chance, over the dark
    /// levels. Levels from index `split` on are dark.
    pub(super) fn gain(&self, model: usize, split: usize) -> Option<DarkGain> {
        let dark = split..self.levels;
        let levels = dark.len() as i64;
        let right = |item: &ItemScores| [false, true].map(|if_missing| item.right_count(model, &dark, if_missing));
        let is_against_blind = self.items.iter().any(|item| item.blind[model].is_some());
        let tested = if is_against_blind {
            self.test(dark.len(), |item| {
                let blind = i64::from(item.blind[model]?);
                Some(right(item).map(|right| right - levels * blind))
            })
        } else {
            // A guess among k choices counts 1 / k; the common multiple makes all differences integers.
            let multiple = self.items.iter().chain(&self.incomplete).map(|item| item.choices).fold(1, common_multiple);
            self.test(dark.len() * multiple, |item| {
                let guessed = levels * (multiple / item.choices) as i64;
                Some(right(item).map(|right| right * multiple as i64 - guessed))
            })
        }?;
        Some(DarkGain {
            is_against_blind,
            difference: tested.difference,
            p: if tested.difference.value > 0.0 { tested.p } else { 1.0 },
            p_report: None,
        })
    }

    /// Tests the mean accuracy of the first model minus that of the second over a range of levels.
    fn test_pair(&self, [first, second]: [usize; 2], levels: Range<usize>) -> Option<PairedTest> {
        self.test(levels.len(), |item| {
            let pairs = levels.clone().map(|level| [(first, level), (second, level)]);
            Some(item.net_bounds(pairs))
        })
    }

    /// Computes the accuracies of the model with index `model`. Levels from index `split` on are dark.
    pub(super) fn accuracy(&self, model: usize, name: &str, split: usize) -> Option<DarkAccuracy> {
        let (n, dark) = (self.items.len(), split..self.levels);
        let by_level: Vec<f64> = (0..self.levels)
            .map(|level: usize| {
                self.items.iter().filter(|item| item.right[model][level] == Some(true)).count() as f64 / n as f64
            })
            .collect();
        let clean = self.mean(model, &(0..1))?;
        let guesses = self.items.iter().map(|item| 1.0 / item.choices as f64);
        let chance = guesses.sum::<f64>() / n as f64;
        let loss = (clean.low > chance)
            .then(|| {
                self.test(dark.len(), |item| {
                    let pairs = dark.clone().map(|level| [(model, level), (model, 0)]);
                    Some(item.net_bounds(pairs))
                })
            })
            .flatten()
            .map(|tested| tested.difference);
        Some(DarkAccuracy {
            model: name.to_owned(),
            mean: self.mean(model, &dark)?,
            lighter: by_level[..split].iter().sum::<f64>() / split as f64,
            by_level,
            clean,
            loss,
        })
    }

    /// Tests all pairs of `models`, which come with their indices in the scores. Levels from index `split` on are dark.
    pub(super) fn pairs(&self, models: &[(DarkAccuracy, usize)], split: usize) -> Vec<DarkPair> {
        let mut pairs = Vec::new();
        for (index, (first, a)) in models.iter().enumerate() {
            for (second, b) in &models[index + 1..] {
                let Some(tested) = self.test_pair([*a, *b], split..self.levels) else {
                    continue;
                };
                pairs.push(DarkPair {
                    first: first.model.clone(),
                    second: second.model.clone(),
                    difference: tested.difference,
                    p: tested.p,
                    p_if_answered: tested.p_if_answered,
                    p_by: tested.by,
                    holm: 1.0,
                    significance: Significance::NotShown,
                });
            }
        }
        let least = least_p(self.clusters());
        let tests = pairs.iter().map(|pair| PValues { p: pair.p, if_answered: pair.p_if_answered, least });
        let corrected = PValues::corrected(&tests.collect::<Vec<PValues>>());
        for (pair, corrected) in pairs.iter_mut().zip(corrected) {
            pair.holm = corrected.p;
            pair.significance = Significance::new(pair.difference.value, corrected);
        }
        pairs
    }

    /// Tests the leader at the lighter levels against the leader in the dark at each level; `None` if both are the same
    /// model.
    pub(super) fn crossing(&self, models: &[(DarkAccuracy, usize)], levels: &[AxisLevel]) -> Option<Crossing> {
        let (dark, dark_index) = models.first()?;
        // `max_by` returns the last of equal elements; with `rev` that is the model with the higher accuracy in the
        // dark.
        let (light, light_index) = models.iter().rev().max_by(|(a, _), (b, _)| a.lighter.total_cmp(&b.lighter))?;
        if dark_index == light_index {
            return None;
        }
        let pairs = models.len() * (models.len() - 1) / 2;
        let levels = levels.iter().enumerate().filter_map(|(index, level)| {
            let tested = self.test_pair([*light_index, *dark_index], index..index + 1)?;
            Some(LevelLead {
                level: *level,
                lead: tested.difference,
                p: (pairs as f64 * tested.p).min(1.0),
                p_report: None,
            })
        });
        Some(Crossing { light: light.model.clone(), dark: dark.model.clone(), levels: levels.collect() })
    }
}

/// Least common multiple of two positive numbers.
fn common_multiple(one: usize, other: usize) -> usize {
    let (mut divisor, mut rest) = (one, other);
    while rest > 0 {
        (divisor, rest) = (rest, divisor % rest);
    }
    one / divisor * other
}
