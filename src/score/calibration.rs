//! Calibration of models, that is, the relation between their confidence and their accuracy: [`calibrations`].
//!
//! The confidence of a reply is the highest probability of a choice. Only replies with probabilities and without
//! reasoning before the answer are evaluated; the others are only counted. Whether a reply is right follows from the
//! strict parsing.
//!
//! Effect of the image on the probabilities of a model: [`distances`] between the probabilities with and without the
//! image.
//!
//! A reply with the confidence of the model: [`ConfidentReply`].
//!
//! Expected calibration error: [`estimate`].
//!
//! The L2 form is the root mean square difference between accuracy and confidence over bins (Guo et al. 2017, ICML;
//! bins of equal count: Nixon et al. 2019, CVPR workshops). The plain estimate is above 0 even for a perfectly
//! calibrated model, more so with fewer replies: 0.10 with 100 replies, 0.027 with 4000. To make levels with different
//! numbers of replies comparable, the binomial variance of each bin's accuracy is subtracted (Kumar, Liang and Ma 2019,
//! NeurIPS, arXiv:1909.10155).
//!
//! Probabilities by the position of a choice: [`PositionShare`].
//!
//! Accuracy by confidence, in bins: [`bins`].
//!
//! A reliability diagram (Murphy and Winkler 1977, Appl. Stat. 26:41; DeGroot and Fienberg 1983, The Statistician
//! 32:12) with bins of equal count: a model is calibrated if the accuracy of each bin equals its mean confidence.
//!
//! Share of wrong replies among the most confident ones: [`RiskCoverage`].
//!
//! Accuracy of probabilities averaged over the orders of the choices: [`accuracy_over_rotations`].
//!
//! Difference between confidence and accuracy, with its test: [`Tested`].

use std::collections::{BTreeMap, BTreeSet};

use super::grid::Grid;
use super::model_in_condition::ModelInCondition;
use crate::bootstrap::Resamples;
use crate::comparisons::Tested;
use crate::comparisons::paired::tested_difference;
use crate::estimate::{ClusterCount, Estimate};
use crate::statistics::auc::{Auc, PairCounts, RankedReply};
use darkqa_base::types::{AxisLevel, ItemKey, OptionProbabilities, TrialOutcome, TrialRef, View};

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
    pub overconfidence: Tested,
    /// Overconfidence minus overconfidence at L0, on the items of both; for raw degraded images of a model that was
    /// asked at L0.
    pub growth: Option<Tested>,
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
    let error = (n >= MIN_ERROR_REPLIES).then(|| estimate(draws, replies));
    Some(Calibration {
        subject: grid.subjects[subject].clone(),
        replies: n,
        reasoned: sorted.reasoned,
        unstated: sorted.unstated,
        confidence: mean(draws, replies, |reply| reply.confidence),
        accuracy: clustered_accuracy(grid.clusters, replies)?,
        overconfidence: test_mean(grid.clusters, replies.iter().map(|reply| (reply.cluster, reply.excess())))?,
        growth: growth(grid, subject, replies),
        error,
        brier: mean(draws, replies, |reply| reply.brier),
        skill: Estimate { value: 1.0 - skill.value, low: 1.0 - skill.high, high: 1.0 - skill.low, n },
        nll: mean(draws, replies, |reply| reply.nll),
        risk: RiskCoverage::new(replies),
        auroc: auroc(grid.clusters, replies),
        blind_shift: blind_shift(grid, draws, subject),
        over_orders: accuracy_over_rotations(grid, subject),
        bins: bins(grid.clusters, replies),
        positions: shares(grid, subject),
    })
}

/// Growth of the overconfidence since L0, on the items of both levels.
fn growth(grid: &Grid<'_>, subject: usize, replies: &[ConfidentReply]) -> Option<Tested> {
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
    test_mean(grid.clusters, changes)
}

/// Mean distance to the probabilities without an image; `None` if the model was not asked without images.
fn blind_shift(grid: &Grid<'_>, draws: &Resamples, subject: usize) -> Option<Estimate> {
    let distances = distances(grid, subject);
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

/// Returns, for each item, its cluster and the Jensen–Shannon distance, from 0 to 1, between the probabilities of a
/// subject and those of the same model without an image (the root of the divergence in bits: Endres and Schindelin
/// 2003, IEEE Trans. Inf. Theory 49:1858). Empty if the model was not asked without images.
fn distances(grid: &Grid<'_>, subject: usize) -> Vec<(u32, f64)> {
    let with_image = &grid.subjects[subject];
    let blind = grid.find(&ModelInCondition::new(&with_image.model, None));
    let Some(blind) = blind.filter(|_| with_image.view == Some(View::Image)) else {
        return Vec::new();
    };
    grid.items
        .iter()
        .enumerate()
        .filter_map(|(index, item)| {
            let seen = usable_probabilities(grid.trial(subject, index))?;
            let unseen = usable_probabilities(grid.compared_trial(blind, index))?;
            Some((item.cluster, distance(&seen.p, &unseen.p)))
        })
        .collect()
}

/// Jensen–Shannon distance of two distributions.
fn distance(one: &[f64], other: &[f64]) -> f64 {
    let divergence: f64 = one
        .iter()
        .zip(other)
        .map(|(&p, &q)| {
            let middle = f64::midpoint(p, q);
            let [a, b] = [p, q].map(|p| if p > 0.0 { p * libm::log2(p / middle) } else { 0.0 });
            f64::midpoint(a, b)
        })
        .sum();
    divergence.clamp(0.0, 1.0).sqrt()
}

/// Probability assumed for a true choice that is neither listed nor bounded. Probabilities are stored with six
/// decimals.
const MIN_PROBABILITY: f64 = 1e-6;

/// A reply with probabilities, and without reasoning before the answer.
#[derive(Debug, Clone, Copy)]
pub(super) struct ConfidentReply {
    /// Index of the item.
    item: usize,
    /// Index of the cluster.
    cluster: u32,
    /// Highest probability of a choice.
    confidence: f64,
    /// True if the strict parsing finds the true choice.
    right: bool,
    /// Brier score: sum of (p − truth)² over the choices.
    brier: f64,
    /// Brier score of equal probabilities: 1 − 1/k for k choices.
    guess: f64,
    /// −ln p of the true choice; p is at least the bound for choices that are not listed.
    nll: f64,
}

impl ConfidentReply {
    /// Confidence minus correctness: confidence − 1 for a right reply, the confidence for a wrong one.
    fn excess(&self) -> f64 {
        self.confidence - f64::from(u8::from(self.right))
    }
}

/// Evaluated replies of a subject, and numbers of other replies.
pub(super) struct SortedReplies {
    /// Replies in order of increasing confidence.
    replies: Vec<ConfidentReply>,
    /// Number of replies with reasoning before the answer.
    reasoned: usize,
    /// Number of replies without probabilities.
    unstated: usize,
}

/// Collects the replies of a subject.
fn confident_replies(grid: &Grid<'_>, subject: usize) -> SortedReplies {
    let mut sorted = SortedReplies { replies: Vec::new(), reasoned: 0, unstated: 0 };
    for (index, item) in grid.items.iter().enumerate() {
        let trial = grid.trial(subject, index);
        let Some(trial) = trial.filter(|trial| !trial.failed()) else {
            continue;
        };
        match trial.options() {
            None => sorted.unstated += 1,
            Some(options) if options.reasoned => sorted.reasoned += 1,
            Some(options) => sorted.replies.extend(reply(trial, options, index, item.cluster)),
        }
    }
    let replies = &mut sorted.replies;
    replies.sort_by(|a, b| a.confidence.total_cmp(&b.confidence));
    sorted
}

/// Returns the reply of a trial; `None` if the probabilities do not match its choices, as in an edited file.
fn reply(trial: TrialRef<'_>, options: &OptionProbabilities, item: usize, cluster: u32) -> Option<ConfidentReply> {
    let p = &options.p;
    let truth = *p.get(trial.truth()?)?;
    if p.len() != trial.choices().len() || options.mass <= 0.0 {
        return None;
    }
    let squares: f64 = p.iter().map(|p| p * p).sum();
    let least = (options.bound / options.mass).max(MIN_PROBABILITY);
    Some(ConfidentReply {
        item,
        cluster,
        confidence: options.confidence(),
        right: trial.outcome() == TrialOutcome::Right,
        brier: squares - 2.0 * truth + 1.0,
        guess: 1.0 - 1.0 / p.len() as f64,
        nll: -libm::log(truth.max(least).min(1.0)),
    })
}

/// Share of right replies, with its interval by cluster.
fn clustered_accuracy(clusters: usize, replies: &[ConfidentReply]) -> Option<Estimate> {
    let mut counts = vec![ClusterCount::default(); clusters];
    for reply in replies {
        let count = &mut counts[reply.cluster as usize];
        count.replies += 1;
        count.right += u32::from(reply.right);
    }
    Estimate::clustered(&counts)
}

/// Probabilities of a trial, if they may be evaluated; `None` without probabilities, or with reasoning before the
/// answer.
fn usable_probabilities(trial: Option<TrialRef<'_>>) -> Option<&OptionProbabilities> {
    let trial = trial.filter(|trial| !trial.failed())?;
    let options = trial.options()?;
    let fits = options.p.len() == trial.choices().len();
    (fits && !options.reasoned).then_some(options)
}

/// Maximum number of bins of the expected calibration error.
const MAX_ERROR_BINS: usize = 15;

/// Minimum number of replies in a bin, of the error and of the diagram; chosen.
const MIN_REPLIES_PER_BIN: usize = 20;

/// Estimates the error of replies sorted by confidence, with its interval by the cluster bootstrap.
///
/// Each draw is binned on its own. A draw contains the noise of the replies twice, which biases its squared error
/// upwards. The bias is the mean of the draws less the squared error of the replies; it is subtracted from each draw.
fn estimate(draws: &Resamples, replies: &[ConfidentReply]) -> Estimate {
    let value = squared_error(replies, |_| 1);
    let drawn: Vec<f64> = draws.all().map(|draw| squared_error(replies, |cluster| draw.times(cluster))).collect();
    let bias = drawn.iter().sum::<f64>() / drawn.len().max(1) as f64 - value;
    let unbiased = drawn.into_iter().map(|error| error - bias).collect();
    let interval = draws.interval(unbiased).map(root);
    Estimate::around(root(value), interval, replies.len())
}

/// Root of a squared error; 0 if the subtracted variance made the squared error negative.
fn root(squared: f64) -> f64 {
    squared.max(0.0).sqrt()
}

/// Sums over the replies in a bin.
#[derive(Clone, Copy, Default)]
struct Bin {
    /// Number of replies.
    replies: f64,
    /// Number of right replies.
    right: f64,
    /// Sum of the confidences.
    confidence: f64,
}

impl Bin {
    /// Corrected squared error, weighted by the number of replies: `replies · ((accuracy − confidence)² − variance of
    /// the accuracy)`. 0 for fewer than two replies.
    fn weighted_error(self) -> f64 {
        if self.replies < 2.0 {
            return 0.0;
        }
        let accuracy = self.right / self.replies;
        let gap = accuracy - self.confidence / self.replies;
        let variance = accuracy * (1.0 - accuracy) / (self.replies - 1.0);
        self.replies * (gap * gap - variance)
    }
}

/// Corrected squared error of replies sorted by confidence. Each cluster counts `times(cluster)` times. Replies of
/// equal confidence share a bin.
fn squared_error(replies: &[ConfidentReply], times: impl Fn(u32) -> usize) -> f64 {
    let n: usize = replies.iter().map(|reply| times(reply.cluster)).sum();
    let bins = (n / MIN_REPLIES_PER_BIN).clamp(1, MAX_ERROR_BINS);
    let (mut sum, mut bin, mut bin_index) = (0.0, Bin::default(), 0);
    let mut replies_before = 0;
    let mut last_confidence = f64::NAN;
    for reply in replies {
        let weight = times(reply.cluster);
        if weight == 0 {
            continue;
        }
        let index = replies_before * bins / n;
        if index != bin_index && reply.confidence.total_cmp(&last_confidence).is_ne() {
            sum += bin.weighted_error();
            (bin_index, bin) = (index, Bin::default());
        }
        last_confidence = reply.confidence;
        replies_before += weight;
        let weight = weight as f64;
        bin.replies += weight;
        bin.right += weight * f64::from(u8::from(reply.right));
        bin.confidence += weight * reply.confidence;
    }
    (sum + bin.weighted_error()) / n.max(1) as f64
}

/// Mean probability of the choices at one position, and share of true choices at this position. The difference of both
/// is a preference for a letter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionShare {
    /// Index of the position; 0 is A.
    pub position: usize,
    /// Mean probability of the choices at this position.
    pub p: f64,
    /// Share of the questions whose true choice is at this position.
    pub truth: f64,
    /// Number of replies to questions with a choice at this position.
    pub n: usize,
}

/// Computes the shares of each position for a subject.
fn shares(grid: &Grid<'_>, subject: usize) -> Vec<PositionShare> {
    let mut shares: Vec<PositionShare> = Vec::new();
    for (index, item) in grid.items.iter().enumerate() {
        let Some(options) = usable_probabilities(grid.trial(subject, index)) else {
            continue;
        };
        for (position, p) in options.p.iter().enumerate() {
            if shares.len() == position {
                shares.push(PositionShare { position, p: 0.0, truth: 0.0, n: 0 });
            }
            let share = &mut shares[position];
            share.p += p;
            share.truth += f64::from(u8::from(item.asked.truth == Some(position)));
            share.n += 1;
        }
    }
    for share in &mut shares {
        share.p /= share.n as f64;
        share.truth /= share.n as f64;
    }
    shares
}

/// Maximum number of bins of a reliability diagram.
const MAX_DIAGRAM_BINS: usize = 10;

/// A bin of the reliability diagram.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReliabilityBin {
    /// Mean confidence.
    pub confidence: f64,
    /// Accuracy, with its interval by cluster.
    pub accuracy: Estimate,
}

/// Divides replies into bins of about equal size, in order of confidence; replies of equal confidence share a bin.
/// Empty with fewer than twenty replies.
///
/// `replies` must be sorted by confidence.
fn bins(clusters: usize, replies: &[ConfidentReply]) -> Vec<ReliabilityBin> {
    let number = (replies.len() / MIN_REPLIES_PER_BIN).min(MAX_DIAGRAM_BINS);
    let mut bins = Vec::new();
    let mut start = 0;
    for bin in 1..=number {
        let mut end = bin * replies.len() / number;
        while end > start && end < replies.len() && is_tie(&replies[end - 1], &replies[end]) {
            end += 1;
        }
        if end <= start {
            continue;
        }
        let own = &replies[start..end];
        let sum: f64 = own.iter().map(|reply| reply.confidence).sum();
        if let Some(accuracy) = clustered_accuracy(clusters, own) {
            bins.push(ReliabilityBin { confidence: sum / own.len() as f64, accuracy });
        }
        start = end;
    }
    bins
}

fn is_tie(reply: &ConfidentReply, next: &ConfidentReply) -> bool {
    reply.confidence.total_cmp(&next.confidence).is_eq()
}

/// Risk at some coverages, and area under the risk–coverage curve (Geifman and El-Yaniv 2017, NeurIPS).
///
/// Replies are included in order of decreasing confidence. Each of several replies of equal confidence counts as their
/// mean, so that their order does not matter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RiskCoverage {
    /// Share of wrong replies among all replies.
    pub at_100: f64,
    /// Share of wrong replies among the most confident 80 %.
    pub at_80: f64,
    /// Share of wrong replies among the most confident 50 %.
    pub at_50: f64,
    /// Mean risk over all coverages.
    pub area: f64,
}

impl RiskCoverage {
    /// Computes the risk of replies, which must be sorted by increasing confidence and not be empty.
    fn new(replies: &[ConfidentReply]) -> Self {
        let n = replies.len();
        let mut risks = Vec::with_capacity(n);
        let mut wrong = 0.0;
        for tied in replies.chunk_by(|a, b| a.confidence.total_cmp(&b.confidence).is_eq()).rev() {
            let share = tied.iter().filter(|reply| !reply.right).count() as f64 / tied.len() as f64;
            for _ in tied {
                wrong += share;
                risks.push(wrong / (risks.len() + 1) as f64);
            }
        }
        let [at_100, at_80, at_50] = [1.0, 0.8, 0.5].map(|coverage| {
            let taken = ((coverage * n as f64).ceil() as usize).clamp(1, n);
            risks[taken - 1]
        });
        Self { at_100, at_80, at_50, area: risks.iter().sum::<f64>() / n as f64 }
    }
}

/// Replies to one question in one wording and repeat, over all orders of its choices.
#[derive(Default)]
struct AskedInOrders<'a> {
    cluster: u32,
    truth: &'a str,
    /// Orders in which the choices were shown.
    shown: BTreeSet<&'a [String]>,
    /// Sum of the probabilities of each choice, by its text.
    by_text: BTreeMap<&'a str, f64>,
}

/// Share of questions whose true choice has the highest probability on average over the orders; `None` if no question
/// was asked in several orders. A preference for letters averages out.
fn accuracy_over_rotations(grid: &Grid<'_>, subject: usize) -> Option<Estimate> {
    let mut questions = BTreeMap::<ItemKey<'_>, AskedInOrders<'_>>::new();
    for (index, item) in grid.items.iter().enumerate() {
        let Some(trial) = grid.trial(subject, index) else {
            continue;
        };
        let Some(options) = usable_probabilities(Some(trial)) else {
            continue;
        };
        let asked = questions.entry(ItemKey { choices: &[], ..trial.item().key() }).or_default();
        asked.cluster = item.cluster;
        asked.truth = trial.choices().get(trial.truth()?)?;
        asked.shown.insert(trial.choices());
        for (text, p) in trial.choices().iter().zip(&options.p) {
            *asked.by_text.entry(text).or_default() += p;
        }
    }
    let mut counts = vec![ClusterCount::default(); grid.clusters];
    for asked in questions.values().filter(|asked| asked.shown.len() > 1) {
        let truth = asked.by_text.get(asked.truth).copied().unwrap_or(0.0);
        let is_right = asked.by_text.iter().all(|(text, p)| *text == asked.truth || *p < truth);
        let count = &mut counts[asked.cluster as usize];
        count.replies += 1;
        count.right += u32::from(is_right);
    }
    Estimate::clustered(&counts)
}

/// Tests the mean of numbers against 0 by Student's t, which matches its interval. Each number is given with its
/// cluster; `None` without numbers.
fn test_mean(clusters: usize, numbers: impl Iterator<Item = (u32, f64)>) -> Option<Tested> {
    let mut sums = vec![(0.0, 0.0); clusters];
    let (mut squares, mut n) = (0.0, 0);
    for (cluster, number) in numbers {
        let (sum, count) = &mut sums[cluster as usize];
        *sum += number;
        *count += 1.0;
        squares += number * number;
        n += 1;
    }
    sums.retain(|(_, count)| *count > 0.0);
    (n > 0).then(|| {
        let (estimate, p) = tested_difference(&sums, squares, n);
        Tested::new(estimate, p)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_follow_the_definition() {
        assert!(distance(&[0.2, 0.8], &[0.2, 0.8]) < 1e-9);
        assert!((distance(&[1.0, 0.0], &[0.0, 1.0]) - 1.0).abs() < 1e-12);
        // The divergence is (log₂ 4⁄3 + ½ log₂ 2⁄3 + ½) ⁄ 2 = 0.311278 bits.
        assert!((distance(&[1.0, 0.0], &[0.5, 0.5]) - 0.557_923_045_3).abs() < 1e-9);
        let (one, other) = ([0.7, 0.2, 0.1], [0.1, 0.1, 0.8]);
        assert!((distance(&one, &other) - distance(&other, &one)).abs() < 1e-15);
    }

    fn replies(outcomes: impl IntoIterator<Item = (f64, bool)>) -> Vec<ConfidentReply> {
        outcomes
            .into_iter()
            .enumerate()
            .map(|(index, (confidence, right))| ConfidentReply {
                item: index,
                cluster: index as u32,
                confidence,
                right,
                brier: 0.0,
                guess: 0.5,
                nll: 0.0,
            })
            .collect()
    }

    #[test]
    fn the_error_of_one_bin_is_the_squared_gap_less_the_variance() {
        // 30 replies make one bin: 18 of 30 are right, at a confidence of 0.9.
        let made = replies((0..30).map(|i| (0.9, i < 18)));
        let expected = 0.3 * 0.3 - 0.6 * 0.4 / 29.0;
        assert!((squared_error(&made, |_| 1) - expected).abs() < 1e-12);
        // A cluster that counts twice contributes two replies.
        let error = squared_error(&made, |cluster| if cluster == 0 { 2 } else { 1 });
        let (accuracy, n) = (19.0 / 31.0, 31.0);
        let gap: f64 = 0.9 - accuracy;
        let expected = gap * gap - accuracy * (1.0 - accuracy) / (n - 1.0);
        assert!((error - expected).abs() < 1e-12);
    }

    #[test]
    fn replies_of_equal_confidence_share_a_bin() {
        // 40 replies could fill two bins, but all have the same confidence: their order is arbitrary.
        let made = replies((0..40).map(|i| (0.5, i < 20)));
        let mixed = replies((0..40).map(|i| (0.5, i % 2 == 0)));
        assert!((squared_error(&made, |_| 1) - squared_error(&mixed, |_| 1)).abs() < 1e-15);
        assert!(squared_error(&made, |_| 1) < 0.0);
        // Two confidences make two bins: wrong at 0.3, right at 0.7.
        let two = replies((0..40).map(|i| (if i < 20 { 0.3 } else { 0.7 }, i >= 20)));
        assert!((root(squared_error(&two, |_| 1)) - 0.3).abs() < 1e-12);
    }

    fn reliability_replies(of: impl IntoIterator<Item = (f64, bool)>) -> Vec<ConfidentReply> {
        of.into_iter()
            .enumerate()
            .map(|(index, (confidence, right))| ConfidentReply {
                item: index,
                cluster: (index % 10) as u32,
                confidence,
                right,
                brier: 0.0,
                guess: 0.5,
                nll: 0.0,
            })
            .collect()
    }

    #[test]
    fn bins_cover_all_replies_without_splitting_ties() {
        // 400 replies with an accuracy of half their confidence.
        let made = reliability_replies((0..400).map(|i| (f64::from(i) / 400.0, i % 8 < i / 100)));
        let bins = bins(10, &made);
        assert_eq!(bins.len(), 10);
        assert!(bins.iter().all(|bin| bin.accuracy.n == 40));
        assert!(bins.is_sorted_by(|a, b| a.confidence < b.confidence));
        for (index, bin) in bins.iter().enumerate() {
            let mean = (40.0 * index as f64 + 19.5) / 400.0;
            assert!((bin.confidence - mean).abs() < 1e-12);
            let own = &made[40 * index..40 * (index + 1)];
            let right = own.iter().filter(|reply| reply.right).count();
            assert!((bin.accuracy.value - right as f64 / 40.0).abs() < 1e-12);
            assert!(bin.accuracy.low <= bin.accuracy.value && bin.accuracy.value <= bin.accuracy.high);
        }
        // All of one confidence are one bin, however many they are; few are none.
        let one = super::bins(10, &reliability_replies((0..400).map(|i| (0.5, i % 2 == 0))));
        assert_eq!(one.len(), 1);
        assert_eq!(one[0].accuracy.n, 400);
        assert!(super::bins(10, &made[..19]).is_empty());
        // 60 replies are three bins; a long tie at the start makes the first one larger.
        let tied = reliability_replies((0..60).map(|i| (if i < 30 { 0.2 } else { 0.2 + f64::from(i) / 100.0 }, true)));
        let sizes: Vec<usize> = super::bins(10, &tied).iter().map(|bin| bin.accuracy.n).collect();
        assert_eq!(sizes, [30, 10, 20]);
    }

    fn risk(of: &[(f64, bool)]) -> RiskCoverage {
        let replies: Vec<ConfidentReply> = of
            .iter()
            .map(|&(confidence, right)| ConfidentReply {
                item: 0,
                cluster: 0,
                confidence,
                right,
                brier: 0.0,
                guess: 0.5,
                nll: 0.0,
            })
            .collect();
        RiskCoverage::new(&replies)
    }

    #[test]
    fn the_most_confident_come_first() {
        let good = risk(&[(0.3, false), (0.5, true), (0.7, true), (0.9, true)]);
        assert_eq!((good.at_100, good.at_80, good.at_50), (0.25, 0.25, 0.0));
        assert!((good.area - 0.0625).abs() < 1e-12);
        let bad = risk(&[(0.3, true), (0.5, true), (0.7, true), (0.9, false)]);
        assert_eq!((bad.at_100, bad.at_50), (0.25, 0.5));
        assert!((bad.area - (1.0 + 0.5 + 1.0 / 3.0 + 0.25) / 4.0).abs() < 1e-12);
        // Where all are equally confident, any coverage has the risk of all.
        for order in [[true, false, true, true], [true, true, true, false]] {
            let tied = risk(&order.map(|right| (0.5, right)));
            for value in [tied.at_100, tied.at_80, tied.at_50, tied.area] {
                assert!((value - 0.25).abs() < 1e-12);
            }
        }
    }
}
