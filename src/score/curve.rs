//! Summaries of accuracy over all levels: [`Curve`], with its darkness threshold and area.

use super::bootstrap::Resamples;
use super::choice::ReadingMode;
use super::estimate::Estimate;
use super::grid::{ClusterCount, Grid, TrialResult};
use super::subject::Subject;
use crate::types::{AxisLevel, EnhancerName, Family, KindReading, LightGroup, View};

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

/// Summary of one model over all levels, in one variant, raw or with one enhancer.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    pub model: String,
    pub variant: KindReading,
    /// Enhancer; `None` for raw images.
    pub enhancer: Option<EnhancerName>,
    /// Question family; `None` for all families together.
    pub family: Option<Family>,
    /// The darkest level asked.
    pub darkest: AxisLevel,
    /// Darkness threshold; `None` if accuracy at L0 is not above chance, so that nothing can be lost.
    pub threshold: Option<Threshold>,
    /// Mean accuracy from L0 to the darkest level, by the trapezoid rule over EV. Its `n` is the number of replies.
    pub area: Estimate,
}

/// The points of one curve: one model in one variant, raw or with one enhancer.
pub(super) struct CurvePoints {
    pub(super) model: String,
    pub(super) variant: KindReading,
    pub(super) enhancer: Option<EnhancerName>,
    /// Levels in increasing severity, with the index of the subject at each. L0 is the clean frame for every curve.
    pub(super) subjects: Vec<(AxisLevel, usize)>,
}

impl CurvePoints {
    /// All curves of a grid that have L0 and at least one degraded level.
    pub(super) fn all(grid: &Grid<'_>) -> Vec<Self> {
        let degraded = grid
            .subjects
            .iter()
            .filter(|subject| subject.view == Some(View::Image) && subject.variant.kind.is_some());
        let mut keys: Vec<(&str, &KindReading, Option<&EnhancerName>)> = degraded
            .map(|subject| (&*subject.model, &subject.variant, subject.enhancer.as_ref()))
            .collect();
        keys.sort_unstable();
        keys.dedup();
        let points = keys.into_iter().map(|(model, variant, enhancer)| {
            let on_curve = |subject: &Subject| {
                subject.view == Some(View::Image)
                    && subject.model == model
                    && (subject.level == Some(AxisLevel::L0)
                        && subject.enhancer.is_none()
                        && LightGroup::meet(subject.variant.group.as_ref(), variant.group.as_ref())
                        || subject.variant == *variant && subject.enhancer.as_ref() == enhancer)
            };
            let subjects = grid.subjects.iter().enumerate();
            let on_curve = subjects.filter(|(_, subject)| on_curve(subject));
            let mut subjects: Vec<(AxisLevel, usize)> = on_curve
                .filter_map(|(index, subject)| Some((subject.level?, index)))
                .collect();
            subjects.sort_unstable();
            Self {
                model: model.to_owned(),
                variant: variant.clone(),
                enhancer: enhancer.cloned(),
                subjects,
            }
        });
        points
            .filter(|points| points.subjects.len() > 1 && points.subjects[0].0 == AxisLevel::L0)
            .collect()
    }

    /// Severities of the levels in the unit of their axis; 0 at L0.
    fn drops(&self) -> Vec<f64> {
        let subjects = self.subjects.iter();
        subjects.map(|(level, _)| level.value()).collect()
    }
}

/// All curves of a grid: each model in each variant, raw and with each enhancer. A curve needs L0 and at least one degraded
/// level.
#[must_use]
pub fn curves(grid: &Grid<'_>, draws: &Resamples, family: Option<&Family>) -> Vec<Curve> {
    CurvePoints::all(grid)
        .into_iter()
        .filter_map(|points| curve(grid, draws, family, points))
        .collect()
}

fn curve(
    grid: &Grid<'_>,
    draws: &Resamples,
    family: Option<&Family>,
    points: CurvePoints,
) -> Option<Curve> {
    let counts = points.subjects.iter();
    let counts: Vec<Vec<ClusterCount>> = counts
        .map(|(_, subject)| grid.counts(*subject, family, ReadingMode::Strict))
        .collect();
    let total = |counts: &[ClusterCount], of: fn(&ClusterCount) -> u32| -> f64 {
        counts.iter().map(|count| f64::from(of(count))).sum()
    };
    let replies: Vec<f64> = counts.iter().map(|c| total(c, |c| c.replies)).collect();
    if replies.contains(&0.0) {
        return None;
    }
    let right = counts.iter().map(|c| total(c, |c| c.right));
    let values: Vec<f64> = right.zip(&replies).map(|(right, n)| right / n).collect();
    let drops = points.drops();
    let guesses = guesses(grid, points.subjects[0].1, family);
    let chance = guesses.iter().map(|x| f64::from(*x)).sum::<f64>() / replies[0];
    let resampled = DrawnCurves::new(draws, &counts, &guesses);
    let with_interval = |value: f64, drawn: Vec<f64>| {
        let [low, high] = draws.interval(drawn);
        [value, low.min(value), high.max(value)]
    };
    let threshold = above_chance(&counts[0], chance).then(|| {
        let [value, low, high] = with_interval(
            threshold(&drops, &values, &replies, chance),
            resampled.draws(|values, weights, chance| threshold(&drops, values, weights, chance)),
        );
        Threshold { value, low, high }
    });
    Some(Curve {
        darkest: points.subjects.last()?.0,
        model: points.model,
        variant: points.variant,
        enhancer: points.enhancer,
        family: family.cloned(),
        threshold,
        area: area(&drops, &counts, &replies)?,
    })
}

/// True if the interval of the accuracy at L0 lies above chance.
fn above_chance(clean: &[ClusterCount], chance: f64) -> bool {
    Estimate::clustered(clean).is_some_and(|estimate| estimate.low > chance)
}

/// Expected number of right guesses among the replies at L0, by cluster.
fn guesses(grid: &Grid<'_>, clean: usize, family: Option<&Family>) -> Vec<f32> {
    let mut guesses = vec![0.0_f32; grid.clusters];
    for (item, result) in grid.of_family(clean, family) {
        if let TrialResult::Read { .. } = result {
            guesses[item.cluster as usize] += 1.0 / item.record.detail.choices.len() as f32;
        }
    }
    guesses
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
/// lines between the levels. Infinite if they do not cross; 0 if the first accuracy is not above chance.
fn threshold(drops: &[f64], values: &[f64], weights: &[f64], chance: f64) -> f64 {
    if values[0] <= chance {
        return 0.0;
    }
    let middle = f64::midpoint(values[0], chance);
    let fitted = non_increasing(values, weights);
    for (pair, drop) in fitted.windows(2).zip(drops.windows(2)) {
        let ([above, below], [near, far]) = ([pair[0], pair[1]], [drop[0], drop[1]]);
        if below <= middle {
            return if above > middle {
                near + (above - middle) / (above - below) * (far - near)
            } else {
                near
            };
        }
    }
    f64::INFINITY
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
    let fitted = blocks
        .into_iter()
        .flat_map(|(value, _, length)| std::iter::repeat_n(value, length));
    fitted.collect()
}

/// Mean height of the curve by the trapezoid rule, computed as a mean of scores.
///
/// Each level is weighted by its share of the width. A cluster's score is its weighted number of right answers divided by
/// its weighted number of replies.
fn area(drops: &[f64], counts: &[Vec<ClusterCount>], replies: &[f64]) -> Option<Estimate> {
    let weights = widths(drops);
    let levels = counts.iter().zip(replies).zip(&weights);
    let mut sums = vec![(0.0, 0.0); counts.first()?.len()];
    // Levels may differ in their number of replies, so each is scaled to that of the first level.
    for ((counts, replies_here), weight) in levels {
        let scale = weight * replies[0] / replies_here;
        for (sum, count) in sums.iter_mut().zip(counts) {
            sum.0 += scale * f64::from(count.right);
            sum.1 += scale * f64::from(count.replies);
        }
    }
    sums.retain(|(_, n)| *n > 0.0);
    Estimate::scored(
        &sums,
        drops.len() as f64,
        replies.iter().sum::<f64>() as usize,
    )
}

/// Weight of each level in the mean height of a curve of straight lines.
fn widths(drops: &[f64]) -> Vec<f64> {
    let last = drops.len() - 1;
    let whole = drops[last] - drops[0];
    let width = |index: usize| {
        let (before, after) = (drops[index.saturating_sub(1)], drops[(index + 1).min(last)]);
        (after - before) / 2.0 / whole
    };
    (0..=last).map(width).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const DROPS: [f64; 6] = [0.0, 2.0, 4.0, 6.0, 7.5, 9.0];

    #[test]
    fn the_threshold_is_where_half_is_lost() {
        let weights = [1.0; 6];
        let at = |values: [f64; 6]| threshold(&DROPS, &values, &weights, 0.3);
        // The middle of 0.9 and 0.3 is 0.6.
        assert!((at([0.9, 0.9, 0.8, 0.7, 0.5, 0.3]) - 6.75).abs() < 1e-12);
        assert!(at([0.9, 0.9, 0.9, 0.9, 0.8, 0.7]).is_infinite());
        assert!(at([0.3, 0.3, 0.3, 0.3, 0.3, 0.3]).abs() < 1e-12);
        // A dip with a recovery does not count: pooled, levels 4 and 5 are at 0.65.
        assert!((at([0.9, 0.9, 0.9, 0.5, 0.8, 0.3]) - (7.5 + 0.05 / 0.35 * 1.5)).abs() < 1e-12);
        // All is lost at the first step.
        assert!((at([0.9, 0.3, 0.3, 0.3, 0.3, 0.3]) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_area_is_the_mean_height() {
        let widths = widths(&DROPS);
        assert!((widths.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let counts = |rights: [u32; 3]| {
            let level = |right: u32| vec![ClusterCount { right, replies: 4 }; 10];
            rights.map(level).to_vec()
        };
        let area = |rights| area(&[0.0, 2.0, 9.0], &counts(rights), &[40.0; 3]).unwrap();
        // From 1 to 0.5 over 2 EV, then 0.5 over 7 EV.
        assert!((area([4, 2, 2]).value - (1.5 + 3.5) / 9.0).abs() < 1e-12);
        // Without any wrong reply the interval still has a width.
        let all = area([4, 4, 4]);
        assert!(
            all.value > 0.999 && all.low > 0.8 && all.low < 0.95,
            "{all:?}"
        );
    }

    #[test]
    fn the_fit_never_rises_and_keeps_the_mean() {
        let fitted = non_increasing(&[0.5, 0.9, 0.2, 0.4], &[1.0, 3.0, 1.0, 1.0]);
        for (fitted, expected) in fitted.iter().zip([0.8, 0.8, 0.3, 0.3]) {
            assert!((fitted - expected).abs() < 1e-12);
        }
    }
}
