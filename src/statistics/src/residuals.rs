//! How far clusters are from the mean over all: [`residuals`].

/// The residuals of clusters about a mean: r / √(1 − h), where r is a cluster's sum less `mean` times its number, and h its share of
/// the numbers of all clusters. Clusters whose number is 0 have none.
///
/// A cluster draws the mean towards itself by h, which makes r too small; the sum of the squares of these residuals is the variance of
/// the sum over all (Bell and McCaffrey 2002, Surv. Methodol. 28:169, CR2 for a mean). With C clusters of one size it is
/// C / (C − 1) Σr². Where one cluster holds a third of the replies, the plain sum holds the truth less often
/// (`tests/program/scores/coverage/unequal.rs`).
///
/// `clusters` holds, for each cluster, a sum and a number. The only cluster of all has an infinite residual.
#[must_use]
pub fn residuals(clusters: &[(f64, f64)], mean: f64) -> Vec<f64> {
    let all: f64 = clusters.iter().map(|(_, number)| number).sum();
    clusters
        .iter()
        .filter(|(_, number)| *number > 0.0)
        .map(|(sum, number)| {
            let others = all - number;
            if others > 0.0 {
                (sum - mean * number) / (others / all).sqrt()
            } else {
                f64::INFINITY
            }
        })
        .collect()
}

/// Intraclass correlation that is assumed where all replies are right, or none, or where no pair differs, so that the records cannot
/// show it (chosen). The value is high for questions about one frame, so that the interval is not too narrow.
const UNKNOWN_CORRELATION: f64 = 0.2;

/// The design effect that is assumed where records show no spread: 1 + 0.2 (m − 1) for clusters of m replies, with the mean of m
/// weighted by m (Kish 1965, section 5.4).
#[must_use]
pub fn unknown_design_effect(clusters: &[(f64, f64)]) -> f64 {
    let all: f64 = clusters.iter().map(|(_, number)| number).sum();
    let squares: f64 = clusters.iter().map(|(_, number)| number * number).sum();
    1.0 + UNKNOWN_CORRELATION * (squares / all - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_large_cluster_counts_for_more_than_it_is_away() {
        // 6 of 12 replies are right. The large cluster has half of them.
        let sums = [(5.0, 6.0), (0.0, 0.0), (1.0, 3.0), (0.0, 3.0)];
        let found = residuals(&sums, 0.5);
        let expected = [
            2.0 / f64::sqrt(0.5),
            -0.5 / f64::sqrt(0.75),
            -1.5 / f64::sqrt(0.75),
        ];
        assert_eq!(found.len(), 3);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        assert!(residuals(&[(1.0, 2.0)], 0.5)[0].is_infinite());
        // With one size it is the usual C / (C − 1).
        let even: f64 = residuals(&[(1.0, 4.0), (2.0, 4.0), (3.0, 4.0)], 0.5)
            .iter()
            .map(|residual| residual * residual)
            .sum();
        assert!((even - 1.5 * 2.0).abs() < 1e-12, "{even}");
    }

    #[test]
    fn clusters_without_spread_are_taken_as_correlated() {
        assert!((unknown_design_effect(&[(6.0, 6.0); 9]) - 2.0).abs() < 1e-12);
        assert!((unknown_design_effect(&[(1.0, 1.0); 9]) - 1.0).abs() < 1e-12);
    }
}
