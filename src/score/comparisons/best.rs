//! Ranking of models by accuracy in the dark: [`BestInTheDark`].
//!
//! Right replies of all models by item and level ([`CommonScores`]), and what they show of models and pairs of models.
//!
//! Ranks of models as ranges: [`RankRange`].

use std::collections::BTreeSet;
use std::ops::Range;

use super::comparison::ranks_models;
use super::paired::{BoundedSums, PairedTest, net_bounds};
use super::pooled::pool;
use super::tested::Tested;
use crate::accuracies::{LevelCoverage, shared};
use crate::choice::ParsingMode;
use crate::estimate::Estimate;
use crate::grid::Grid;
use crate::model_in_condition::ModelInCondition;
use crate::significance::{ALPHA, PValues, Verdict, least_p};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{AxisLevel, Variant};

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
        self.pairs.iter().any(|pair| pair.tested.verdict.is_possible())
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
    pub fn verdict(&self, pair: &DarkPair, is_detected: bool) -> Option<Verdict> {
        match pair.tested.verdict {
            own if !own.is_possible() => Some(own),
            _ if pair.first != self.leader().model => None,
            _ if is_detected => Some(Verdict::Better),
            _ => Some(Verdict::NotShown),
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
        self.pairs
            .iter()
            .filter(|pair| pair.first == self.leader().model)
            .map(|pair| pair.tested.holm)
            .fold(0.0, f64::max)
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
type AskedLevels<'g> = (&'g str, BTreeSet<AxisLevel>);

/// Compares the models in the dark, with replies parsed in `mode`. If the models share no dark level, the darkest
/// shared level counts as dark. `None` if the grid has too many models to compare, if fewer than two models were asked
/// at L0 and at a degraded level, or if the models share no degraded level or no item.
#[must_use]
pub fn best_in_the_dark(grid: &Grid<'_>, mode: ParsingMode) -> Option<BestInTheDark> {
    if !ranks_models(grid) {
        return None;
    }
    let variant = grid.main_variant()?;
    let kind = variant.kind?;
    let (compared, mut without): (Vec<AskedLevels<'_>>, Vec<AskedLevels<'_>>) = pool(grid)
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
    let scores = CommonScores::new(grid, &names, &variant, &levels, mode);
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
            .filter(|pair| pair.first == *leader && pair.tested.verdict != Verdict::Better)
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
    models: Vec<AskedLevels<'g>>,
    variant: &Variant,
) -> (Vec<AskedLevels<'g>>, Vec<AskedLevels<'g>>) {
    let coverages: Vec<LevelCoverage> = models
        .iter()
        .map(|(model, levels)| {
            let sides = levels.iter().filter_map(|level| {
                let subject = grid.find_up_to_group(&ModelInCondition::with_images(model, *level, variant, None))?;
                Some((*level, vec![subject]))
            });
            LevelCoverage::new(grid, sides, |_| true)
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
    /// Mean accuracy of `first` minus mean accuracy of `second`. Holm's correction is over all pairs of models.
    pub tested: Tested,
}

/// Mean accuracy of the leader over the dark levels minus what it reaches without seeing.
#[derive(Debug, Clone, PartialEq)]
pub struct DarkGain {
    /// True if the leader is compared with its own replies without images; false if it was not asked so, and is
    /// compared with chance.
    pub is_against_blind: bool,
    /// Difference on the items that have a reply without images, or on all items. p is that of the null hypothesis that
    /// the leader is not above; 1 if it is below.
    pub tested: Tested,
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
    /// Accuracy of the leader at the lighter levels minus that of the leader in the dark. p is multiplied by the number of pairs
    /// of models (Bonferroni over the pairs that could have led).
    pub tested: Tested,
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
pub(super) struct CommonScores {
    /// Items that every model answered at every level.
    items: Vec<ItemScores>,
    /// Items of which a reply is missing.
    incomplete: Vec<ItemScores>,
    /// Number of levels.
    levels: usize,
    /// Number of items left out because a reply is missing (see [`BestInTheDark::dropped`]).
    dropped: usize,
    /// Number of clusters of the whole grid.
    all_clusters: usize,
}

impl CommonScores {
    fn new(grid: &Grid<'_>, models: &[&str], variant: &Variant, levels: &[AxisLevel], mode: ParsingMode) -> Self {
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
            if !grid.has_item(subjects.iter().flatten().copied(), index) {
                continue;
            }
            let is_asked =
                |levels: &Vec<usize>| levels.iter().all(|subject| grid.compared_result(*subject, index).is_asked());
            let right = subjects.iter().map(|levels| {
                levels
                    .iter()
                    .map(|subject| {
                        let reading = grid.compared_result(*subject, index).parsed(mode);
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
                        let reading = grid.compared_result((*subject)?, index).parsed(mode)?;
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
    fn clusters(&self) -> usize {
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
    fn gain(&self, model: usize, split: usize) -> Option<DarkGain> {
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
        let Tested { difference, p, .. } = tested.tested;
        let p = if difference.value > 0.0 { p } else { 1.0 };
        Some(DarkGain { is_against_blind, tested: Tested::new(difference, p) })
    }

    /// Tests the mean accuracy of the first model minus that of the second over a range of levels.
    fn test_pair(&self, [first, second]: [usize; 2], levels: Range<usize>) -> Option<PairedTest> {
        self.test(levels.len(), |item| {
            let pairs = levels.clone().map(|level| [(first, level), (second, level)]);
            Some(item.net_bounds(pairs))
        })
    }

    /// Computes the accuracies of the model with index `model`. Levels from index `split` on are dark.
    fn accuracy(&self, model: usize, name: &str, split: usize) -> Option<DarkAccuracy> {
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
            .map(|tested| tested.tested.difference);
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
    fn pairs(&self, models: &[(DarkAccuracy, usize)], split: usize) -> Vec<DarkPair> {
        let mut pairs = Vec::new();
        for (index, (first, a)) in models.iter().enumerate() {
            for (second, b) in &models[index + 1..] {
                let Some(tested) = self.test_pair([*a, *b], split..self.levels) else {
                    continue;
                };
                pairs.push(DarkPair {
                    first: first.model.clone(),
                    second: second.model.clone(),
                    tested: tested.tested,
                });
            }
        }
        let least = least_p(self.clusters());
        let tests = pairs.iter().map(|pair| pair.tested.p_values(least));
        let corrected = PValues::corrected(&tests.collect::<Vec<PValues>>());
        for (pair, corrected) in pairs.iter_mut().zip(corrected) {
            pair.tested.correct(pair.tested.difference.value, corrected);
        }
        pairs
    }

    /// Tests the leader at the lighter levels against the leader in the dark at each level; `None` if both are the same
    /// model.
    fn crossing(&self, models: &[(DarkAccuracy, usize)], levels: &[AxisLevel]) -> Option<Crossing> {
        let (dark, dark_index) = models.first()?;
        // `max_by` returns the last of equal elements; with `rev` that is the model with the higher accuracy in the
        // dark.
        let (light, light_index) = models.iter().rev().max_by(|(a, _), (b, _)| a.lighter.total_cmp(&b.lighter))?;
        if dark_index == light_index {
            return None;
        }
        let pairs = models.len() * (models.len() - 1) / 2;
        let levels = levels.iter().enumerate().filter_map(|(index, level)| {
            let Tested { difference, p, .. } = self.test_pair([*light_index, *dark_index], index..index + 1)?.tested;
            Some(LevelLead { level: *level, tested: Tested::new(difference, (pairs as f64 * p).min(1.0)) })
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

/// Possible ranks of a model among all compared models, from `first` to `last` inclusive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct RankRange {
    /// Number of models that are shown to be better, plus 1.
    pub first: usize,
    /// Number of models that are not shown to be worse.
    pub last: usize,
}

/// Ranks of the models of a comparison, in its order. Models without a detected difference share ranks.
pub fn rank_ranges(best: &BestInTheDark) -> Vec<RankRange> {
    best.models
        .iter()
        .map(|model| {
            let (mut better, mut worse) = (0, 0);
            for pair in &best.pairs {
                let (is_first, is_second) = (pair.first == model.model, pair.second == model.model);
                match pair.tested.verdict {
                    Verdict::Better if is_second => better += 1,
                    Verdict::Worse if is_first => better += 1,
                    Verdict::Better if is_first => worse += 1,
                    Verdict::Worse if is_second => worse += 1,
                    _ => {}
                }
            }
            RankRange { first: better + 1, last: best.models.len() - worse }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{DarkAccuracy, DarkGain, DarkPair, *};
    use crate::estimate::Estimate;
    use darkqa_base::types::Variant;

    fn best(names: &[&str], shown: &[(&str, &str, Verdict)]) -> BestInTheDark {
        let share = Estimate { value: 0.5, low: 0.4, high: 0.6, n: 10 };
        let models = names.iter().map(|name| DarkAccuracy {
            model: (*name).to_owned(),
            mean: share,
            lighter: 0.5,
            by_level: Vec::new(),
            clean: share,
            loss: None,
        });
        let pairs = shown.iter().map(|(first, second, verdict)| DarkPair {
            first: (*first).to_owned(),
            second: (*second).to_owned(),
            tested: Tested { verdict: *verdict, ..Tested::new(share, 0.01) },
        });
        BestInTheDark {
            variant: Variant::NONE,
            levels: Vec::new(),
            lighter: Vec::new(),
            gain: DarkGain { is_against_blind: false, tested: Tested::new(share, 1.0) },
            crossing: None,
            p_report: None,
            asked: Vec::new(),
            without: Vec::new(),
            models: models.collect(),
            not_shown_better_than: Vec::new(),
            pairs: pairs.collect(),
            items: 10,
            dropped: 0,
            clusters: 10,
            least_p: 0.01,
        }
    }

    /// Ranges of ranks of four models.
    fn ranges(shown: &[(&str, &str, Verdict)]) -> Vec<(usize, usize)> {
        rank_ranges(&best(&["a", "b", "c", "d"], shown)).into_iter().map(|rank| (rank.first, rank.last)).collect()
    }

    #[test]
    fn ties_share_their_places() {
        use Verdict::{Better, NotShown, TooFewClusters, Worse};
        // No difference is detected, whether or not the clusters allow it.
        let unshown = [("a", "b", NotShown), ("a", "c", TooFewClusters)];
        assert_eq!(ranges(&unshown), [(1, 4); 4]);
        // The first is shown to be better than all others, the last worse than the first alone.
        let first =
            [("a", "b", Better), ("a", "c", Better), ("a", "d", Better), ("b", "c", NotShown), ("b", "d", Better)];
        assert_eq!(ranges(&first), [(1, 1), (2, 3), (2, 4), (3, 4)]);
        // A pair counts the same from its other side.
        assert_eq!(ranges(&[("b", "a", Worse)]), ranges(&[("a", "b", Better)]));
    }
}
