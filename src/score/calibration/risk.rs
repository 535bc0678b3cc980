//! Share of wrong replies among the most confident ones: [`RiskCoverage`].

use super::confident_reply::ConfidentReply;

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
    pub(super) fn new(replies: &[ConfidentReply]) -> Self {
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

#[cfg(test)]
mod tests {
    use super::*;

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
