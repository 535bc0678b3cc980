//! Share of the image's influence on a model that is left in a condition ([`evidence`]), and the exposure drop at which
//! half of it is lost ([`EvidenceCurve`]).

use crate::accuracies::{CurvePoints, Floor};
use crate::bootstrap::Resamples;
use crate::choice::ParsingMode;
use crate::comparisons::paired::difference;
use crate::estimate::{ClusterCount, Estimate, fill_missing};
use crate::grid::Grid;
use crate::model_in_condition::ModelInCondition;
use crate::threshold::{LevelCounts, NoThreshold, Threshold};
use darkqa_base::types::{AxisLevel, EnhancerName, Family, Variant};

/// Minimum distance between floor and ceiling for reporting a share of evidence (chosen).
pub const MIN_DISTANCE: f64 = 0.1;

/// Reason why no share of evidence is given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoEvidence {
    /// No question was asked again at L0, so the ceiling is unknown.
    NotAgain,
    /// The model was not asked without images, so the floor is unknown.
    NotBlind,
    /// The ceiling is less than [`MIN_DISTANCE`] above the floor: this distance.
    Close(f64),
    /// The lower bound of the 95 % interval of the distance is at or below 0: this bound. The share of a distance that
    /// may be 0 has no bounded interval (Fieller 1954, J. R. Stat. Soc. B 16:175).
    Unsure(f64),
}

/// Agreement of a model with its answers at L0: without an image (floor), and asked again at L0 (ceiling).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bounds {
    /// Counts of the floor, by cluster.
    blind: Vec<ClusterCount>,
    /// Counts of the ceiling, by cluster.
    again: Vec<ClusterCount>,
    /// Floor and ceiling in each draw of the bootstrap; NaN in a draw without replies.
    drawn: Vec<[f64; 2]>,
}

impl Bounds {
    /// Computes the bounds of a subject on the items of a family.
    ///
    /// # Errors
    /// If one of them was not asked, or if they are or may be too close.
    pub(super) fn new(
        grid: &Grid<'_>,
        subject: &ModelInCondition,
        family: Option<&Family>,
        mode: ParsingMode,
        draws: &Resamples,
    ) -> Result<Self, NoEvidence> {
        let light = ModelInCondition::with_images(&subject.model, AxisLevel::L0, &subject.variant, None);
        let again = grid.find_up_to_group(&light).ok_or(NoEvidence::NotAgain)?;
        let blind = ModelInCondition::new(&subject.model, None);
        let blind = grid.find_up_to_group(&blind).ok_or(NoEvidence::NotBlind)?;
        let [blind, again] = [blind, again].map(|subject| grid.counts(subject, family, mode));
        let ceiling = share(&again).ok_or(NoEvidence::NotAgain)?;
        let floor = share(&blind).ok_or(NoEvidence::NotBlind)?;
        if ceiling - floor < MIN_DISTANCE {
            return Err(NoEvidence::Close(ceiling - floor));
        }
        let drawn: Vec<[f64; 2]> = drawn_shares(&blind, draws)
            .into_iter()
            .zip(drawn_shares(&again, draws))
            .map(|(floor, ceiling)| [floor, ceiling])
            .collect();
        let distances =
            drawn.iter().map(|[floor, ceiling]| ceiling - floor).filter(|distance| !distance.is_nan()).collect();
        let [low, _] = draws.interval(distances);
        if low <= 0.0 {
            return Err(NoEvidence::Unsure(low));
        }
        Ok(Self { blind, again, drawn })
    }
}

/// Share of the items that agree; `None` without a reply.
fn share(counts: &[ClusterCount]) -> Option<f64> {
    let right: u32 = counts.iter().map(|count| count.right).sum();
    let replies: u32 = counts.iter().map(|count| count.replies).sum();
    (replies > 0).then(|| f64::from(right) / f64::from(replies))
}

/// Share of the items that agree in each draw; NaN in a draw without replies.
fn drawn_shares(counts: &[ClusterCount], draws: &Resamples) -> Vec<f64> {
    let right: Vec<f32> = counts.iter().map(|count| count.right as f32).collect();
    let replies: Vec<f32> = counts.iter().map(|count| count.replies as f32).collect();
    draws.sums(&right).iter().zip(&draws.sums(&replies)).map(|(right, n)| right / n).collect()
}

/// Position of an agreement between floor and ceiling, which are at 0 and 1.
fn position(here: f64, floor: f64, ceiling: f64) -> f64 {
    (here - floor) / (ceiling - floor)
}

/// Estimates the position of the agreement G of a condition between the floor B and the ceiling C: (G − B) / (C − B),
/// with the interval of the cluster bootstrap. It may be outside 0 to 1. `missing` is the number of missing replies of
/// each cluster in the condition, and the interval holds for all values of them. `None` without replies in the
/// condition.
///
/// If all clusters agree as often as at the floor, or as at the ceiling, all draws are equal. That is no certainty, so
/// the interval is then that of the difference between the two agreements, divided by the distance C − B.
pub(super) fn evidence(
    counts: &[ClusterCount],
    missing: &[u32],
    bounds: &Bounds,
    draws: &Resamples,
) -> Option<Estimate> {
    let estimate = evidence_of_replies(counts, bounds, draws)?;
    if missing.iter().all(|missing| *missing == 0) {
        return Some(estimate);
    }
    let others =
        [false, true].map(|are_right| evidence_of_replies(&fill_missing(counts, missing, are_right), bounds, draws));
    Some(estimate.covering(others.into_iter().flatten()))
}

fn evidence_of_replies(counts: &[ClusterCount], bounds: &Bounds, draws: &Resamples) -> Option<Estimate> {
    let value = position(share(counts)?, share(&bounds.blind)?, share(&bounds.again)?);
    // Draws without replies are dropped. Floor and ceiling coincide in fewer draws than the interval excludes, so its
    // ends are finite.
    let drawn: Vec<f64> = drawn_shares(counts, draws)
        .into_iter()
        .zip(&bounds.drawn)
        .map(|(here, [floor, ceiling])| position(here, *floor, *ceiling))
        .filter(|value| !value.is_nan())
        .collect();
    let replies = counts.iter().map(|count| count.replies as usize).sum();
    let [low, high] = draws.interval(drawn);
    let ends = if low < high {
        [low, high]
    } else {
        let nearest = if value < 0.5 { &bounds.blind } else { &bounds.again };
        let distance = share(&bounds.again)? - share(&bounds.blind)?;
        let difference = cluster_difference(counts, nearest);
        [difference.low, difference.high].map(|end| value + (end - difference.value) / distance)
    };
    Some(Estimate::around(value, ends, replies))
}

/// Difference of the agreements of two conditions on the same items, with its interval by cluster.
fn cluster_difference(first: &[ClusterCount], second: &[ClusterCount]) -> Estimate {
    let clusters: Vec<(f64, f64)> = first
        .iter()
        .zip(second)
        .filter(|(first, second)| first.replies.min(second.replies) > 0)
        .map(|(first, second)| {
            let net = f64::from(first.right) - f64::from(second.right);
            (net, f64::from(first.replies.min(second.replies)))
        })
        .collect();
    let squares = clusters.iter().map(|(net, _)| net.abs()).sum();
    let n = clusters.iter().map(|(_, items)| *items as usize).sum();
    difference(&clusters, squares, n)
}

/// Reason why the exposure drop at which half of the evidence is lost is unknown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoHalf {
    /// No share of evidence is given.
    NoEvidence(NoEvidence),
    /// The levels do not determine a threshold.
    Curve(NoThreshold),
}

/// Exposure drop at which a model loses half of its evidence, in one variant, raw or with one enhancer.
#[derive(Debug, Clone, PartialEq)]
pub struct EvidenceCurve {
    pub model: String,
    pub variant: Variant,
    /// Enhancer; `None` for raw images.
    pub enhancer: Option<EnhancerName>,
    /// Darkest level of the curve.
    pub darkest: AxisLevel,
    pub threshold: Result<Threshold, NoHalf>,
}

/// Computes the curves of a model over all families, in the strict parsing. The agreement falls from the ceiling at L0;
/// half of the evidence is lost half-way between ceiling and floor. The threshold is computed as in other reports, with
/// the floor in place of chance.
pub(super) fn curves(grid: &Grid<'_>, draws: &Resamples) -> Vec<EvidenceCurve> {
    let mode = ParsingMode::Strict;
    CurvePoints::all(grid)
        .into_iter()
        .filter_map(|points| {
            let (_, light) = points.subjects.first()?;
            let (darkest, _) = points.subjects.last()?;
            let bounds = Bounds::new(grid, &grid.subjects[*light], None, mode, draws);
            let threshold = match bounds {
                Err(reason) => Err(NoHalf::NoEvidence(reason)),
                Ok(bounds) => {
                    let subjects = points.subjects.iter();
                    let missing: Vec<Vec<u32>> =
                        subjects.clone().map(|(_, subject)| grid.failed(*subject, None)).collect();
                    let floor = Floor::from_blind(&bounds.blind, &bounds.again, &missing[0])?;
                    let counts = LevelCounts {
                        levels: subjects.clone().map(|(level, _)| *level).collect(),
                        counts: subjects.map(|(_, subject)| grid.counts(*subject, None, mode)).collect(),
                        missing,
                        guesses: floor.replies,
                        missing_guesses: floor.missing,
                    };
                    let summary = counts.summary(draws)?;
                    summary.threshold.map_err(NoHalf::Curve)
                }
            };
            Some(EvidenceCurve {
                darkest: *darkest,
                threshold,
                model: points.model,
                variant: points.variant,
                enhancer: points.enhancer,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_draws_are_no_certainty() {
        let draws = Resamples::new(10);
        let counts = |right| vec![ClusterCount { right, replies: 6 }; 10];
        let (blind, again) = (counts(2), counts(6));
        let drawn = drawn_shares(&blind, &draws)
            .into_iter()
            .zip(drawn_shares(&again, &draws))
            .map(|(floor, ceiling)| [floor, ceiling])
            .collect();
        let bounds = Bounds { blind, again, drawn };
        for (right, expected) in [(2, 0.0), (6, 1.0)] {
            let kept = evidence(&counts(right), &[], &bounds, &draws).unwrap();
            assert!((kept.value - expected).abs() < 1e-12);
            // 60 equal pairs, of which the two added ones count 1 + 0.2 · 5 times, and a distance of two thirds.
            let half = crate::comparisons::paired::difference(&[(0.0, 6.0); 10], 0.0, 60).high;
            assert!((kept.high - expected - 1.5 * half).abs() < 1e-12, "{kept:?}");
            assert!((expected - kept.low - 1.5 * half).abs() < 1e-12, "{kept:?}");
        }
    }
}
