//! Residuals of clusters about the overall mean, and an assumed design effect: [`residuals`], [`unknown_design_effect`].

/// The adjusted residuals of clusters about a mean: r / √(1 − h). Here r is a cluster's sum − `mean` × its number of replies, and h its
/// share of all replies.
///
/// `clusters` lists the sum and the number of replies of each cluster. Empty clusters are skipped. A cluster with all replies has an
/// infinite residual.
///
/// A cluster pulls the mean towards itself in proportion to h, which makes r too small. The sum of the squared adjusted residuals
/// estimates the variance of the total (Bell and McCaffrey 2002, Surv. Methodol. 28:169, CR2 for a mean). For C clusters of equal size,
/// this sum is C / (C − 1) Σr². If one cluster has a third of the replies, intervals from that simpler sum cover the truth less often
/// (`tests/program/scores/coverage/unequal.rs`).
#[must_use]
pub fn residuals(clusters: &[(f64, f64)], mean: f64) -> Vec<f64> {
    let total: f64 = clusters.iter().map(|(_, count)| count).sum();
    clusters
        .iter()
        .filter(|(_, count)| *count > 0.0)
        .map(|(sum, count)| {
            let others = total - count;
            if others > 0.0 {
                (sum - mean * count) / (others / total).sqrt()
            } else {
                f64::INFINITY
            }
        })
        .collect()
}

/// Assumed intraclass correlation if the data cannot show one: all replies are correct, all are wrong, or no pair differs (chosen).
/// The value is high for questions about one frame, so that intervals are not too narrow.
const ASSUMED_CORRELATION: f64 = 0.2;

/// The assumed design effect if the replies have no variance: 1 + 0.2 (m̄ − 1), where m̄ is the mean number of replies per cluster,
/// weighted by the number of replies (Kish 1965, section 5.4).
#[must_use]
pub fn unknown_design_effect(clusters: &[(f64, f64)]) -> f64 {
    let total: f64 = clusters.iter().map(|(_, count)| count).sum();
    let squares: f64 = clusters.iter().map(|(_, count)| count * count).sum();
    1.0 + ASSUMED_CORRELATION * (squares / total - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_clusters_have_larger_residuals() {
        // 6 of 12 replies are correct; the large cluster has half of the replies.
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
        // For clusters of equal size, the factor is C / (C − 1).
        let equal_sizes: f64 = residuals(&[(1.0, 4.0), (2.0, 4.0), (3.0, 4.0)], 0.5)
            .iter()
            .map(|residual| residual * residual)
            .sum();
        assert!((equal_sizes - 1.5 * 2.0).abs() < 1e-12, "{equal_sizes}");
    }

    #[test]
    fn assumed_design_effect_grows_with_cluster_size() {
        assert!((unknown_design_effect(&[(6.0, 6.0); 9]) - 2.0).abs() < 1e-12);
        assert!((unknown_design_effect(&[(1.0, 1.0); 9]) - 1.0).abs() < 1e-12);
    }
}
