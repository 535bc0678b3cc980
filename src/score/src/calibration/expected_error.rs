//! The expected calibration error: [`estimate`].
//!
//! In its L2 form it is the root of the mean squared difference of accuracy and confidence over bins (Guo et al. 2017, ICML; bins of equal
//! count: Nixon et al. 2019, CVPR workshops). The plain one is above 0 for a perfectly calibrated model, more so with fewer replies: 0.10
//! with 100 replies, 0.027 with 4000. Therefore the binomial variance of each bin's accuracy is subtracted (Kumar, Liang and Ma 2019,
//! NeurIPS, arXiv:1909.10155), so that levels of unlike size can be compared.

use super::confident_reply::ConfidentReply;
use crate::bootstrap::Resamples;
use crate::estimate::Estimate;

/// The most bins.
const MOST_BINS: usize = 15;

/// The least number of replies in a bin (chosen).
const LEAST_IN_BIN: usize = 20;

/// The error of replies in order of confidence, with its interval by the cluster bootstrap.
///
/// Bins are drawn again in each draw. A draw has the noise of the replies twice, so that its squared error is too large by as much as
/// the mean of the draws is above the estimate; the draws are moved by that.
pub(super) fn estimate(draws: &Resamples, replies: &[ConfidentReply]) -> Estimate {
    let value = squared(replies, |_| 1);
    let drawn = draws.all();
    let drawn: Vec<f64> = drawn
        .map(|draw| squared(replies, |cluster| draw.times(cluster)))
        .collect();
    let bias = drawn.iter().sum::<f64>() / drawn.len().max(1) as f64 - value;
    let moved = drawn.into_iter().map(|drawn| drawn - bias).collect();
    let interval = draws.interval(moved).map(root);
    Estimate::around(root(value), interval, replies.len())
}

/// The root of a squared error, which the correction may make negative.
fn root(squared: f64) -> f64 {
    squared.max(0.0).sqrt()
}

/// One bin: the number of its replies, the number of right ones, and the sum of their confidence.
#[derive(Clone, Copy, Default)]
struct Bin {
    replies: f64,
    right: f64,
    confidence: f64,
}

impl Bin {
    /// The squared difference of accuracy and confidence less the variance of the accuracy, times the replies.
    fn error(self) -> f64 {
        if self.replies < 2.0 {
            return 0.0;
        }
        let accuracy = self.right / self.replies;
        let gap = accuracy - self.confidence / self.replies;
        let variance = accuracy * (1.0 - accuracy) / (self.replies - 1.0);
        self.replies * (gap * gap - variance)
    }
}

/// The squared error with each cluster counted `times(cluster)` times. Replies of equal confidence are in one bin.
fn squared(replies: &[ConfidentReply], times: impl Fn(u32) -> usize) -> f64 {
    let weight = |reply: &ConfidentReply| times(reply.cluster);
    let n: usize = replies.iter().map(weight).sum();
    let bins = (n / LEAST_IN_BIN).clamp(1, MOST_BINS);
    let (mut sum, mut before, mut number, mut bin) = (0.0, 0, 0, Bin::default());
    let mut last = f64::NAN;
    for reply in replies {
        let weight = weight(reply);
        if weight == 0 {
            continue;
        }
        let own = before * bins / n;
        if own != number && reply.confidence.total_cmp(&last).is_ne() {
            sum += bin.error();
            (number, bin) = (own, Bin::default());
        }
        last = reply.confidence;
        before += weight;
        let weight = weight as f64;
        bin.replies += weight;
        bin.right += weight * f64::from(u8::from(reply.right));
        bin.confidence += weight * reply.confidence;
    }
    (sum + bin.error()) / n.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn replies(of: impl IntoIterator<Item = (f64, bool)>) -> Vec<ConfidentReply> {
        of.into_iter()
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
    fn one_bin_is_the_squared_gap_less_the_variance() {
        // 30 replies are one bin: 18 right of 30 at a confidence of 0.9.
        let made = replies((0..30).map(|i| (0.9, i < 18)));
        let expected = 0.3 * 0.3 - 0.6 * 0.4 / 29.0;
        assert!((squared(&made, |_| 1) - expected).abs() < 1e-12);
        // A cluster that counts twice is two replies.
        let times = |cluster: u32| if cluster == 0 { 2 } else { 1 };
        let (accuracy, n) = (19.0 / 31.0, 31.0);
        let gap: f64 = 0.9 - accuracy;
        let expected = gap * gap - accuracy * (1.0 - accuracy) / (n - 1.0);
        assert!((squared(&made, times) - expected).abs() < 1e-12);
    }

    #[test]
    fn ties_are_not_divided() {
        // 40 replies could fill two bins, but all have one confidence: their order is arbitrary.
        let made = replies((0..40).map(|i| (0.5, i < 20)));
        let mixed = replies((0..40).map(|i| (0.5, i % 2 == 0)));
        assert!((squared(&made, |_| 1) - squared(&mixed, |_| 1)).abs() < 1e-15);
        assert!(squared(&made, |_| 1) < 0.0);
        // Two confidences are two bins: wrong at 0.3, right at 0.7.
        let two = replies((0..40).map(|i| (if i < 20 { 0.3 } else { 0.7 }, i >= 20)));
        assert!((root(squared(&two, |_| 1)) - 0.3).abs() < 1e-12);
    }
}
