//! A number with its uncertainty: [`Estimate`].

use serde::{Deserialize, Serialize};

/// The 97.5 % quantile of the standard normal distribution, for 95 % intervals.
const Z: f64 = 1.959_963_984_540_054;

/// A share between 0 and 1 with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The share itself.
    pub value: f64,
    /// The lower end of the interval.
    pub low: f64,
    /// The upper end of the interval.
    pub high: f64,
    /// How many trials it rests on.
    pub n: usize,
}

impl Estimate {
    /// The share of `right` among `n` trials with Wilson's score interval; `None` of no trials.
    ///
    /// The interval takes the trials as independent (Wilson 1927, J. Am. Stat. Assoc. 22:209): questions about one
    /// frame share its light, so the true uncertainty is somewhat larger.
    #[must_use]
    pub fn share(right: usize, n: usize) -> Option<Self> {
        Self::over(right, n, n)
    }

    /// The share of `right` among `n` replies to fewer questions, each asked several times: the interval is that of the
    /// number of questions, since replies to one question say little more than one of them.
    #[must_use]
    pub fn over(right: usize, n: usize, questions: usize) -> Option<Self> {
        if n == 0 || right > n || questions == 0 {
            return None;
        }
        let (count, value) = (questions as f64, right as f64 / n as f64);
        let scale = 1.0 + Z * Z / count;
        let center = (value + Z * Z / (2.0 * count)) / scale;
        let half =
            Z / scale * (value * (1.0 - value) / count + Z * Z / (4.0 * count * count)).sqrt();
        Some(Self {
            value,
            low: (center - half).max(0.0),
            high: (center + half).min(1.0),
            n,
        })
    }

    /// A share that is known exactly.
    #[must_use]
    pub fn exact(value: f64, n: usize) -> Self {
        Self {
            value,
            low: value,
            high: value,
            n,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_matches_published_values() {
        // Newcombe 1998 (Stat. Med. 17:857), table I, method 3.
        for (right, n, low, high) in [
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let share = Estimate::share(right, n).unwrap();
            assert!(
                (share.low - low).abs() < 5e-5 && (share.high - high).abs() < 5e-5,
                "{right}/{n}: {share:?}"
            );
        }
        assert_eq!(Estimate::share(0, 0), None);
        let (once, thrice) = (Estimate::share(15, 148), Estimate::over(45, 444, 148));
        assert_eq!(
            thrice,
            once.map(|once| Estimate { n: 444, ..once }),
            "the interval of the questions"
        );
        let all = Estimate::share(7, 7).unwrap();
        assert!(all.high <= 1.0 && all.low < 1.0);
    }
}
