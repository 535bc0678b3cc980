//! Calibration of models, that is, the relation between their confidence and their accuracy: [`calibrations`].
//!
//! The confidence of a reply is the highest probability of a choice. Only replies with probabilities and without
//! reasoning before the answer are evaluated; the others are only counted. Whether a reply is right follows from the
//! strict parsing.

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
use super::model_in_condition::ModelInCondition;
use crate::statistics::auc::{Auc, PairCounts, RankedReply};
use confident_reply::{ConfidentReply, accuracy, confident_replies};
use darkqa_base::types::AxisLevel;

pub use positions::PositionShare;
pub use reliability::ReliabilityBin;
pub use risk::RiskCoverage;
pub use tested::TestedConfidence;

/// Minimum number of replies with probabilities for a sentence (chosen, the same as for a calibration error).
pub const MIN_CONFIDENT_REPLIES: usize = 100;

/// Minimum number of replies for an expected calibration error (chosen).
const MIN_ERROR_REPLIES: usize = 100;

/// Confidence and accuracy of a subject.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// Model and condition.
    pub subject: ModelInCondition,
    /// Number of evaluated replies: those with probabilities and without reasoning.
    pub replies: usize,
    /// Number of replies with reasoning before the answer; they are not evaluated.
    pub reasoned: usize,
    /// Number of replies without probabilities.
    pub unstated: usize,
    /// Mean confidence.
    pub confidence: Estimate,
    /// Accuracy of the same replies.
    pub accuracy: Estimate,
    /// Confidence minus accuracy, with its test; above 0 the model is overconfident.
    pub overconfidence: TestedConfidence,
    /// Overconfidence minus overconfidence at L0, on the items of both; for raw degraded images of a model that was
    /// asked at L0.
    pub growth: Option<TestedConfidence>,
    /// Expected calibration error (`expected_error`); `None` below 100 replies.
    pub error: Option<Estimate>,
    /// Mean Brier score over all choices, from 0 to 2 (Brier 1950, Mon. Weather Rev. 78:1).
    pub brier: Estimate,
    /// Brier skill: 1 − Brier score / Brier score of equal probabilities for all choices; 0 for guesses, 1 if perfect.
    pub skill: Estimate,
    /// Mean negative logarithm of the probability of the true choice, in nats.
    pub nll: Estimate,
    /// Risk among the most confident replies.
    pub risk: RiskCoverage,
    /// AUROC of confidence: share of pairs of a right and a wrong reply in which the right one is more confident.
    pub auroc: Option<Auc>,
    /// Mean distance between the probabilities with the image and those of the same model without an image.
    pub blind_shift: Option<Estimate>,
    /// Accuracy of the choice with the highest probability averaged over the orders of choices, if several orders were
    /// asked.
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
    subjects.filter_map(|subject| calibration(grid, draws, subject)).collect()
}

fn calibration(grid: &Grid<'_>, draws: &Resamples, subject: usize) -> Option<Calibration> {
    let sorted = confident_replies(grid, subject);
    let replies = &*sorted.replies;
    if replies.is_empty() {
        return None;
    }
    let n = replies.len();
    let skill = ratio(draws, replies, |reply| reply.brier, |reply| reply.guess);
    let error = (n >= MIN_ERROR_REPLIES).then(|| expected_error::estimate(draws, replies));
    Some(Calibration {
        subject: grid.subjects[subject].clone(),
        replies: n,
        reasoned: sorted.reasoned,
        unstated: sorted.unstated,
        confidence: mean(draws, replies, |reply| reply.confidence),
        accuracy: accuracy(grid.clusters, replies)?,
        overconfidence: TestedConfidence::new(
            grid.clusters,
            replies.iter().map(|reply| (reply.cluster, reply.excess())),
        )?,
        growth: growth(grid, subject, replies),
        error,
        brier: mean(draws, replies, |reply| reply.brier),
        skill: Estimate { value: 1.0 - skill.value, low: 1.0 - skill.high, high: 1.0 - skill.low, n },
        nll: mean(draws, replies, |reply| reply.nll),
        risk: RiskCoverage::new(replies),
        auroc: auroc(grid.clusters, replies),
        blind_shift: blind_shift(grid, draws, subject),
        over_orders: rotations::accuracy(grid, subject),
        bins: reliability::bins(grid.clusters, replies),
        positions: positions::shares(grid, subject),
    })
}

/// Growth of the overconfidence since L0, on the items of both levels.
fn growth(grid: &Grid<'_>, subject: usize, replies: &[ConfidentReply]) -> Option<TestedConfidence> {
    let dark = &grid.subjects[subject];
    if dark.enhancer.is_some() || !dark.variant.is_degraded() {
        return None;
    }
    let clean = ModelInCondition::with_images(&dark.model, AxisLevel::L0, &dark.variant, None);
    let clean = confident_replies(grid, grid.find_up_to_group(&clean)?).replies;
    let clean: BTreeMap<usize, f64> = clean.iter().map(|reply| (reply.item, reply.excess())).collect();
    let changes = replies.iter().filter_map(|reply| {
        let change = reply.excess() - clean.get(&reply.item)?;
        Some((reply.cluster, change))
    });
    TestedConfidence::new(grid.clusters, changes)
}

/// Mean distance to the probabilities without an image; `None` if the model was not asked without images.
fn blind_shift(grid: &Grid<'_>, draws: &Resamples, subject: usize) -> Option<Estimate> {
    let distances = blind_shift::distances(grid, subject);
    let terms: Vec<(u32, f64, f64)> =
        distances.into_iter().map(|(cluster, distance)| (cluster, distance, 1.0)).collect();
    (!terms.is_empty()).then(|| ratio_of_sums(draws, &terms))
}

/// Mean of a quantity over the replies.
fn mean(draws: &Resamples, replies: &[ConfidentReply], quantity: fn(&ConfidentReply) -> f64) -> Estimate {
    ratio(draws, replies, quantity, |_| 1.0)
}

/// Ratio of the sums of two quantities over the replies, with its interval by the cluster bootstrap.
fn ratio(
    draws: &Resamples,
    replies: &[ConfidentReply],
    numerator: impl Fn(&ConfidentReply) -> f64,
    denominator: impl Fn(&ConfidentReply) -> f64,
) -> Estimate {
    let terms: Vec<(u32, f64, f64)> =
        replies.iter().map(|reply| (reply.cluster, numerator(reply), denominator(reply))).collect();
    ratio_of_sums(draws, &terms)
}

/// Ratio of two sums. Each term consists of its cluster and its contributions to the numerator and the denominator.
fn ratio_of_sums(draws: &Resamples, terms: &[(u32, f64, f64)]) -> Estimate {
    let mut by_cluster = vec![[0.0; 2]; draws.clusters()];
    for (cluster, numerator, denominator) in terms {
        let sums = &mut by_cluster[*cluster as usize];
        sums[0] += numerator;
        sums[1] += denominator;
    }
    let [numerators, denominators] = [0, 1].map(|side| {
        let sums: Vec<f32> = by_cluster.iter().map(|sums| sums[side] as f32).collect();
        draws.sums(&sums)
    });
    // Draws of clusters without a reply have no ratio.
    let ratios = numerators
        .into_iter()
        .zip(denominators)
        .filter(|(_, denominator)| *denominator > 0.0)
        .map(|(numerator, denominator)| numerator / denominator)
        .collect();
    let (numerator, denominator) =
        terms.iter().fold((0.0, 0.0), |(numerator, denominator), term| (numerator + term.1, denominator + term.2));
    Estimate::around(numerator / denominator, draws.interval(ratios), terms.len())
}

/// Area under the ROC curve of confidence for right against wrong replies.
fn auroc(clusters: usize, replies: &[ConfidentReply]) -> Option<Auc> {
    let mut ranked: Vec<RankedReply> = replies
        .iter()
        .map(|reply| RankedReply { cluster: reply.cluster, number: reply.confidence, right: reply.right })
        .collect();
    let mut pairs = PairCounts::new(clusters);
    pairs.add(&mut ranked);
    pairs.auc()
}
