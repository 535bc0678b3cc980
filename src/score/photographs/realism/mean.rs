//! Mean of few numbers with its interval: [`Mean`].

use serde::Serialize;

use crate::statistics::quantiles::student;

/// Minimum number of values for an interval (chosen). With two values, the half-width is more than 6 times their
/// distance, which can exceed the range of the quantity.
pub const MIN_VALUES: usize = 3;

/// A mean with its 95 % interval by Student's t distribution.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Mean {
    /// Mean; null in JSON if it is infinite.
    pub value: f64,
    /// Bounds of the interval; `None` for fewer than [`MIN_VALUES`] numbers or an infinite mean.
    pub interval: Option<[f64; 2]>,
    /// Number of values.
    pub n: usize,
}

impl Mean {
    /// Computes the mean of numbers, some of which may be infinite; `None` without numbers.
    #[must_use]
    pub fn from_values(numbers: &[f64]) -> Option<Self> {
        let n = numbers.len();
        if n == 0 {
            return None;
        }
        let value = numbers.iter().sum::<f64>() / n as f64;
        let squares: f64 = numbers.iter().map(|x| (x - value) * (x - value)).sum();
        let interval = (n >= MIN_VALUES && value.is_finite()).then(|| {
            let error = (squares / (n - 1) as f64 / n as f64).sqrt();
            let half = student((n - 1) as f64) * error;
            [value - half, value + half]
        });
        Some(Self { value, interval, n })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_needs_three_numbers() {
        assert_eq!(Mean::from_values(&[]), None);
        for few in [&[3.0][..], &[1.0, 3.0]] {
            assert_eq!(Mean::from_values(few).unwrap().interval, None);
        }
        let mean = Mean::from_values(&[1.0, 2.0, 3.0]).unwrap();
        let [low, high] = mean.interval.unwrap();
        // t of 2 degrees of freedom, times 1/√3.
        let half = 4.302_652_730 / f64::sqrt(3.0);
        assert!((mean.value - 2.0).abs() < 1e-12);
        assert!((high - 2.0 - half).abs() < 1e-6 && (2.0 - low - half).abs() < 1e-6);
        let infinite = Mean::from_values(&[1.0, 2.0, f64::INFINITY]).unwrap();
        assert_eq!(infinite.interval, None);
    }
}
