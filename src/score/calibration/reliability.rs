//! Accuracy by confidence, in bins: [`bins`].
//!
//! A reliability diagram (Murphy and Winkler 1977, Appl. Stat. 26:41; DeGroot and Fienberg 1983, The Statistician
//! 32:12) with bins of equal count: a model is calibrated if the accuracy of each bin equals its mean confidence.

use super::confident_reply::{ConfidentReply, accuracy};
use crate::estimate::Estimate;

/// Maximum number of bins.
const MAX_BINS: usize = 10;

/// Minimum number of replies in a bin (chosen, the same as for the expected calibration error).
const MIN_REPLIES_PER_BIN: usize = 20;

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
pub(super) fn bins(clusters: usize, replies: &[ConfidentReply]) -> Vec<ReliabilityBin> {
    let number = (replies.len() / MIN_REPLIES_PER_BIN).min(MAX_BINS);
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
        if let Some(accuracy) = accuracy(clusters, own) {
            bins.push(ReliabilityBin { confidence: sum / own.len() as f64, accuracy });
        }
        start = end;
    }
    bins
}

fn is_tie(reply: &ConfidentReply, next: &ConfidentReply) -> bool {
    reply.confidence.total_cmp(&next.confidence).is_eq()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn replies(of: impl IntoIterator<Item = (f64, bool)>) -> Vec<ConfidentReply> {
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
        let made = replies((0..400).map(|i| (f64::from(i) / 400.0, i % 8 < i / 100)));
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
        let one = super::bins(10, &replies((0..400).map(|i| (0.5, i % 2 == 0))));
        assert_eq!(one.len(), 1);
        assert_eq!(one[0].accuracy.n, 400);
        assert!(super::bins(10, &made[..19]).is_empty());
        // 60 replies are three bins; a long tie at the start makes the first one larger.
        let tied = replies((0..60).map(|i| (if i < 30 { 0.2 } else { 0.2 + f64::from(i) / 100.0 }, true)));
        let sizes: Vec<usize> = super::bins(10, &tied).iter().map(|bin| bin.accuracy.n).collect();
        assert_eq!(sizes, [30, 10, 20]);
    }
}
