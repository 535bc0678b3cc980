//! Threshold and area of one accuracy curve, from counts by level and cluster: [`LevelCounts`], [`CurveSummary`].
//!
//! Weights of the trapezoid rule for the mean height of a curve: [`weights`].

use super::bootstrap::Resamples;
use super::estimate::{ClusterCount, Estimate, fill_missing};
use super::significance::gcd;
use darkqa_base::types::AxisLevel;

/// Minimum number of replies of a level for a threshold (chosen).
const MIN_REPLIES: usize = 30;

/// Minimum number of clusters of a level for a threshold (chosen): the intervals of 5 held at least 94 % in each
/// simulated cell.
const MIN_CLUSTERS: usize = 5;

/// Minimum number of replies of a level as a share of those at L0 (chosen).
const MIN_SHARE: f64 = 0.1;

/// Exposure drop, in EV, at which a model's accuracy is half-way between that at L0 and the floor, with a 95 %
/// interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Threshold {
    /// The threshold; infinite if accuracy at the darkest level is still above half-way.
    pub value: f64,
    /// Lower end of the interval; it may be infinite too.
    pub low: f64,
    /// Upper end of the interval; infinite if beyond the darkest level.
    pub high: f64,
}

impl Threshold {
    /// The threshold with an interval that covers those of both bounds of the missing replies, the earliest first.
    ///
    /// # Errors
    /// If accuracy falls below half-way only with some values of the missing replies, or may do so.
    fn bounded(self, bounds: &[Result<Self, NoThreshold>; 2]) -> Result<Self, NoThreshold> {
        let [earliest, latest] = bounds;
        // Without a threshold, accuracy at L0 may not be above chance.
        let low = earliest.map_or(0.0, |bound| bound.low).min(self.low);
        if self.value.is_infinite() && low.is_finite() {
            return Err(NoThreshold::Missing { low });
        }
        Ok(Self { low, high: latest.map_or(f64::INFINITY, |bound| bound.high).max(self.high), ..self })
    }
}

/// A level with too few replies for a threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SparseLevel {
    pub level: AxisLevel,
    /// Number of replies at the level.
    pub replies: usize,
    /// Number of clusters with replies at the level.
    pub clusters: usize,
    /// Number of replies at L0.
    pub clean_replies: usize,
}

impl SparseLevel {
    /// True if the level has too few replies compared with L0.
    fn is_fragment(&self) -> bool {
        (self.replies as f64) < MIN_SHARE * self.clean_replies as f64
    }

    /// True if the level has too few replies or clusters.
    fn is_small(&self) -> bool {
        self.replies < MIN_REPLIES || self.clusters < MIN_CLUSTERS
    }

    /// True if the level has too few replies for a threshold.
    fn is_thin(&self) -> bool {
        self.is_small() || self.is_fragment()
    }

    /// The required numbers of replies and clusters, in words.
    pub fn requirement() -> String {
        format!(
            "{MIN_REPLIES} replies in {MIN_CLUSTERS} clusters, and {:.0} % of those at L0, at each level up to the crossing",
            100.0 * MIN_SHARE
        )
    }
}

/// The reason why a threshold is not known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoThreshold {
    /// Accuracy at L0 is not above the floor, so that nothing can be lost.
    NotAboveChance,
    /// A level from L0 to the one after the crossing has too few replies.
    Thin(SparseLevel),
    /// The missing replies decide whether accuracy falls below half-way.
    Missing {
        /// Lower end of the interval, in EV, from the bound with the largest loss.
        low: f64,
    },
}

/// Threshold and area of a curve.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveSummary {
    /// The darkest level of the curve.
    pub darkest: AxisLevel,
    /// Darkness threshold, or the reason why it is not known.
    pub threshold: Result<Threshold, NoThreshold>,
    /// Mean accuracy from L0 to the darkest level, by the trapezoid rule over EV. Its `n` is the number of replies.
    /// `None` if no degraded level has enough replies.
    pub area: Option<Estimate>,
    /// Accuracy of the floor: half of the distance from L0 to it is lost at the threshold.
    pub floor: f64,
    /// Levels without enough replies, which are left out of the curve.
    pub left_out: Vec<SparseLevel>,
}

/// Counts of one curve.
#[derive(Debug, Clone)]
pub struct LevelCounts {
    /// Levels in increasing severity; the first is L0.
    pub levels: Vec<AxisLevel>,
    /// Counts of each cluster, by level.
    pub counts: Vec<Vec<ClusterCount>>,
    /// Number of missing replies of each cluster, by level; a level without any may be empty.
    pub missing: Vec<Vec<u32>>,
    /// Expected number of right replies at L0 without the image, by guessing or by a model that sees no image, by
    /// cluster.
    pub guesses: Vec<f32>,
    /// The same number for the missing replies at L0; empty without any.
    pub missing_guesses: Vec<f32>,
}

impl LevelCounts {
    /// Threshold and area; `None` without a reply at L0.
    #[must_use]
    pub fn summary(&self, draws: &Resamples) -> Option<CurveSummary> {
        let sizes: Vec<SparseLevel> = (0..self.levels.len()).map(|index| self.size(index)).collect();
        let clean = *sizes.first().filter(|clean| clean.replies > 0)?;
        // If all levels are small, the area is still computed; only fragments are left out.
        let (left_out, kept): (Vec<usize>, Vec<usize>) = (0..sizes.len()).partition(|index| {
            let size = &sizes[*index];
            size.replies == 0 || size.is_fragment() || size.is_small() && !clean.is_small()
        });
        let curve = self.at_levels(&kept);
        let area = (kept.len() > 1).then(|| curve.area()).flatten();
        let (mut threshold, mut covering) = (curve.threshold(draws, &sizes), area);
        if curve.missing.iter().flatten().any(|missing| *missing > 0) {
            // The earliest crossing has the missing replies right at L0 and wrong elsewhere; the latest one the other
            // way round.
            let bounds = [true, false]
                .map(|clean_is_right| curve.filled(clean_is_right, !clean_is_right))
                .map(|curve| curve.threshold(draws, &sizes));
            threshold = threshold.and_then(|threshold| threshold.bounded(&bounds));
            let areas = [false, true].map(|are_right| curve.filled(are_right, are_right).area());
            covering = area.map(|area| area.covering(areas.into_iter().flatten()));
        }
        Some(CurveSummary {
            darkest: *curve.levels.last()?,
            threshold,
            area: covering,
            floor: curve.floor(),
            left_out: left_out.into_iter().map(|index| sizes[index]).collect(),
        })
    }

    /// The numbers of replies and clusters of a level.
    fn size(&self, index: usize) -> SparseLevel {
        let [clean, own] = [0, index].map(|index| self.counts[index].iter().map(|count| count.replies as usize));
        SparseLevel {
            level: self.levels[index],
            replies: own.clone().sum(),
            clusters: own.filter(|replies| *replies > 0).count(),
            clean_replies: clean.sum(),
        }
    }

    /// The counts of the levels with these indices.
    fn at_levels(&self, kept: &[usize]) -> Self {
        Self {
            levels: kept.iter().map(|index| self.levels[*index]).collect(),
            counts: kept.iter().map(|index| self.counts[*index].clone()).collect(),
            missing: kept.iter().map(|index| self.missing[*index].clone()).collect(),
            guesses: self.guesses.clone(),
            missing_guesses: self.missing_guesses.clone(),
        }
    }

    /// The counts with all missing replies filled in: as right or wrong at L0, and as right or wrong at the other
    /// levels.
    fn filled(&self, clean_is_right: bool, others_are_right: bool) -> Self {
        let counts = self.counts.iter().zip(&self.missing).enumerate();
        let counts = counts.map(|(level, (counts, missing))| {
            let are_right = if level == 0 { clean_is_right } else { others_are_right };
            fill_missing(counts, missing, are_right)
        });
        let missing_guesses = self.missing_guesses.iter().copied();
        Self {
            levels: self.levels.clone(),
            counts: counts.collect(),
            missing: vec![Vec::new(); self.levels.len()],
            guesses: self
                .guesses
                .iter()
                .zip(missing_guesses.chain(std::iter::repeat(0.0)))
                .map(|(guesses, missing)| guesses + missing)
                .collect(),
            missing_guesses: Vec::new(),
        }
    }

    /// Severities of the levels in the unit of their axis; 0 at L0.
    fn drops(&self) -> Vec<f64> {
        self.levels.iter().map(|level| level.value()).collect()
    }

    /// The sum of a count over the clusters of a level.
    fn total(&self, index: usize, count: fn(&ClusterCount) -> u32) -> f64 {
        self.counts[index].iter().map(|cluster| f64::from(count(cluster))).sum()
    }

    /// The number of replies at each level.
    fn replies(&self) -> Vec<f64> {
        (0..self.levels.len()).map(|index| self.total(index, |count| count.replies)).collect()
    }

    /// Accuracy of the floor: the guesses per reply at L0.
    fn floor(&self) -> f64 {
        let guesses: f64 = self.guesses.iter().map(|x| f64::from(*x)).sum();
        guesses / self.total(0, |count| count.replies)
    }

    /// The threshold of the curve. `sizes` are the numbers of replies of all levels asked, including the levels left
    /// out of the curve.
    fn threshold(&self, draws: &Resamples, sizes: &[SparseLevel]) -> Result<Threshold, NoThreshold> {
        let replies = self.replies();
        let values: Vec<f64> =
            replies.iter().enumerate().map(|(index, n)| self.total(index, |count| count.right) / n).collect();
        let drops = self.drops();
        let chance = self.floor();
        if let Some(clean) = sizes.first().filter(|size| size.is_thin()) {
            return Err(NoThreshold::Thin(*clean));
        }
        if !is_above_chance(&self.counts[0], chance) {
            return Err(NoThreshold::NotAboveChance);
        }
        let (value, after) = crossing(&drops, &values, &replies, chance);
        // Without a crossing, the threshold is beyond the last level of the curve.
        let after = self.levels[after.min(self.levels.len() - 1)];
        if let Some(thin) = sizes.iter().find(|size| size.level <= after && size.is_thin()) {
            return Err(NoThreshold::Thin(*thin));
        }
        if self.levels.len() < 2 {
            return sizes.last().map_or(Err(NoThreshold::NotAboveChance), |thin| Err(NoThreshold::Thin(*thin)));
        }
        let resampled = DrawnCurves::new(draws, &self.counts, &self.guesses);
        let drawn = resampled.statistic(|values, weights, chance| crossing(&drops, values, weights, chance).0);
        let [low, high] = draws.interval(drawn);
        let high = high.max(value);
        let is_beyond = drops.last().is_some_and(|darkest| high > *darkest);
        Ok(Threshold { value, low: low.min(value).max(0.0), high: if is_beyond { f64::INFINITY } else { high } })
    }

    /// Mean height of the curve by the trapezoid rule, computed as a mean of scores.
    ///
    /// Each level is weighted by its share of the width. A cluster's score is its weighted number of right answers
    /// divided by its weighted number of replies.
    fn area(&self) -> Option<Estimate> {
        let replies = self.replies();
        let weights = weights(&self.levels);
        let whole: u64 = weights.iter().sum();
        let mut sums = vec![(0.0, 0.0); self.counts.first()?.len()];
        // Levels may differ in their number of replies, so each level is scaled to the number of the first one.
        for ((counts, replies_here), weight) in self.counts.iter().zip(&replies).zip(&weights) {
            let scale = *weight as f64 / whole as f64 * replies[0] / replies_here;
            for (sum, count) in sums.iter_mut().zip(counts) {
                sum.0 += scale * f64::from(count.right);
                sum.1 += scale * f64::from(count.replies);
            }
        }
        sums.retain(|(_, n)| *n > 0.0);
        let n = replies.iter().sum::<f64>() as usize;
        Estimate::from_scores(&sums, self.levels.len() as f64, n)
    }
}

/// True if the whole interval of the accuracy at L0 is above chance.
fn is_above_chance(clean: &[ClusterCount], chance: f64) -> bool {
    Estimate::clustered(clean).is_some_and(|estimate| estimate.low > chance)
}

/// The counts of a curve in every bootstrap draw.
struct DrawnCurves {
    /// Right answers and replies of each level, by draw.
    levels: Vec<[Vec<f64>; 2]>,
    guesses: Vec<f64>,
}

impl DrawnCurves {
    fn new(draws: &Resamples, counts: &[Vec<ClusterCount>], guesses: &[f32]) -> Self {
        Self {
            levels: counts
                .iter()
                .map(|clusters| {
                    let right: Vec<f32> = clusters.iter().map(|c| c.right as f32).collect();
                    let replies: Vec<f32> = clusters.iter().map(|c| c.replies as f32).collect();
                    [draws.sums(&right), draws.sums(&replies)]
                })
                .collect(),
            guesses: draws.sums(guesses),
        }
    }

    /// The value of a statistic in each draw, computed from the accuracies, the numbers of replies, and chance. Draws
    /// without a reply at some level are skipped.
    fn statistic(&self, number: impl Fn(&[f64], &[f64], f64) -> f64) -> Vec<f64> {
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
/// The accuracies are first fitted by a non-increasing sequence (pool adjacent violators, Ayer et al. 1955) and
/// interpolated linearly. Infinite without a crossing; 0 if the first accuracy is not above chance. The second number
/// is the index of the level after the crossing, or the number of levels without a crossing.
fn crossing(drops: &[f64], values: &[f64], weights: &[f64], chance: f64) -> (f64, usize) {
    if values[0] <= chance {
        return (0.0, 0);
    }
    let middle = f64::midpoint(values[0], chance);
    let fitted = non_increasing(values, weights);
    for (after, (pair, drop)) in (1..).zip(fitted.windows(2).zip(drops.windows(2))) {
        let ([above, below], [near, far]) = ([pair[0], pair[1]], [drop[0], drop[1]]);
        if below <= middle {
            let share = if above > middle { (above - middle) / (above - below) } else { 0.0 };
            return (near + share * (far - near), after);
        }
    }
    (f64::INFINITY, drops.len())
}

/// Weighted least-squares fit by a non-increasing sequence.
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
    blocks.into_iter().flat_map(|(value, _, length)| std::iter::repeat_n(value, length)).collect()
}

/// Weights of the levels in the trapezoid rule, as integers without a common divisor, so that sums are exact.
#[must_use]
pub(crate) fn weights(levels: &[AxisLevel]) -> Vec<u64> {
    let drops: Vec<u64> = levels.iter().map(|level| (100.0 * level.value()).round() as u64).collect();
    let last = drops.len().saturating_sub(1);
    let widths: Vec<u64> =
        (0..drops.len()).map(|index| drops[(index + 1).min(last)] - drops[index.saturating_sub(1)]).collect();
    let divisor = widths.iter().copied().fold(0, gcd).max(1);
    widths.into_iter().map(|width| width / divisor).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::Severity;
    use darkqa_base::types::degradations::Kind;

    const DROPS: [f64; 6] = [0.0, 2.0, 4.0, 6.0, 7.5, 9.0];

    #[test]
    fn threshold_is_where_half_is_lost() {
        // The middle of 0.9 and 0.3 is 0.6.
        assert!((threshold_of([0.9, 0.9, 0.8, 0.7, 0.5, 0.3]) - 6.75).abs() < 1e-12);
        assert!(threshold_of([0.9, 0.9, 0.9, 0.9, 0.8, 0.7]).is_infinite());
        assert!(threshold_of([0.3, 0.3, 0.3, 0.3, 0.3, 0.3]).abs() < 1e-12);
        // A dip with a recovery does not count: pooled, levels 4 and 5 are at 0.65.
        assert!((threshold_of([0.9, 0.9, 0.9, 0.5, 0.8, 0.3]) - (7.5 + 0.05 / 0.35 * 1.5)).abs() < 1e-12);
        // All is lost at the first step.
        assert!((threshold_of([0.9, 0.3, 0.3, 0.3, 0.3, 0.3]) - 1.0).abs() < 1e-12);
    }

    /// The threshold of a curve at the exposure drops [`DROPS`], with chance 0.3.
    fn threshold_of(values: [f64; 6]) -> f64 {
        crossing(&DROPS, &values, &[1.0; 6], 0.3).0
    }

    /// Counts of 12 equal clusters at levels with (exposure drop in hundredths of an EV, right replies, replies) of
    /// each cluster.
    fn counts(levels: &[(u16, u32, u32)]) -> LevelCounts {
        LevelCounts {
            levels: levels
                .iter()
                .map(|(drop, ..)| match drop {
                    0 => AxisLevel::L0,
                    drop => AxisLevel::new(Kind::Sensor, Severity::from_hundredths(*drop)),
                })
                .collect(),
            counts: levels.iter().map(|&(_, right, replies)| vec![ClusterCount { right, replies }; 12]).collect(),
            missing: vec![Vec::new(); levels.len()],
            guesses: vec![levels[0].2 as f32 / 4.0; 12],
            missing_guesses: Vec::new(),
        }
    }

    #[test]
    fn area_is_the_mean_height() {
        // From 1 to 0.5 over 2 EV, then 0.5 over 7 EV.
        let falling = counts(&[(0, 4, 4), (200, 2, 4), (900, 2, 4)]).area();
        assert!((falling.unwrap().value - (1.5 + 3.5) / 9.0).abs() < 1e-12);
        // Without a wrong reply the interval still has a width.
        let all = counts(&[(0, 4, 4), (200, 4, 4), (900, 4, 4)]).area();
        let all = all.unwrap();
        assert!(all.value > 0.999 && all.low > 0.8 && all.low < 0.95, "{all:?}");
    }

    /// Levels beyond L5, at uneven steps.
    #[test]
    fn any_levels_have_threshold_and_area() {
        let levels = [(0, 9, 9), (1025, 9, 9), (1100, 3, 9), (1600, 3, 9)];
        let summary = counts(&levels).summary(&Resamples::new(12)).unwrap();
        // The middle of 1 and 1/4 is 5/8; from 10.25 to 11 EV accuracy falls from 1 to 1/3.
        let threshold = summary.threshold.unwrap().value;
        assert!((threshold - (10.25 + 0.75 * 9.0 / 16.0)).abs() < 1e-6);
        let area = summary.area.unwrap().value;
        let expected = (10.25 + 0.75 * 2.0 / 3.0 + 5.0 / 3.0) / 16.0;
        assert!((area - expected).abs() < 1e-12, "{area}");
        assert!((summary.darkest.value() - 16.0).abs() < 1e-12);
        // Without a loss the threshold is beyond 16 EV.
        let kept = counts(&[(0, 9, 9), (1025, 9, 9), (1600, 9, 9)]);
        let kept = kept.summary(&Resamples::new(12)).unwrap();
        assert!(kept.threshold.unwrap().value.is_infinite());
    }

    #[test]
    fn thin_levels_have_no_threshold() {
        let full = [(0, 9, 9), (400, 8, 9), (600, 4, 9), (900, 1, 9)];
        let known = summary_with_single(&full, None);
        let threshold = known.threshold.unwrap();
        assert!(threshold.value > 4.0 && threshold.value < 6.0 && known.left_out.is_empty());
        // A single reply beyond the crossing is left out and listed; the threshold does not change.
        let beyond = summary_with_single(&full, Some(3));
        let (left_out, darkest) = (beyond.left_out[0], beyond.darkest.value());
        assert_eq!((left_out.replies, left_out.clusters, left_out.clean_replies), (1, 1, 108));
        assert!((beyond.threshold.unwrap().value - threshold.value).abs() < 1e-12);
        assert!((darkest - 6.0).abs() < 1e-12 && beyond.area.unwrap().n == 3 * 108);
        // With a single reply before or at the crossing, the threshold is unknown.
        let at = summary_with_single(&full, Some(2));
        assert!(matches!(at.threshold, Err(NoThreshold::Thin(thin)) if thin == at.left_out[0]));
        // With few replies everywhere, only the area is known.
        let small = summary_with_single(&[(0, 2, 2), (400, 1, 2), (900, 0, 2)], None);
        assert!(matches!(small.threshold, Err(NoThreshold::Thin(thin)) if thin.replies == 24));
        assert!(small.area.is_some() && small.left_out.is_empty());
        // L0 alone.
        let lone = summary_with_single(&[(0, 9, 9), (900, 0, 9)], Some(1));
        assert!(lone.threshold.is_err() && lone.area.is_none());
        // Accuracy at L0 is at chance.
        let blind = summary_with_single(&[(0, 1, 4), (900, 1, 4)], None);
        assert_eq!(blind.threshold, Err(NoThreshold::NotAboveChance));
    }

    /// The summary of [`counts`]; the level at the index `single` has only a single reply.
    fn summary_with_single(levels: &[(u16, u32, u32)], single: Option<usize>) -> CurveSummary {
        let mut counts = counts(levels);
        if let Some(level) = single {
            counts.counts[level].fill(ClusterCount::default());
            counts.counts[level][0].replies = 1;
        }
        counts.summary(&Resamples::new(12)).unwrap()
    }

    #[test]
    fn fit_never_rises_and_keeps_the_mean() {
        let fitted = non_increasing(&[0.5, 0.9, 0.2, 0.4], &[1.0, 3.0, 1.0, 1.0]);
        for (fitted, expected) in fitted.iter().zip([0.8, 0.8, 0.3, 0.3]) {
            assert!((fitted - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn weights_follow_the_trapezoid_rule() {
        let paper = Severity::LADDER.map(|severity| AxisLevel::new(Kind::Sensor, severity));
        let paper = [&[AxisLevel::L0][..], &paper].concat();
        assert_eq!(weights(&paper), [4, 8, 8, 7, 6, 3]);
        let odd = [
            AxisLevel::L0,
            AxisLevel::new(Kind::Sensor, Severity::from_hundredths(330)),
            AxisLevel::new(Kind::Sensor, Severity::L5),
        ];
        assert_eq!(weights(&odd), [11, 30, 19]);
    }
}
