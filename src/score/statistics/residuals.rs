//! Residuals of clusters about the overall mean, and what is assumed where few clusters show little: [`residuals`],
//! [`unknown_design_effect`], [`variance_of_few`].

/// The adjusted residuals of clusters about a mean: r / √(1 − h). Here r is a cluster's sum − `mean` × its number of
/// replies, and h its share of all replies.
///
/// `clusters` lists the sum and the number of replies of each cluster. Empty clusters are skipped. A cluster with all
/// replies has an infinite residual.
///
/// A cluster pulls the mean towards itself in proportion to h, which makes r too small. The sum of the squared adjusted
/// residuals estimates the variance of the total (Bell and McCaffrey 2002, Surv. Methodol. 28:169, CR2 for a mean). For
/// C clusters of equal size, this sum is C / (C − 1) Σr². If one cluster has a third of the replies, intervals from
/// that simpler sum cover the truth less often (`tests/program/scores/coverage/unequal.rs`).
#[must_use]
pub(crate) fn residuals(clusters: &[(f64, f64)], mean: f64) -> Vec<f64> {
    let total: f64 = clusters.iter().map(|(_, count)| count).sum();
    clusters
        .iter()
        .filter(|(_, count)| *count > 0.0)
        .map(|(sum, count)| {
            let others = total - count;
            if others > 0.0 { (sum - mean * count) / (others / total).sqrt() } else { f64::INFINITY }
        })
        .collect()
}

/// Assumed intraclass correlation if the data cannot show one: all replies are correct, all are wrong, no pair differs,
/// or there are few clusters (chosen). The value is high for questions about one frame, so that intervals are not too
/// narrow.
const ASSUMED_CORRELATION: f64 = 0.2;

/// Number of clusters that the assumed correlation counts for if a single cluster has all replies (chosen by
/// simulation).
const ASSUMED_CLUSTERS: f64 = 2.0;
/// Number of equal clusters from which nothing is assumed about their variance (chosen by simulation).
const MANY_CLUSTERS: f64 = 30.0;

/// The assumed design effect if the replies have no variance: 1 + 0.2 (m̄ − 1), where m̄ is the mean number of replies
/// per cluster, weighted by the number of replies (Kish 1965, section 5.4).
#[must_use]
pub(crate) fn unknown_design_effect(clusters: &[(f64, f64)]) -> f64 {
    let total: f64 = clusters.iter().map(|(_, count)| count).sum();
    let squares: f64 = clusters.iter().map(|(_, count)| count * count).sum();
    1.0 + ASSUMED_CORRELATION * (squares / total - 1.0)
}

/// The variance of a total between clusters, `between`, averaged with the variance for the assumed intraclass
/// correlation, and never smaller than `between`. `independent` is the variance for independent replies; each reply is
/// the mean of `weight` answers, or 1.
///
/// The variance between few clusters is poorly known, and too small if the few have missed what happens in one cluster
/// of ten. A prior guess then helps (a scaled inverse chi-squared prior, as in Smyth 2004, Stat. Appl. Genet. Mol.
/// Biol. 3:3). It counts for [`ASSUMED_CLUSTERS`] clusters, and for fewer with each cluster of the data, until none at
/// [`MANY_CLUSTERS`]. Clusters of unequal size count as (Σ n)² / Σ n² clusters (Kish 1965, section 11.7), so that one
/// cluster with nearly all replies does not look like many.
#[must_use]
pub(crate) fn variance_of_few(clusters: &[(f64, f64)], between: f64, independent: f64, weight: f64) -> f64 {
    let count = clusters.iter().filter(|(_, n)| *n > 0.0).count() as f64;
    let total: f64 = clusters.iter().map(|(_, n)| n).sum();
    let squares: f64 = clusters.iter().map(|(_, n)| n * n).sum();
    let effective = total * total / squares;
    if count < 2.0 || effective >= MANY_CLUSTERS {
        return between;
    }
    let assumed_clusters = ASSUMED_CLUSTERS * (1.0 - effective / MANY_CLUSTERS);
    let answers = weight * squares / total;
    let assumed = independent * (1.0 + ASSUMED_CORRELATION * (answers - 1.0)) / weight;
    let known = count - 1.0;
    between.max((assumed_clusters * assumed + known * between) / (assumed_clusters + known))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn assumed_variance_fades_with_the_number_of_clusters() {
        let variance = |clusters: usize| {
            let sums = vec![(5.0, 10.0); clusters];
            variance_of_few(&sums, 4.0, 5.0, 1.0)
        };
        // The assumed variance is 5 · (1 + 0.2 · 9) = 14; it counts for 2 · (1 − 6 / 30) = 1.6 of 6.6 clusters.
        assert!((variance(6) - (1.6 * 14.0 + 5.0 * 4.0) / 6.6).abs() < 1e-12);
        assert!(variance(29) > 4.0 && variance(29) < 4.1);
        for clusters in [1, 30, 100] {
            assert!((variance(clusters) - 4.0).abs() < 1e-12, "{clusters}");
        }
        // A larger variance in the data stays.
        assert!((variance_of_few(&[(5.0, 10.0); 6], 20.0, 5.0, 1.0) - 20.0).abs() < 1e-12);
        // 40 clusters, one with most of the replies: 1.2 effective clusters.
        let large = [vec![(50.0, 400.0)], vec![(1.0, 1.0); 39]].concat();
        assert!(variance_of_few(&large, 4.0, 5.0, 1.0) > 20.0);
        // Each reply is the mean of five answers: 5 · (1 + 0.2 · 49) / 5.
        let mean = variance_of_few(&[(5.0, 10.0); 6], 4.0, 5.0, 5.0);
        assert!((mean - (1.6 * 10.8 + 5.0 * 4.0) / 6.6).abs() < 1e-12);
    }

    #[test]
    fn large_clusters_have_larger_residuals() {
        // 6 of 12 replies are correct; the large cluster has half of the replies.
        let sums = [(5.0, 6.0), (0.0, 0.0), (1.0, 3.0), (0.0, 3.0)];
        let found = residuals(&sums, 0.5);
        let expected = [2.0 / f64::sqrt(0.5), -0.5 / f64::sqrt(0.75), -1.5 / f64::sqrt(0.75)];
        assert_eq!(found.len(), 3);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        assert!(residuals(&[(1.0, 2.0)], 0.5)[0].is_infinite());
        // For clusters of equal size, the factor is C / (C − 1).
        let equal_sizes: f64 =
            residuals(&[(1.0, 4.0), (2.0, 4.0), (3.0, 4.0)], 0.5).iter().map(|residual| residual * residual).sum();
        assert!((equal_sizes - 1.5 * 2.0).abs() < 1e-12, "{equal_sizes}");
    }

    #[test]
    fn assumed_design_effect_grows_with_cluster_size() {
        assert!((unknown_design_effect(&[(6.0, 6.0); 9]) - 2.0).abs() < 1e-12);
        assert!((unknown_design_effect(&[(1.0, 1.0); 9]) - 1.0).abs() < 1e-12);
    }
}
