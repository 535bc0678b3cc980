//! A difference with its tests in one parsing ([`Tested`]), and the statement that both parsings support ([`Claim`]).

use crate::estimate::Estimate;
use crate::significance::{ALPHA, PValues, SwapMethod, Verdict};

/// The difference of two sides with its tests, in one parsing of the replies. Tables, figures and sentences about any
/// difference take their verdict from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tested {
    /// First side minus second side.
    pub difference: Estimate,
    /// p-value of no difference, whatever the missing replies would have been.
    pub p: f64,
    /// Smallest p-value that any values of the missing replies could give; `p` if no reply is missing.
    pub p_if_answered: f64,
    /// How the swaps of the two sides were counted; `None` for a test by Student's t alone.
    pub p_by: Option<SwapMethod>,
    /// p-value after Holm's correction within its own set of tests; `p` for a test that is corrected only with those
    /// behind other sentences.
    pub holm: f64,
    /// Verdict within its own set of tests. A detected increase of false answers is `Worse`.
    pub verdict: Verdict,
    /// p-value after the correction over all tests behind sentences; `None` if no sentence is about the difference.
    pub p_report: Option<f64>,
}

impl Tested {
    /// Creates a test by Student's t, not corrected yet.
    #[must_use]
    pub fn new(difference: Estimate, p: f64) -> Self {
        Self { difference, p, p_if_answered: p, p_by: None, holm: p, verdict: Verdict::NotShown, p_report: None }
    }

    /// p-values before correction, for a test whose clusters allow no smaller one than `least`.
    pub(crate) fn p_values(&self, least: f64) -> PValues {
        PValues { p: self.p, if_answered: self.p_if_answered, least }
    }

    /// Sets the p-value and the verdict within its own set of tests; `gain` is the gain of the first side.
    pub(crate) fn correct(&mut self, gain: f64, corrected: PValues) {
        self.holm = corrected.p;
        self.verdict = Verdict::new(gain, corrected);
    }

    /// True if the difference is detected after the correction over all tests behind sentences.
    #[must_use]
    pub fn is_detected(&self) -> bool {
        self.p_report.is_some_and(|p| p < ALPHA)
    }

    /// p-value that a sentence states: after the correction over all sentences, or within its own set of tests if it
    /// was not part of that correction.
    #[must_use]
    pub fn stated_p(&self) -> f64 {
        self.p_report.unwrap_or(self.holm)
    }
}

/// Statement that the sentences of a report may make about a finding that was tested in both parsings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Claim {
    /// Detected after the correction over all sentences, in both parsings and in the same direction.
    Detected(Verdict),
    /// Detected after that correction in the strict parsing only, with this direction.
    StrictOnly(Verdict),
    /// Detected only by the correction within its own set of tests.
    InOwnSet,
    /// The missing replies decide whether a difference is detected.
    Missing,
    /// Not detected.
    Open,
    /// No verdict is possible with so few clusters or items.
    Impossible,
}

impl Claim {
    /// Derives the claim from both parsings; `gain` turns a difference into a gain of the first side.
    pub(super) fn new([strict, lenient]: [&Tested; 2], gain: impl Fn(f64) -> f64) -> Self {
        let [own, other] = [strict, lenient].map(|tested| gain(tested.difference.value));
        let direction = if own > 0.0 { Verdict::Better } else { Verdict::Worse };
        if !strict.verdict.is_possible() {
            Self::Impossible
        } else if strict.is_detected() && lenient.is_detected() && own * other > 0.0 {
            Self::Detected(direction)
        } else if strict.is_detected() {
            Self::StrictOnly(direction)
        } else if strict.verdict.is_shown() {
            Self::InOwnSet
        } else if strict.verdict == Verdict::Missing {
            Self::Missing
        } else {
            Self::Open
        }
    }

    /// Verdict of a difference in tables, the same as in sentences; `strict` is its test in the strict parsing.
    /// `None` if no sentence is about the difference.
    pub(super) fn verdict(self, strict: &Tested) -> Option<Verdict> {
        match self {
            _ if !strict.verdict.is_possible() => Some(strict.verdict),
            _ if strict.p_report.is_none() => None,
            Self::Detected(verdict) => Some(verdict),
            Self::Missing => Some(Verdict::Missing),
            _ => Some(Verdict::NotShown),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finding(value: f64, p: f64) -> Tested {
        let difference = Estimate { value, low: -1.0, high: 1.0, n: 10 };
        Tested { verdict: Verdict::Worse, p_report: Some(p), ..Tested::new(difference, p) }
    }

    fn claim(strict: Tested, lenient: Tested) -> Claim {
        Claim::new([&strict, &lenient], |difference| difference)
    }

    #[test]
    fn detection_needs_both_parsings_in_one_direction() {
        for (strict, lenient, expected) in [
            ((-0.2, 0.01), (-0.1, 0.01), Claim::Detected(Verdict::Worse)),
            ((-0.2, 0.01), (-0.1, 0.2), Claim::StrictOnly(Verdict::Worse)),
            ((0.2, 0.01), (-0.1, 0.01), Claim::StrictOnly(Verdict::Better)),
            ((-0.2, 0.05), (-0.1, 0.01), Claim::InOwnSet),
        ] {
            let [strict, lenient] = [strict, lenient].map(|(value, p)| finding(value, p));
            assert_eq!(claim(strict, lenient), expected);
        }
        let unshown = Tested { verdict: Verdict::NotShown, p_report: None, ..finding(-0.2, 0.5) };
        assert_eq!(claim(unshown, unshown), Claim::Open);
        let few = Tested { verdict: Verdict::TooFewClusters, ..finding(-0.2, 0.001) };
        assert_eq!(claim(few, few), Claim::Impossible);
        // More false answers are a loss.
        let (strict, lenient) = (finding(0.2, 0.01), finding(0.1, 0.01));
        assert_eq!(Claim::new([&strict, &lenient], |d| -d), Claim::Detected(Verdict::Worse));
    }
}
