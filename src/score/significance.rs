//! Tests of paired differences: [`mcnemar`] and [`sign_flip`], and the correction [`holm`].

/// Exact two-sided p-value of McNemar's test (McNemar 1947, Psychometrika 12:153; exact as the binomial sign test).
///
/// `gained` and `lost` are the numbers of pairs of which only one side is right. The test treats pairs as independent;
/// [`sign_flip`] does not.
#[must_use]
pub(crate) fn mcnemar(gained: usize, lost: usize) -> f64 {
    let smaller = gained.min(lost);
    let masses = binomial(gained + lost);
    let tail: f64 = masses.iter().take(smaller + 1).sum();
    (2.0 * tail).min(1.0)
}

/// Exact two-sided p-value of the hypothesis that the two sides can be swapped in every cluster: the share of the 2ᶜ swaps
/// whose total difference is at least as far from 0 as the observed one.
///
/// `differences` holds, for each cluster, the pairs gained minus the pairs lost. With one pair per cluster it is McNemar's
/// exact test. With more it keeps its size if pairs of a cluster are correlated, which McNemar's test does not (the
/// permutation form of Durkalski et al. 2003, Stat. Med. 22:2417).
#[must_use]
pub(crate) fn sign_flip(differences: &[i64]) -> f64 {
    let total = differences.iter().sum::<i64>().unsigned_abs() as usize;
    let mut sizes: Vec<usize> = differences
        .iter()
        .map(|d| d.unsigned_abs() as usize)
        .filter(|size| *size > 0)
        .collect();
    sizes.sort_unstable();
    // The distribution of the sum k of the sizes with positive sign; the total difference is then 2k − max_total.
    let mut masses = vec![1.0];
    let mut rest = &sizes[..];
    while let Some(&size) = rest.first() {
        let repeats = rest.partition_point(|other| *other == size);
        masses = convolved(&masses, &binomial(repeats), size);
        rest = &rest[repeats..];
    }
    let max_total: usize = sizes.iter().sum();
    let extreme = masses
        .iter()
        .enumerate()
        .filter(|(positive, _)| (2 * positive).abs_diff(max_total) >= total);
    extreme.map(|(_, mass)| mass).sum::<f64>().min(1.0)
}

/// Probability masses of a sum of two numbers, the second in steps of `step`.
fn convolved(masses: &[f64], second: &[f64], step: usize) -> Vec<f64> {
    let mut sum = vec![0.0; masses.len() + (second.len() - 1) * step];
    for (index, weight) in second.iter().enumerate().filter(|(_, w)| **w > 0.0) {
        let at = &mut sum[index * step..][..masses.len()];
        for (sum, mass) in at.iter_mut().zip(masses) {
            *sum += weight * mass;
        }
    }
    sum
}

/// Probability masses of the number of heads among `n` fair coins. Masses below 10⁻⁴⁰ are 0 for n above 1000.
fn binomial(n: usize) -> Vec<f64> {
    const MIN_MASS: f64 = 1e-40;
    let log_factorial = libm::lgamma(n as f64 + 1.0);
    let log_outcomes = n as f64 * std::f64::consts::LN_2;
    if n <= 1000 {
        // 2⁻¹⁰⁰⁰ is not rounded to 0, so that the recurrence is exact up to rounding.
        let mut masses = Vec::with_capacity(n + 1);
        let mut mass = libm::exp2(-(n as f64));
        for k in 0..=n {
            masses.push(mass);
            mass *= (n - k) as f64 / (k + 1) as f64;
        }
        return masses;
    }
    let mass = |k: usize| {
        let log = log_factorial
            - libm::lgamma(k as f64 + 1.0)
            - libm::lgamma((n - k) as f64 + 1.0)
            - log_outcomes;
        let mass = libm::exp(log);
        if mass < MIN_MASS { 0.0 } else { mass }
    };
    (0..=n).map(mass).collect()
}

/// Holm's adjusted p-values (Holm 1979, Scand. J. Stat. 6:65), in the order of `values`. If those below 0.05 are called
/// significant, the probability of any false positive among them is at most 5 %.
#[must_use]
pub(crate) fn holm(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut adjusted = vec![0.0; values.len()];
    let mut highest = 0.0_f64;
    for (rank, index) in order.into_iter().enumerate() {
        highest = highest.max((values.len() - rank) as f64 * values[index]);
        adjusted[index] = highest.min(1.0);
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOLDEN_MCNEMAR: [(usize, usize, f64); 9] = [
        (0, 1, 1.0),
        (3, 9, 0.14599609375),
        (10, 10, 1.0),
        (86, 150, 3.7159361395713866e-05),
        (1, 25, 8.046627044677734e-07),
        (700, 900, 6.319484959450105e-07),
        (2000, 2300, 5.079935568924055e-06),
        (5000, 5100, 0.32458154633139585),
        (40, 0, 1.8189894035458565e-12),
    ];

    const GOLDEN_HOLM: [(f64, f64); 8] = [
        (0.01, 0.06),
        (0.04, 0.15),
        (0.03, 0.15),
        (0.005, 0.035),
        (0.6, 1.0),
        (0.0001, 0.0008),
        (0.03, 0.15),
        (1.0, 1.0),
    ];

    #[test]
    fn mcnemar_is_the_sign_test() {
        // scipy 1.17.1, binomtest(b, b + c).pvalue.
        for (gained, lost, expected) in GOLDEN_MCNEMAR {
            let p = mcnemar(gained, lost);
            assert!(
                (p - expected).abs() < 1e-9 && (p / expected - 1.0).abs() < 1e-9,
                "{gained} {lost}: {p}"
            );
            assert!((p - mcnemar(lost, gained)).abs() < 1e-15);
            let single = [vec![1; gained], vec![-1; lost], vec![0; 5]].concat();
            assert!((sign_flip(&single) - p).abs() < 1e-9, "{gained} {lost}");
        }
    }

    #[test]
    fn swaps_are_counted() {
        for differences in [
            vec![],
            vec![0, 0],
            vec![3],
            vec![2, -1, 3],
            vec![1, 1, 1, -4, 2, 2, -1, 5],
        ] {
            let total: i64 = differences.iter().sum();
            let n = differences.len();
            let extreme = (0..1_u32 << n).filter(|signs| {
                let sum: i64 = (0..n)
                    .map(|i| {
                        if signs >> i & 1 == 0 {
                            differences[i]
                        } else {
                            -differences[i]
                        }
                    })
                    .sum();
                sum.abs() >= total.abs()
            });
            let expected = extreme.count() as f64 / f64::from(1_u32 << n);
            assert!(
                (sign_flip(&differences) - expected).abs() < 1e-12,
                "{differences:?}"
            );
        }
    }

    #[test]
    fn holm_steps_down() {
        // statsmodels 0.15.0, multipletests(method="holm").
        let adjusted = holm(&GOLDEN_HOLM.map(|(p, _)| p));
        for (adjusted, (p, expected)) in adjusted.iter().zip(GOLDEN_HOLM) {
            assert!((adjusted - expected).abs() < 1e-9, "{p}");
        }
        assert!(holm(&[]).is_empty());
    }
}
