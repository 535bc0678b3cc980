//! The mean of a few numbers with its interval: [`Mean`].

use serde::Serialize;

/// A mean with its 95 % interval by Student's t distribution; one number alone has none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Mean {
    /// The mean; `None` in JSON where it is infinite.
    pub value: f64,
    /// The interval.
    pub interval: Option<[f64; 2]>,
    /// Of how many.
    pub n: usize,
}

impl Mean {
    /// The mean of numbers, of which some may be infinite; `None` of none.
    #[must_use]
    pub fn of(numbers: &[f64]) -> Option<Self> {
        let n = numbers.len();
        if n == 0 {
            return None;
        }
        let value = numbers.iter().sum::<f64>() / n as f64;
        let squares: f64 = numbers.iter().map(|x| (x - value) * (x - value)).sum();
        let interval = (n > 1 && value.is_finite()).then(|| {
            let error = (squares / (n - 1) as f64 / n as f64).sqrt();
            let half = student(n - 1) * error;
            [value - half, value + half]
        });
        Some(Self { value, interval, n })
    }
}

/// The 97.5 % quantile of Student's t distribution.
fn student(freedom: usize) -> f64 {
    /// For 1 to 10 degrees of freedom (Fisher and Yates 1938).
    const FEW: [f64; 10] = [
        12.706_205, 4.302_653, 3.182_446, 2.776_445, 2.570_582, 2.446_912, 2.364_624, 2.306_004,
        2.262_157, 2.228_139,
    ];
    if let Some(quantile) = freedom.checked_sub(1).and_then(|index| FEW.get(index)) {
        return *quantile;
    }
    // Cornish and Fisher's expansion about the normal quantile, good to 2·10⁻⁴.
    let (z, n) = (1.959_963_984_540_054_f64, freedom as f64);
    let (z3, z5) = (z.powi(3), z.powi(5));
    z + (z3 + z) / (4.0 * n)
        + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * n * n)
        + (3.0 * z.powi(7) + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * n * n * n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_the_tabled_ones() {
        for (freedom, due) in [
            (1, 12.7062),
            (10, 2.2281),
            (11, 2.2010),
            (30, 2.0423),
            (120, 1.9799),
        ] {
            assert!((student(freedom) - due).abs() < 2e-4, "{freedom}");
        }
    }

    #[test]
    fn an_interval_needs_two_numbers() {
        assert_eq!(Mean::of(&[]), None);
        assert_eq!(Mean::of(&[3.0]).unwrap().interval, None);
        let mean = Mean::of(&[1.0, 3.0]).unwrap();
        let [low, high] = mean.interval.unwrap();
        assert!((mean.value - 2.0).abs() < 1e-12);
        assert!((high - 2.0 - 12.706_205).abs() < 1e-6 && (2.0 - low - 12.706_205).abs() < 1e-6);
        assert_eq!(Mean::of(&[1.0, f64::INFINITY]).unwrap().interval, None);
    }
}
