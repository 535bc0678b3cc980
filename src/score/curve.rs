//! Accuracy over darkness as a whole: [`Curve`], with its threshold and area.

use super::bootstrap::Resamples;
use super::choice::ReadingMode;
use super::estimate::Estimate;
use super::grid::{ClusterCount, Grid, TrialResult};
use super::subject::Subject;
use crate::types::{AxisLevel, EnhancerName, Family, KindReading, View};

/// The exposure drop at which a model's accuracy is half-way between that in the light and chance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Threshold {
    /// In EV; infinite where the darkest level is still above it.
    pub value: f64,
    /// The lower end of its 95 % interval.
    pub low: f64,
    /// The upper end; infinite where that is beyond the darkest level.
    pub high: f64,
}

/// One model in one variant, raw or enhanced, over the levels.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// The model.
    pub model: String,
    /// The variant.
    pub variant: KindReading,
    /// The enhancer; `None` for raw.
    pub enhancer: Option<EnhancerName>,
    /// The family; `None` for all.
    pub family: Option<Family>,
    /// The darkest level of it.
    pub darkest: AxisLevel,
    /// The darkness threshold; `None` where the accuracy in the light is not above chance, so that there is nothing to lose.
    pub threshold: Option<Threshold>,
    /// The mean accuracy from L0 to the darkest level, by the trapezoid rule over EV; `n` is the replies.
    pub area: Estimate,
}

/// The line of one model in one variant, raw or enhanced.
pub(super) struct CurvePoints {
    pub(super) model: String,
    pub(super) variant: KindReading,
    pub(super) enhancer: Option<EnhancerName>,
    /// Its levels, lightest first, with the index of the subject of each; L0 is the untouched frame for all.
    pub(super) subjects: Vec<(AxisLevel, usize)>,
}

impl CurvePoints {
    /// The lines of a grid of which L0 and a darker level were asked.
    pub(super) fn all(grid: &Grid<'_>) -> Vec<Self> {
        let dark = grid.subjects.iter().filter(|subject| {
            subject.view == Some(View::Image) && subject.variant != KindReading::NONE
        });
        let mut lines: Vec<(&str, &KindReading, Option<&EnhancerName>)> = dark
            .map(|subject| (&*subject.model, &subject.variant, subject.enhancer.as_ref()))
            .collect();
        lines.sort_unstable();
        lines.dedup();
        let points = lines.into_iter().map(|(model, variant, enhancer)| {
            let of_line = |subject: &Subject| {
                subject.view == Some(View::Image)
                    && subject.model == model
                    && (subject.level == Some(AxisLevel::L0) && subject.enhancer.is_none()
                        || subject.variant == *variant && subject.enhancer.as_ref() == enhancer)
            };
            let subjects = grid.subjects.iter().enumerate();
            let of_line = subjects.filter(|(_, subject)| of_line(subject));
            let mut subjects: Vec<(AxisLevel, usize)> = of_line
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

    /// The severities of the levels, in the unit of their axis; 0 at L0.
    fn drops(&self) -> Vec<f64> {
        let subjects = self.subjects.iter();
        subjects.map(|(level, _)| level.value()).collect()
    }
}

/// All curves of a grid: of each model, in each variant, raw and with each enhancer, of which L0 and a darker level were
/// asked.
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
    let within = |value: f64, drawn: Vec<f64>| {
        let [low, high] = draws.interval(drawn);
        [value, low.min(value), high.max(value)]
    };
    let threshold = above_chance(&counts[0], chance).then(|| {
        let [value, low, high] = within(
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

/// Whether the light is more than guessing: the interval of the accuracy at L0 lies above chance.
fn above_chance(light: &[ClusterCount], chance: f64) -> bool {
    Estimate::clustered(light).is_some_and(|estimate| estimate.low > chance)
}

/// What guessing would get right of the replies at L0, by cluster.
fn guesses(grid: &Grid<'_>, light: usize, family: Option<&Family>) -> Vec<f32> {
    let mut guesses = vec![0.0_f32; grid.clusters];
    for (item, mark) in grid.of_family(light, family) {
        if let TrialResult::Read { .. } = mark {
            guesses[item.cluster as usize] += 1.0 / item.record.detail.choices.len() as f32;
        }
    }
    guesses
}

/// A curve in every draw of the clusters.
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

    /// A number in each draw, from the accuracies, the replies and chance; draws that leave a level without a reply are
    /// passed over.
    fn draws(&self, number: impl Fn(&[f64], &[f64], f64) -> f64) -> Vec<f64> {
        let mut made = Vec::with_capacity(self.guesses.len());
        let (mut values, mut weights) = (Vec::new(), Vec::new());
        for (draw, guesses) in self.guesses.iter().enumerate() {
            values.clear();
            weights.clear();
            for [right, replies] in &self.levels {
                values.push(right[draw] / replies[draw]);
                weights.push(replies[draw]);
            }
            if !weights.contains(&0.0) {
                made.push(number(&values, &weights, guesses / weights[0]));
            }
        }
        made
    }
}

/// The drop at which accuracies that never rise, fitted to these (pool adjacent violators, Ayer et al. 1955), cross the
/// middle between the first and chance, by lines between the levels; infinite where they do not, 0 where the first is not
/// above chance.
fn threshold(drops: &[f64], values: &[f64], weights: &[f64], chance: f64) -> f64 {
    if values[0] <= chance {
        return 0.0;
    }
    let middle = f64::midpoint(values[0], chance);
    let fitted = falling(values, weights);
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

/// The weighted least-squares fit that never rises.
fn falling(values: &[f64], weights: &[f64]) -> Vec<f64> {
    let mut blocks: Vec<(f64, f64, usize)> = Vec::new();
    for (value, weight) in values.iter().zip(weights) {
        let mut block = (*value, *weight, 1);
        while let Some(&(before, heavy, length)) = blocks.last()
            && before < block.0
        {
            blocks.pop();
            let sum = heavy + block.1;
            let mean = (before * heavy + block.0 * block.1) / sum;
            block = (mean, sum, length + block.2);
        }
        blocks.push(block);
    }
    let fitted = blocks
        .into_iter()
        .flat_map(|(value, _, length)| std::iter::repeat_n(value, length));
    fitted.collect()
}

/// The mean height of the curve by the trapezoid rule, as a mean of scores: each level has its share of the width, so that a
/// cluster's score is its right answers at each level, weighted, over its replies there.
fn area(drops: &[f64], counts: &[Vec<ClusterCount>], replies: &[f64]) -> Option<Estimate> {
    let weights = widths(drops);
    let levels = counts.iter().zip(replies).zip(&weights);
    let mut sums = vec![(0.0, 0.0); counts.first()?.len()];
    // Levels may differ in replies: each is brought to the first one's number.
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

/// The share of each level in the mean height of a curve of straight lines.
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
        // A dip that is made good again does not count: pooled, levels 4 and 5 are at 0.65.
        assert!((at([0.9, 0.9, 0.9, 0.5, 0.8, 0.3]) - (7.5 + 0.05 / 0.35 * 1.5)).abs() < 1e-12);
        // At once.
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
        // From 1 to a half over 2 EV, then a half over 7.
        assert!((area([4, 2, 2]).value - (1.5 + 3.5) / 9.0).abs() < 1e-12);
        // Never wrong is not certain to be never wrong.
        let all = area([4, 4, 4]);
        assert!(
            all.value > 0.999 && all.low > 0.8 && all.low < 0.95,
            "{all:?}"
        );
    }

    #[test]
    fn the_fit_never_rises_and_keeps_the_mean() {
        let fitted = falling(&[0.5, 0.9, 0.2, 0.4], &[1.0, 3.0, 1.0, 1.0]);
        for (fitted, due) in fitted.iter().zip([0.8, 0.8, 0.3, 0.3]) {
            assert!((fitted - due).abs() < 1e-12);
        }
    }
}
