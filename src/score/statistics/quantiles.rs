//! Quantiles and tails of distributions: [`student`] with its [`degrees_of_freedom`], [`two_sided_tail`], and
//! [`least_share`].

use statrs::distribution::{Beta, ContinuousCDF as _, StudentsT};

/// The 97.5 % quantile of Student's t distribution with `degrees` degrees of freedom, not necessarily an integer;
/// infinite for 0.
#[must_use]
pub(crate) fn student(degrees: f64) -> f64 {
    quantile(0.975, degrees)
}

/// The quantile of Student's t distribution at `share`; infinite for 0 degrees of freedom.
#[must_use]
pub(crate) fn quantile(share: f64, degrees: f64) -> f64 {
    StudentsT::new(0.0, 1.0, degrees).map_or(f64::INFINITY, |student| student.inverse_cdf(share))
}

/// The two-sided tail probability of Student's t: that it is at least `distance` away from 0. 1 for 0 degrees of
/// freedom.
#[must_use]
pub(crate) fn two_sided_tail(distance: f64, degrees: f64) -> f64 {
    StudentsT::new(0.0, 1.0, degrees).map_or(1.0, |student| (2.0 * student.sf(distance)).min(1.0))
}

/// Degrees of freedom of a variance between C clusters, from the clusters' residuals r: C / (κ − 1), limited to 2 to C
/// − 1, with the kurtosis κ = C Σr⁴ / (Σr²)².
///
/// The variance of a variance grows with the kurtosis (Satterthwaite 1946, Biometrics Bull. 2:110, gives 2C / (κ − 1)).
/// κ is estimated from the same clusters and is too small if a few clusters dominate the variance. In simulations,
/// intervals with half of Satterthwaite's number cover the truth even if shares are near 0 or 1 and clusters are
/// strongly correlated (`tests/program/scores/coverage/`).
#[must_use]
pub(crate) fn degrees_of_freedom(residuals: &[f64]) -> f64 {
    let c = residuals.len() as f64;
    let squares = residuals.iter().map(|residual| residual * residual);
    let second: f64 = squares.clone().sum();
    let fourth: f64 = squares.map(|square| square * square).sum();
    let kurtosis = c * fourth / (second * second);
    if kurtosis > 1.0 { (c / (kurtosis - 1.0)).clamp(f64::min(2.0, c - 1.0), c - 1.0) } else { c - 1.0 }
}

/// The lower end of the exact 95 % interval of a share, from `hits` of `n` independent trials (Clopper and Pearson
/// 1934, Biometrika 26:404).
#[must_use]
pub(crate) fn least_share(hits: usize, n: usize) -> f64 {
    Beta::new(hits as f64, (n - hits) as f64 + 1.0).map_or(0.0, |beta| beta.inverse_cdf(0.025))
}

#[cfg(test)]
mod tests {
    use super::*;

    const STUDENTS: [(f64, f64); 10] = [
        (2.0, 4.30265272975),
        (2.0625, 4.18009114849),
        (2.5, 3.574654842),
        (3.1, 3.12515056686),
        (3.75, 2.85098928359),
        (5.5, 2.50185861759),
        (9.2, 2.25468293628),
        (24.7, 2.06080767881),
        (51.0, 2.00758377032),
        (113.3, 1.98112358874),
    ];

    const SHARES: [(usize, usize, f64); 8] = [
        (1, 8, 0.00315972353125),
        (8, 8, 0.630583352447),
        (3, 8, 0.0852334141373),
        (40, 52, 0.631597228358),
        (51, 52, 0.897446455348),
        (52, 52, 0.931517791297),
        (1, 300, 8.43891323178e-05),
        (250, 300, 0.7862443212),
    ];

    #[test]
    fn quantiles_match_published_tables() {
        // NIST/SEMATECH e-Handbook of Statistical Methods, section 1.3.6.7.2, with more digits from R's qt().
        for (degrees, expected) in [
            (1, 12.706_204_736),
            (2, 4.302_652_730),
            (10, 2.228_138_852),
            (11, 2.200_985_160),
            (30, 2.042_272_456),
            (120, 1.979_930_405),
            (1000, 1.962_339_081),
        ] {
            assert!((student(f64::from(degrees)) - expected).abs() < 1e-9, "{degrees}");
        }
        assert!(student(0.0).is_infinite());
    }

    #[test]
    fn tails_match_the_quantiles() {
        for (degrees, quantile) in STUDENTS {
            assert!((two_sided_tail(quantile, degrees) - 0.05).abs() < 1e-9, "{degrees}");
        }
        assert!((two_sided_tail(1.0, 0.0) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn quantiles_match_scipy() {
        // scipy 1.17.1, t.ppf(0.975, df) and beta.ppf(0.025, hits, n - hits + 1).
        for (degrees, expected) in STUDENTS {
            assert!((student(degrees) - expected).abs() < 1e-9, "{degrees}: {}", student(degrees));
        }
        for (hits, n, expected) in SHARES {
            let least = least_share(hits, n);
            assert!((least - expected).abs() < 1e-9, "{hits} of {n}: {least}");
        }
        assert!(least_share(0, 9) < f64::MIN_POSITIVE);
    }
}
