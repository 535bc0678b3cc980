//! How far the confidence of models goes with their accuracy: [`calibrations`].
//!
//! The confidence of a reply is the greatest probability of a choice. Only replies with such probabilities are in these figures, and
//! of these only those without reasoning before the answer; the others are counted. Right is by the strict parsing.

mod blind_shift;
mod confident_reply;
mod expected_error;
mod positions;
mod reliability;
mod risk;
mod rotations;
mod tested;

use std::collections::BTreeMap;

use super::bootstrap::Resamples;
use super::estimate::Estimate;
use super::grid::Grid;
use super::subject::ModelInCondition;
use confident_reply::{ConfidentReply, accuracy, confident_replies};
use darkqa_ground::types::AxisLevel;
use darkqa_statistics::auc::{Auc, PairCounts, RankedReply};

pub use positions::PositionShare;
pub use reliability::ReliabilityBin;
pub use risk::RiskCoverage;
pub use tested::TestedConfidence;

/// The least number of replies with probabilities that a sentence is about (chosen): that of a calibration error.
pub const LEAST_CONFIDENT_REPLIES: usize = 100;

/// The least number of replies for an expected calibration error (chosen).
const LEAST_REPLIES: usize = 100;

/// Confidence and accuracy of a subject.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// The model in its condition.
    pub subject: ModelInCondition,
    /// Number of replies with probabilities, which all figures are of.
    pub replies: usize,
    /// Number of replies with reasoning before the answer, which no figure is of.
    pub reasoned: usize,
    /// Number of replies without probabilities.
    pub unstated: usize,
    /// Mean confidence.
    pub confidence: Estimate,
    /// Accuracy of the same replies.
    pub accuracy: Estimate,
    /// Confidence less accuracy, with its test: above 0 the model is overconfident.
    pub overconfidence: TestedConfidence,
    /// Overconfidence less that at L0, on the items of both; for raw degraded images of a model that was asked at L0.
    pub growth: Option<TestedConfidence>,
    /// Expected calibration error (`expected_error`); `None` below 100 replies.
    pub error: Option<Estimate>,
    /// Mean Brier score over all choices, 0 to 2 (Brier 1950, Mon. Weather Rev. 78:1).
    pub brier: Estimate,
    /// 1 − Brier score / Brier score of equal probabilities for all choices; 0 is a guess, 1 is perfect.
    pub skill: Estimate,
    /// Mean negative logarithm of the probability of the true choice, in nats.
    pub nll: Estimate,
    /// Risk among the most confident replies.
    pub risk: RiskCoverage,
    /// The share of pairs of a right and a wrong reply in which the right one is more confident.
    pub auroc: Option<Auc>,
    /// Mean distance between the probabilities with the image and those of the same model without one.
    pub blind_shift: Option<Estimate>,
    /// Accuracy of the choice with the greatest probability averaged over the orders of choices, if there are several.
    pub over_orders: Option<Estimate>,
    /// Accuracy over confidence, in bins.
    pub bins: Vec<ReliabilityBin>,
    /// Probability and truth by the place of a choice.
    pub positions: Vec<PositionShare>,
}

/// The calibration of each subject with probabilities.
#[must_use]
pub fn calibrations(grid: &Grid<'_>, draws: &Resamples) -> Vec<Calibration> {
    let subjects = 0..grid.subjects.len();
    subjects
        .filter_map(|subject| calibration(grid, draws, subject))
        .collect()
}

fn calibration(grid: &Grid<'_>, draws: &Resamples, subject: usize) -> Option<Calibration> {
    let sorted = confident_replies(grid, subject);
    let replies = &*sorted.replies;
    if replies.is_empty() {
        return None;
    }
    let n = replies.len();
    let mean = |number: fn(&ConfidentReply) -> f64| ratio(draws, replies, number, |_| 1.0);
    let skill = ratio(draws, replies, |reply| reply.brier, |reply| reply.guess);
    let error = (n >= LEAST_REPLIES).then(|| expected_error::estimate(draws, replies));
    Some(Calibration {
        subject: grid.subjects[subject].clone(),
        replies: n,
        reasoned: sorted.reasoned,
        unstated: sorted.unstated,
        confidence: mean(|reply| reply.confidence),
        accuracy: accuracy(grid.clusters, replies)?,
        overconfidence: TestedConfidence::new(
            grid.clusters,
            replies.iter().map(|reply| (reply.cluster, reply.excess())),
        )?,
        growth: growth(grid, subject, replies),
        error,
        brier: mean(|reply| reply.brier),
        skill: Estimate {
            value: 1.0 - skill.value,
            low: 1.0 - skill.high,
            high: 1.0 - skill.low,
            n,
        },
        nll: mean(|reply| reply.nll),
        risk: RiskCoverage::new(replies),
        auroc: auroc(grid.clusters, replies),
        blind_shift: blind_shift(grid, draws, subject),
        over_orders: rotations::accuracy(grid, subject),
        bins: reliability::bins(grid.clusters, replies),
        positions: positions::shares(grid, subject),
    })
}

/// How much further the confidence is above the accuracy than at L0, on the items of both.
fn growth(grid: &Grid<'_>, subject: usize, replies: &[ConfidentReply]) -> Option<TestedConfidence> {
    let dark = &grid.subjects[subject];
    if dark.enhancer.is_some() || !dark.variant.is_degraded() {
        return None;
    }
    let clean = ModelInCondition::seeing(&dark.model, AxisLevel::L0, &dark.variant, None);
    let clean = confident_replies(grid, grid.stand_in(&clean)?).replies;
    let clean: BTreeMap<usize, f64> = clean
        .iter()
        .map(|reply| (reply.item, reply.excess()))
        .collect();
    let both = replies.iter().filter_map(|reply| {
        let change = reply.excess() - clean.get(&reply.item)?;
        Some((reply.cluster, change))
    });
    TestedConfidence::new(grid.clusters, both)
}

/// The mean distance to the probabilities without an image; `None` if there are none of the latter.
fn blind_shift(grid: &Grid<'_>, draws: &Resamples, subject: usize) -> Option<Estimate> {
    let distances = blind_shift::distances(grid, subject);
    let terms: Vec<_> = distances
        .into_iter()
        .map(|(cluster, distance)| (cluster, distance, 1.0))
        .collect();
    (!terms.is_empty()).then(|| ratio_of(draws, &terms))
}

/// The sum of a number over the sum of another one, with its interval by the cluster bootstrap.
fn ratio(
    draws: &Resamples,
    replies: &[ConfidentReply],
    above: impl Fn(&ConfidentReply) -> f64,
    below: impl Fn(&ConfidentReply) -> f64,
) -> Estimate {
    let terms = replies
        .iter()
        .map(|reply| (reply.cluster, above(reply), below(reply)));
    ratio_of(draws, &terms.collect::<Vec<_>>())
}

/// Ratio of two sums. Each term has its cluster, its addend to the numerator and its addend to the denominator.
fn ratio_of(draws: &Resamples, terms: &[(u32, f64, f64)]) -> Estimate {
    let mut by_cluster = vec![[0.0; 2]; draws.clusters()];
    for (cluster, above, below) in terms {
        let sums = &mut by_cluster[*cluster as usize];
        sums[0] += above;
        sums[1] += below;
    }
    let sums = |side: usize| {
        let sums = by_cluster.iter().map(|sums| sums[side] as f32);
        draws.sums(&sums.collect::<Vec<_>>())
    };
    // Draws of clusters without a reply have no ratio.
    let ratios = sums(0)
        .into_iter()
        .zip(sums(1))
        .filter(|(_, below)| *below > 0.0)
        .map(|(above, below)| above / below);
    let (above, below) = terms.iter().fold((0.0, 0.0), |(above, below), term| {
        (above + term.1, below + term.2)
    });
    let interval = draws.interval(ratios.collect());
    Estimate::around(above / below, interval, terms.len())
}

/// The area under the receiver operating characteristic of confidence for right against wrong replies.
fn auroc(clusters: usize, replies: &[ConfidentReply]) -> Option<Auc> {
    let ranked = replies.iter().map(|reply| RankedReply {
        cluster: reply.cluster,
        number: reply.confidence,
        right: reply.right,
    });
    let mut pairs = PairCounts::new(clusters);
    pairs.add(&mut ranked.collect::<Vec<_>>());
    pairs.auc()
}
