//! Agreement beyond the agreement expected from answer frequencies: [`kappa`].

use super::counts::{AnswerCounts, BankCounts};
use crate::estimate::ClusterCount;
use crate::estimate::Estimate;
use crate::statistics::quantiles::{degrees_of_freedom, student};

/// Expected agreement above which κ is undefined, because all answers agree by their frequencies alone.
const MAX_EXPECTED: f64 = 1.0 - 1e-9;

/// Estimates Cohen's κ (Cohen 1960, Educ. Psychol. Meas. 20:37) between the answers in a condition and those at L0. The
/// expected agreement is computed by question: e = (1/N) Σ_q Σ_k a_qk b_qk / n_q, for n_q items of question q, a_qk of
/// them with answer k at L0 and b_qk in the condition. Answer frequencies pooled over different questions would make e
/// too small and κ too large.
///
/// `None` if e is 1, so that only agreement is possible. The interval is that of the linearization of κ in the counts
/// of the clusters, with Student's quantile, as for two models
/// ([`clustered_kappa`](crate::comparisons::clustered_kappa)). `agreement` is the share of items that agree; without
/// any spread between clusters, the interval of κ follows from its interval.
pub(super) fn kappa(counts: &BankCounts<'_>, by_cluster: &[ClusterCount], agreement: Estimate) -> Option<Estimate> {
    let all = counts.items() as f64;
    let expected = counts.whole.values().map(expected).sum::<f64>() / all;
    if all == 0.0 || expected > MAX_EXPECTED {
        return None;
    }
    let observed = agreement.value;
    let scaled = |agreement: f64| (agreement - expected) / (1.0 - expected);
    let value = scaled(observed);
    let mut influences = vec![0.0; by_cluster.len()];
    for ((cluster, question), own) in &counts.by_cluster {
        let change = expected_change(&counts.whole[question], own) - expected * own.items as f64;
        influences[*cluster as usize] -= change / all * (1.0 - observed);
    }
    for (influence, count) in influences.iter_mut().zip(by_cluster) {
        let change = f64::from(count.right) - observed * f64::from(count.replies);
        *influence += change / all * (1.0 - expected);
        *influence /= (1.0 - expected) * (1.0 - expected);
    }
    let influences: Vec<f64> = influences
        .iter()
        .zip(by_cluster)
        .filter(|(_, count)| count.replies > 0)
        .map(|(influence, _)| *influence)
        .collect();
    let c = influences.len() as f64;
    let variance = c / (c - 1.0) * influences.iter().map(|x| x * x).sum::<f64>();
    let (low, high) = if variance > 1e-18 {
        let half = student(degrees_of_freedom(&influences)) * variance.sqrt();
        (value - half, value + half)
    } else {
        (scaled(agreement.low), scaled(agreement.high))
    };
    // A single cluster gives no information about the spread.
    let (low, high) = if low.is_finite() && high.is_finite() { (low, high) } else { (-1.0, 1.0) };
    Some(Estimate { value, low: low.max(-1.0).min(value), high: high.min(1.0).max(value), n: counts.items() })
}

/// Number of items of a question that are expected to agree by the answer frequencies.
fn expected(counts: &AnswerCounts<'_>) -> f64 {
    counts.answers.values().map(|[light, here]| *light as f64 * *here as f64).sum::<f64>() / counts.items as f64
}

/// Derivative of the expected number of agreeing items of a question in the direction of the counts of a cluster.
fn expected_change(whole: &AnswerCounts<'_>, own: &AnswerCounts<'_>) -> f64 {
    let items = whole.items as f64;
    own.answers
        .iter()
        .map(|(answer, [light, here])| {
            let [whole_light, whole_here] = whole.answers[answer];
            whole_here as f64 * *light as f64 + whole_light as f64 * *here as f64
        })
        .sum::<f64>()
        / items
        - expected(whole) / items * own.items as f64
}
