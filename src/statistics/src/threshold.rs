//! Threshold and area of one curve from counts by level and cluster: [`LevelCounts`], [`CurveSummary`].

use super::bootstrap::Resamples;
use super::estimate::{ClusterCount, Estimate};
use super::trapezoid::weights;
use darkqa_ground::types::AxisLevel;

/// Minimum number of replies, and of clusters, of a level that carries a threshold (chosen).
const MIN_REPLIES: usize = 30;
const MIN_CLUSTERS: usize = 8;
/// Minimum number of replies of a level as a share of those at L0 (chosen).
const MIN_SHARE: f64 = 0.1;

/// Exposure drop, in EV, at which a model's accuracy is half-way between that at L0 and chance, with a 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Threshold {
    /// The threshold; infinite if accuracy at the darkest level is still above half-way.
    pub value: f64,
    /// Lower end of the interval; it may be infinite too.
    pub low: f64,
    /// Upper end of the interval; infinite if it lies beyond the darkest level.
    pub high: f64,
}

/// A level with too few replies for a threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SparseLevel {
    pub level: AxisLevel,
    /// Number of its replies.
    pub replies: usize,
    /// Number of clusters that they are about.
    pub clusters: usize,
    /// Number of replies at L0.
    pub clean_replies: usize,
}

impl SparseLevel {
    /// Whether the replies are too few compared with those at L0.
    fn is_fragment(&self) -> bool {
        (self.replies as f64) < MIN_SHARE * self.clean_replies as f64
    }

    /// Whether the replies or their clusters are too few in themselves.
    fn is_small(&self) -> bool {
        self.replies < MIN_REPLIES || self.clusters < MIN_CLUSTERS
    }

    /// Requirement on each level up to the crossing, in words.
    pub fn needed() -> String {
        format!(
            "{MIN_REPLIES} replies in {MIN_CLUSTERS} clusters, and {:.0} % of those at L0, at each level up to the crossing",
            100.0 * MIN_SHARE
        )
    }
}

/// Why a threshold is not known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoThreshold {
    /// Accuracy at L0 is not above chance, so that nothing can be lost.
    NotAboveChance,
    /// A level from L0 to the one after the crossing has too few replies.
    Thin(SparseLevel),
}

/// Threshold and area of a curve.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveSummary {
    /// The darkest level of the curve.
    pub darkest: AxisLevel,
    /// Darkness threshold, or why it is not known.
    pub threshold: Result<Threshold, NoThreshold>,
    /// Mean accuracy from L0 to the darkest level, by the trapezoid rule over EV. Its `n` is the number of replies. `None` if
    /// no degraded level has enough replies.
    pub area: Option<Estimate>,
    /// Levels that are left out of the curve, because they have too few replies.
    pub left_out: Vec<SparseLevel>,
}

/// Counts of one curve.
#[derive(Debug, Clone)]
pub struct LevelCounts {
    /// Levels in increasing severity; the first is L0.
    pub levels: Vec<AxisLevel>,
    /// Counts of each cluster, by level.
    pub counts: Vec<Vec<ClusterCount>>,
    /// Expected number of right guesses among the replies at L0, by cluster.
    pub guesses: Vec<f32>,
}

impl LevelCounts {
    /// Threshold and area; `None` without a reply at L0.
    #[must_use]
    pub fn summary(&self, draws: &Resamples) -> Option<CurveSummary> {
        let sizes: Vec<SparseLevel> = (0..self.levels.len())
            .map(|index| self.size(index))
            .collect();
        let clean = *sizes.first().filter(|clean| clean.replies > 0)?;
        // If all levels are small, the area is still computed; only fragments are left out.
        let is_left_out = |size: &SparseLevel| {
            size.replies == 0 || size.is_fragment() || size.is_small() && !clean.is_small()
        };
        let (left_out, kept): (Vec<usize>, Vec<usize>) =
            (0..sizes.len()).partition(|index| is_left_out(&sizes[*index]));
        let curve = self.only(&kept);
        Some(CurveSummary {
            darkest: *curve.levels.last()?,
            threshold: curve.threshold(draws, &sizes),
            area: (kept.len() > 1).then(|| curve.area()).flatten(),
            left_out: left_out.into_iter().map(|index| sizes[index]).collect(),
        })
    }

    /// The numbers of replies and clusters of a level.
    fn size(&self, index: usize) -> SparseLevel {
        let replies = |index: usize| {
            self.counts[index]
                .iter()
                .map(|count| count.replies as usize)
        };
        SparseLevel {
            level: self.levels[index],
            replies: replies(index).sum(),
            clusters: replies(index).filter(|replies| *replies > 0).count(),
            clean_replies: replies(0).sum(),
        }
    }

    /// The counts of some levels only.
    fn only(&self, kept: &[usize]) -> Self {
        Self {
            levels: kept.iter().map(|index| self.levels[*index]).collect(),
            counts: kept
                .iter()
                .map(|index| self.counts[*index].clone())
                .collect(),
            guesses: self.guesses.clone(),
        }
    }

    /// Severities of the levels in the unit of their axis; 0 at L0.
    fn drops(&self) -> Vec<f64> {
        self.levels.iter().map(|level| level.value()).collect()
    }

    fn total(&self, index: usize, of: fn(&ClusterCount) -> u32) -> f64 {
        self.counts[index]
            .iter()
            .map(|count| f64::from(of(count)))
            .sum()
    }

    fn replies(&self) -> Vec<f64> {
        let levels = 0..self.levels.len();
        levels
            .map(|index| self.total(index, |count| count.replies))
            .collect()
    }

    /// The threshold. `sizes` are those of all levels asked, also of those that are left out here.
    fn threshold(
        &self,
        draws: &Resamples,
        sizes: &[SparseLevel],
    ) -> Result<Threshold, NoThreshold> {
        let replies = self.replies();
        let right = (0..replies.len()).map(|index| self.total(index, |count| count.right));
        let values: Vec<f64> = right.zip(&replies).map(|(right, n)| right / n).collect();
        let drops = self.drops();
        let chance = self.guesses.iter().map(|x| f64::from(*x)).sum::<f64>() / replies[0];
        let is_thin = |size: &&SparseLevel| size.is_small() || size.is_fragment();
        if let Some(clean) = sizes.first().filter(is_thin) {
            return Err(NoThreshold::Thin(*clean));
        }
        if !above_chance(&self.counts[0], chance) {
            return Err(NoThreshold::NotAboveChance);
        }
        let (value, after) = crossing(&drops, &values, &replies, chance);
        // Without a crossing, the threshold lies beyond the last level of the curve.
        let after = self.levels[after.min(self.levels.len() - 1)];
        let mut before = sizes.iter().filter(|size| size.level <= after);
        if let Some(thin) = before.find(is_thin) {
            return Err(NoThreshold::Thin(*thin));
        }
        if self.levels.len() < 2 {
            return sizes
                .last()
                .map_or(Err(NoThreshold::NotAboveChance), |thin| {
                    Err(NoThreshold::Thin(*thin))
                });
        }
        let resampled = DrawnCurves::new(draws, &self.counts, &self.guesses);
        let drawn =
            resampled.draws(|values, weights, chance| crossing(&drops, values, weights, chance).0);
        let [low, high] = draws.interval(drawn);
        Ok(Threshold {
            value,
            low: low.min(value),
            high: high.max(value),
        })
    }

    /// Mean height of the curve by the trapezoid rule, computed as a mean of scores.
    ///
    /// Each level is weighted by its share of the width. A cluster's score is its weighted number of right answers divided by
    /// its weighted number of replies.
    fn area(&self) -> Option<Estimate> {
        let replies = self.replies();
        let weights = weights(&self.levels);
        let whole: u64 = weights.iter().sum();
        let mut sums = vec![(0.0, 0.0); self.counts.first()?.len()];
        // Levels may differ in their number of replies, so each is scaled to that of the first level.
        for ((counts, replies_here), weight) in self.counts.iter().zip(&replies).zip(&weights) {
            let scale = *weight as f64 / whole as f64 * replies[0] / replies_here;
            for (sum, count) in sums.iter_mut().zip(counts) {
                sum.0 += scale * f64::from(count.right);
                sum.1 += scale * f64::from(count.replies);
            }
        }
        sums.retain(|(_, n)| *n > 0.0);
        let n = replies.iter().sum::<f64>() as usize;
        Estimate::scored(&sums, self.levels.len() as f64, n)
    }
}

/// True if the interval of the accuracy at L0 lies above chance.
fn above_chance(clean: &[ClusterCount], chance: f64) -> bool {
    Estimate::clustered(clean).is_some_and(|estimate| estimate.low > chance)
}

/// A curve in every bootstrap draw.
struct DrawnCurves {
    /// Right answers and replies of each level, by draw.
    levels: Vec<[Vec<f64>; 2]>,
    guesses: Vec<f64>,
}

impl DrawnCurves {
    fn new(draws: &Resamples, counts: &[Vec<ClusterCount>], guesses: &[f32]) -> Self {
        let sums = |counts: &[ClusterCount], of: fn(&ClusterCount) -> u32| {
            draws.sums(
                &counts
                    .iter()
                    .map(|count| of(count) as f32)
                    .collect::<Vec<_>>(),
            )
        };
        Self {
            levels: counts
                .iter()
                .map(|counts| [sums(counts, |c| c.right), sums(counts, |c| c.replies)])
                .collect(),
            guesses: draws.sums(guesses),
        }
    }

    /// The value of `number` in each draw, from the accuracies, the replies and chance. Draws in which a level has no reply
    /// are skipped.
    fn draws(&self, number: impl Fn(&[f64], &[f64], f64) -> f64) -> Vec<f64> {
        let mut numbers = Vec::with_capacity(self.guesses.len());
        let (mut values, mut weights) = (Vec::new(), Vec::new());
        for (draw, guesses) in self.guesses.iter().enumerate() {
            values.clear();
            weights.clear();
            for [right, replies] in &self.levels {
                values.push(right[draw] / replies[draw]);
                weights.push(replies[draw]);
            }
            if !weights.contains(&0.0) {
                numbers.push(number(&values, &weights, guesses / weights[0]));
            }
        }
        numbers
    }
}

/// Exposure drop at which the accuracies cross the middle between the first one and chance.
///
/// The accuracies are first fitted by values that never rise (pool adjacent violators, Ayer et al. 1955), with straight
/// lines between the levels. Infinite if they do not cross; 0 if the first accuracy is not above chance. The second number is the
/// index of the level after the crossing; the number of levels if they do not cross.
fn crossing(drops: &[f64], values: &[f64], weights: &[f64], chance: f64) -> (f64, usize) {
    if values[0] <= chance {
        return (0.0, 0);
    }
    let middle = f64::midpoint(values[0], chance);
    let fitted = non_increasing(values, weights);
    for (after, (pair, drop)) in (1..).zip(fitted.windows(2).zip(drops.windows(2))) {
        let ([above, below], [near, far]) = ([pair[0], pair[1]], [drop[0], drop[1]]);
        if below <= middle {
            let share = if above > middle {
                (above - middle) / (above - below)
            } else {
                0.0
            };
            return (near + share * (far - near), after);
        }
    }
    (f64::INFINITY, drops.len())
}

/// Weighted least-squares fit by values that never rise.
fn non_increasing(values: &[f64], weights: &[f64]) -> Vec<f64> {
    let mut blocks: Vec<(f64, f64, usize)> = Vec::new();
    for (value, weight) in values.iter().zip(weights) {
        let mut block = (*value, *weight, 1);
        while let Some(&(block_value, block_weight, length)) = blocks.last()
            && block_value < block.0
        {
            blocks.pop();
            let sum = block_weight + block.1;
            let mean = (block_value * block_weight + block.0 * block.1) / sum;
            block = (mean, sum, length + block.2);
        }
        blocks.push(block);
    }
    blocks
        .into_iter()
        .flat_map(|(value, _, length)| std::iter::repeat_n(value, length))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_ground::types::Severity;
    use darkqa_ground::types::degradations::Kind;

    const DROPS: [f64; 6] = [0.0, 2.0, 4.0, 6.0, 7.5, 9.0];

    #[test]
    fn the_threshold_is_where_half_is_lost() {
        let weights = [1.0; 6];
        let at = |values: [f64; 6]| crossing(&DROPS, &values, &weights, 0.3).0;
        // The middle of 0.9 and 0.3 is 0.6.
        assert!((at([0.9, 0.9, 0.8, 0.7, 0.5, 0.3]) - 6.75).abs() < 1e-12);
        assert!(at([0.9, 0.9, 0.9, 0.9, 0.8, 0.7]).is_infinite());
        assert!(at([0.3, 0.3, 0.3, 0.3, 0.3, 0.3]).abs() < 1e-12);
        // A dip with a recovery does not count: pooled, levels 4 and 5 are at 0.65.
        assert!((at([0.9, 0.9, 0.9, 0.5, 0.8, 0.3]) - (7.5 + 0.05 / 0.35 * 1.5)).abs() < 1e-12);
        // All is lost at the first step.
        assert!((at([0.9, 0.3, 0.3, 0.3, 0.3, 0.3]) - 1.0).abs() < 1e-12);
    }

    /// Counts of 12 clusters at L0 and at these exposure drops in hundredths of an EV: (right, replies) of each cluster.
    fn counts(levels: &[(u16, u32, u32)]) -> LevelCounts {
        let level = |drop: u16| match drop {
            0 => AxisLevel::L0,
            drop => AxisLevel::new(Kind::Sensor, Severity::from_hundredths(drop)),
        };
        let cluster =
            |&(_, right, replies): &(u16, u32, u32)| vec![ClusterCount { right, replies }; 12];
        LevelCounts {
            levels: levels.iter().map(|(drop, _, _)| level(*drop)).collect(),
            counts: levels.iter().map(cluster).collect(),
            guesses: vec![levels[0].2 as f32 / 4.0; 12],
        }
    }

    #[test]
    fn the_area_is_the_mean_height() {
        let area = |rights: [u32; 3]| {
            let levels = [(0, rights[0], 4), (200, rights[1], 4), (900, rights[2], 4)];
            counts(&levels).area().unwrap()
        };
        // From 1 to 0.5 over 2 EV, then 0.5 over 7 EV.
        assert!((area([4, 2, 2]).value - (1.5 + 3.5) / 9.0).abs() < 1e-12);
        // Without any wrong reply the interval still has a width.
        let all = area([4, 4, 4]);
        assert!(
            all.value > 0.999 && all.low > 0.8 && all.low < 0.95,
            "{all:?}"
        );
    }

    /// Levels beyond L5, at uneven steps of their own.
    #[test]
    fn any_levels_carry_a_threshold_and_an_area_on_the_ev_axis() {
        let levels = [(0, 9, 9), (1025, 9, 9), (1100, 3, 9), (1600, 3, 9)];
        let summary = counts(&levels).summary(&Resamples::new(12)).unwrap();
        // The middle of 1 and 1/4 is 5/8; from 10.25 to 11 EV accuracy falls from 1 to 1/3.
        let threshold = summary.threshold.unwrap().value;
        assert!((threshold - (10.25 + 0.75 * 9.0 / 16.0)).abs() < 1e-6);
        let area = summary.area.unwrap().value;
        let expected = (10.25 + 0.75 * 2.0 / 3.0 + 5.0 / 3.0) / 16.0;
        assert!((area - expected).abs() < 1e-12, "{area}");
        assert!((summary.darkest.value() - 16.0).abs() < 1e-12);
        // All is kept to the end: beyond 16 EV.
        let kept = counts(&[(0, 9, 9), (1025, 9, 9), (1600, 9, 9)]);
        let kept = kept.summary(&Resamples::new(12)).unwrap();
        assert!(kept.threshold.unwrap().value.is_infinite());
    }

    #[test]
    fn thin_levels_carry_no_threshold() {
        let draws = Resamples::new(12);
        let summary = |levels: &[(u16, u32, u32)], single: Option<usize>| {
            let mut counts = counts(levels);
            if let Some(level) = single {
                let lone = ClusterCount {
                    right: 0,
                    replies: 1,
                };
                counts.counts[level].fill(ClusterCount::default());
                counts.counts[level][0] = lone;
            }
            counts.summary(&draws).unwrap()
        };
        let full = [(0, 9, 9), (400, 8, 9), (600, 4, 9), (900, 1, 9)];
        let known = summary(&full, None);
        let threshold = known.threshold.unwrap();
        assert!(threshold.value > 4.0 && threshold.value < 6.0 && known.left_out.is_empty());
        // One reply beyond the crossing is left out and named; the threshold stays.
        let beyond = summary(&full, Some(3));
        let (left_out, darkest) = (beyond.left_out[0], beyond.darkest.value());
        assert_eq!(
            (left_out.replies, left_out.clusters, left_out.clean_replies),
            (1, 1, 108)
        );
        assert!((beyond.threshold.unwrap().value - threshold.value).abs() < 1e-12);
        assert!((darkest - 6.0).abs() < 1e-12 && beyond.area.unwrap().n == 3 * 108);
        // One reply before or at the crossing: there is none.
        let at = summary(&full, Some(2));
        assert!(matches!(at.threshold, Err(NoThreshold::Thin(thin)) if thin == at.left_out[0]));
        // Few replies everywhere: an area, no threshold.
        let small = summary(&[(0, 2, 2), (400, 1, 2), (900, 0, 2)], None);
        assert!(matches!(small.threshold, Err(NoThreshold::Thin(thin)) if thin.replies == 24));
        assert!(small.area.is_some() && small.left_out.is_empty());
        // Nothing but L0.
        let lone = summary(&[(0, 9, 9), (900, 0, 9)], Some(1));
        assert!(lone.threshold.is_err() && lone.area.is_none());
        // Nothing is known in the light.
        let blind = summary(&[(0, 1, 4), (900, 1, 4)], None);
        assert_eq!(blind.threshold, Err(NoThreshold::NotAboveChance));
    }

    #[test]
    fn the_fit_never_rises_and_keeps_the_mean() {
        let fitted = non_increasing(&[0.5, 0.9, 0.2, 0.4], &[1.0, 3.0, 1.0, 1.0]);
        for (fitted, expected) in fitted.iter().zip([0.8, 0.8, 0.3, 0.3]) {
            assert!((fitted - expected).abs() < 1e-12);
        }
    }
}
