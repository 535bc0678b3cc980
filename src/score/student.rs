//! Student's t distribution: [`student`].

use statrs::distribution::{ContinuousCDF as _, StudentsT};

/// The 97.5 % quantile of Student's t distribution with `degrees` degrees of freedom; infinite for 0.
#[must_use]
pub(super) fn student(degrees: usize) -> f64 {
    let distribution = StudentsT::new(0.0, 1.0, degrees as f64);
    distribution.map_or(f64::INFINITY, |student| student.inverse_cdf(0.975))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_the_tabled_ones() {
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
            assert!((student(degrees) - expected).abs() < 1e-9, "{degrees}");
        }
        assert!(student(0).is_infinite());
    }
}
