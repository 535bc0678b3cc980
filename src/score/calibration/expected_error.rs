//! Expected calibration error: [`estimate`].
//!
//! The L2 form is the root mean square difference between accuracy and confidence over bins (Guo et al. 2017, ICML;
//! bins of equal count: Nixon et al. 2019, CVPR workshops). The plain estimate is above 0 even for a perfectly
//! calibrated model, more so with fewer replies: 0.10 with 100 replies, 0.027 with 4000. To make levels with different
//! numbers of replies comparable, the binomial variance of each bin's accuracy is subtracted (Kumar, Liang and Ma 2019,
//! NeurIPS, arXiv:1909.10155).

use super::confident_reply::ConfidentReply;
use crate::bootstrap::Resamples;
use crate::estimate::Estimate;

/// Maximum number of bins.
const MAX_BINS: usize = 15;

/// Minimum number of replies per bin. An arbitrary choice.
const MIN_REPLIES_PER_BIN: usize = 20;

/// Estimates the error of replies sorted by confidence, with its interval by the cluster bootstrap.
///
/// Each draw is binned on its own. A draw contains the noise of the replies twice, which biases its squared error
/// upwards. The bias is the mean of the draws less the squared error of the replies; it is subtracted from each draw.
pub(super) fn estimate(draws: &Resamples, replies: &[ConfidentReply]) -> Estimate {
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
    let bins = (n / MIN_REPLIES_PER_BIN).clamp(1, MAX_BINS);
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
